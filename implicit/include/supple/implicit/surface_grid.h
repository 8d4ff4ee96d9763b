/// @file supple/implicit/surface_grid.h
/// The field near its surface as an OpenVDB FloatGrid (narrow band), written so that stock OpenVDB tools read it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "supple/core/executor.h"
#include "supple/core/mesh.h"
#include "supple/implicit/field.h"
#include "supple/implicit/polygonise.h"

namespace supple::implicit {

enum class GridContent : std::uint8_t {
  Field,           ///< F itself [1], > 0 inside; grid class unknown
  SignedDistance,  ///< first-order distance -F/|grad F| [m], < 0 inside, clamped to the band; grid class level set
};

/// Smallest cell of a grid [m]: OpenVDB treats a transform as singular if its determinant is below 3e-15.
inline constexpr double kLeastGridCell = 1.45e-5;

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
  [[nodiscard]] std::uint64_t hash() const;         ///< over active voxels in lattice order
  [[nodiscard]] double value(std::int32_t i, std::int32_t j, std::int32_t k) const;  ///< stored value at a node
  [[nodiscard]] double interpolate(const Vec3& world) const;                          ///< trilinear

 private:
  friend class GridUpdater;
  friend class UnionUpdater;
  friend SurfaceGrid make_surface_grid(const FieldView&, const GridOptions&, const Executor&);
  friend void write_grids(const std::filesystem::path&, std::span<const SurfaceGrid* const>);
  friend Mesh mesh_of(const SurfaceGrid&, const FieldView&, const Executor&);
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Samples the band {|F| <= half_width cell |grad F|}: only leaves that bounds do not exclude are evaluated.
/// @throws Error{Limit} before allocating when the narrow band could exceed max_voxels, naming a sufficient cell size, and for cells below
/// kLeastGridCell.
[[nodiscard]] SurfaceGrid make_surface_grid(const FieldView& field, const GridOptions& options,
                                            const Executor& executor);

struct GridCounts {
  std::uint64_t leaves_looked_at = 0;  ///< leaves of 8^3 voxels whose bounds or values were evaluated in this call
  std::uint64_t leaves_sampled = 0;    ///< of these, evaluated
  bool whole = false;                  ///< everything was rebuilt
};

/// Makes the grid of one body repeatedly: only leaves are changed that the present or former support of a moved primitive
/// reaches. The grid is that of `make_surface_grid`, in values, in its tree and so in its file.
class GridUpdater {
 public:
  GridUpdater();
  ~GridUpdater();
  GridUpdater(GridUpdater&&) noexcept;
  GridUpdater& operator=(GridUpdater&&) noexcept;

  /// Valid until the next call. Everything is rebuilt where options, iso value or blend are not those of the last call, where half of
  /// the primitives moved and where more than half of the leaves would change.
  /// @throws as make_surface_grid; the next call then rebuilds everything
  const SurfaceGrid& make(const Field& field, const GridOptions& options, const Executor& executor,
                          GridCounts* counts = nullptr);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// A field as its own distance to first order: F / |grad F| [m], > 0 inside, of slope 1. What is nearest by it is nearest to
/// first order, whatever the kernels of the fields that are compared.
class DepthField {
 public:
  /// @param field  the viewed object must outlive this
  explicit DepthField(FieldView field) : field_(field) {}
  void evaluate(std::span<const Vec3> points, std::span<double> values) const;
  /// Gradients are unit vectors along grad F, or 0 where grad F is 0: values are infinite there, or 0 on the surface.
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const;
  void evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const { field_.evaluate_parts(points, parts); }
  [[nodiscard]] Interval bound(const Box& box) const;
  [[nodiscard]] double gradient_bound(const Box& /*box*/) const { return 1.0; }
  [[nodiscard]] Box surface_box() const { return field_.surface_box(); }
  [[nodiscard]] double feature_size() const { return field_.feature_size(); }

 private:
  FieldView field_;
};

/// Several bodies as one: the largest of their fields. Of `DepthField`s it is the depth in the union, so a signed distance is
/// that to the nearest body.
class UnitedField {
 public:
  /// @param fields  must outlive this
  explicit UnitedField(std::vector<FieldView> fields) : fields_(std::move(fields)) {}
  void evaluate(std::span<const Vec3> points, std::span<double> values) const;
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const;
  /// @throws ContractViolation: parts of several bodies have no common numbers
  void evaluate_parts(std::span<const Vec3> points, FieldParts& parts) const;
  [[nodiscard]] Interval bound(const Box& box) const;
  [[nodiscard]] double gradient_bound(const Box& box) const;
  [[nodiscard]] Box surface_box() const;
  [[nodiscard]] double feature_size() const;

 private:
  std::vector<FieldView> fields_;
};

/// A body of a union.
struct UnitedBody {
  FieldView view;             ///< for GridContent::SignedDistance its DepthField, of slope 1; must outlive the call
  std::uint64_t version = 0;  ///< unique: equal versions, of any calls, mean that the view is unchanged to the bit (core/content_versions.h)
  const Field* field = nullptr;  ///< the Field behind the view, if any: then leaves out of reach of its moved primitives are kept
};

/// Makes the grid of several bodies as one repeatedly: only leaves are changed that a changed body reaches or
/// reached. The grid is that of `make_surface_grid` of a UnitedField of the views, in values, in its tree and so in its file.
class UnionUpdater {
 public:
  UnionUpdater();
  ~UnionUpdater();
  UnionUpdater(UnionUpdater&&) noexcept;
  UnionUpdater& operator=(UnionUpdater&&) noexcept;

  /// Valid until the next call. Everything is rebuilt where options are not those of the last call and where more than half of the
  /// leaves would change.
  /// @throws as make_surface_grid; the next call then rebuilds everything
  const SurfaceGrid& make(std::span<const UnitedBody> bodies, const GridOptions& options, const Executor& executor,
                          GridCounts* counts = nullptr);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The surface of a grid by OpenVDB's volumeToMesh (dual contouring without normals), its quadrangles divided, its vertices projected
/// onto the surface of the field along its gradients, with its normals. Vertices keep their position that Newton's steps do not bring there within half a
/// cell, or whose triangles would be inverted or intersect others, and all of a closed piece that would be flattened. The field is that of which the grid
/// was made.
[[nodiscard]] Mesh mesh_of(const SurfaceGrid& grid, const FieldView& field, const Executor& executor);

/// Writes one .vdb with all grids, by temporary file and rename. @throws Error{Io}
void write_grids(const std::filesystem::path& path, std::span<const SurfaceGrid> grids);
void write_grids(const std::filesystem::path& path, std::span<const SurfaceGrid* const> grids);

}  // namespace supple::implicit
