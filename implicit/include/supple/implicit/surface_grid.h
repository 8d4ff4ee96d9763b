/// @file supple/implicit/surface_grid.h
/// The field near its surface as an OpenVDB FloatGrid (narrow band), written so that stock OpenVDB tools read it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "supple/core/executor.h"
#include "supple/implicit/field_view.h"
#include "supple/implicit/polygonise.h"

namespace supple::implicit {

enum class GridContent : std::uint8_t {
  Field,           ///< F itself [1], > 0 inside; grid class unknown
  SignedDistance,  ///< first-order distance -F/|grad F| [m], < 0 inside, clamped to the band; grid class level set
};

struct GridOptions {
  Lattice lattice;
  GridContent content = GridContent::SignedDistance;
  double half_width = 3.0;               ///< band on each side of the surface [cells], >= 1
  std::uint64_t max_voxels = 200'000'000;  ///< refuse beyond
  std::string name = "surface";
};

/// Owns one grid; copyable handle.
class SurfaceGrid {
 public:
  SurfaceGrid();
  ~SurfaceGrid();
  SurfaceGrid(SurfaceGrid&&) noexcept;
  SurfaceGrid& operator=(SurfaceGrid&&) noexcept;

  [[nodiscard]] std::uint64_t active_voxels() const;
  [[nodiscard]] std::uint64_t memory_bytes() const;
  [[nodiscard]] std::uint64_t hash() const;         ///< over active voxels in lattice order
  [[nodiscard]] double value(std::int32_t i, std::int32_t j, std::int32_t k) const;  ///< stored value at a node
  [[nodiscard]] double interpolate(const Vec3& world) const;                          ///< trilinear

 private:
  friend SurfaceGrid make_surface_grid(const FieldView&, const GridOptions&, const Executor&);
  friend void write_grids(const std::filesystem::path&, std::span<const SurfaceGrid>);
  friend SurfaceGrid read_grid(const std::filesystem::path&, const std::string&);
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Samples the band {|F| <= half_width cell |grad F|}: only leaves that bounds cannot exclude are evaluated.
/// @throws Error{Limit} before allocating when the band could exceed max_voxels, naming the cell size that would fit.
[[nodiscard]] SurfaceGrid make_surface_grid(const FieldView& field, const GridOptions& options,
                                            const Executor& executor);

/// Writes one .vdb with all grids, by temporary file and rename. @throws Error{Io}
void write_grids(const std::filesystem::path& path, std::span<const SurfaceGrid> grids);
/// @throws Error{Io} when absent, Error{Corrupt} when not a grid of that name.
[[nodiscard]] SurfaceGrid read_grid(const std::filesystem::path& path, const std::string& name);

}  // namespace supple::implicit
