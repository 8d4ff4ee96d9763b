/// @file sigma_mesh.h
/// Triangles with corners on Sigma = {p_A = p_B}, by tetrahedra in the cells of a lattice where both bodies may press.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "surface/find_peak.h"
#include "surface/march/flat_cells.h"
#include "surface/march/first_come.h"
#include "surface/pair_pressure.h"

namespace supple::collision {

/// Between the plane triangles and Sigma there is a map without gaps: from the triangle along the normals of its corners,
/// interpolated linearly. Two triangles at one edge share its image, so their images tile Sigma.
struct SigmaMesh {
  std::vector<Vec3> vertex;               ///< on Sigma [m]
  std::vector<Vec3> normal;               ///< unit, out of A and into B; zero where no place on Sigma was found
  std::vector<std::uint8_t> at_end;       ///< 1: beside the end of both supports, beyond which p_A - p_B is nothing, or round-off
  struct Triangle {
    std::array<std::uint32_t, 3> corner;  ///< seen from B's side counterclockwise
  };
  std::vector<Triangle> triangle;
};

class SigmaMesher {
 public:
  /// @param overlap  finite; holds all of Sigma where p > 0   @param cell  side of the lattice's cells [m], about, the shortest one
  /// @param axis  of symmetry, if there is one: two planes through it, at right angles, mirror the triangles; else the lattice is that of the
  ///              bodies' common pose, or of `flat`   @param flat  cells that are not cubes
  /// @return false where there would be more cells than kMostCells
  bool mesh(PairPressure& pressure, const Box& overlap, double cell, const std::optional<CommonAxis>& axis, const std::optional<FlatCells>& flat,
            SigmaMesh& out);

  static constexpr std::size_t kMostCells = 1u << 16;

 private:
  using Key = std::uint64_t;
  void lay_lattice(const PairPressure& pressure, const Box& overlap, double cell, const std::optional<CommonAxis>& axis,
                   const std::optional<FlatCells>& flat);
  [[nodiscard]] Box box_of(Key key, double side, double beside) const;
  bool find_cells(const PairPressure& pressure, const Box& overlap);
  void find_nodes(PairPressure& pressure);
  void cut_cells(const PairPressure& pressure, const Box& overlap, SigmaMesh& out);
  void place_vertices(PairPressure& pressure, SigmaMesh& out);
  [[nodiscard]] Vec3 place(Key key) const;

  struct Cut {
    std::uint32_t above, below;  // nodes: p_A >= p_B, p_A < p_B
    [[nodiscard]] std::uint64_t key() const { return static_cast<std::uint64_t>(above) << 32 | below; }
    static Cut of(std::uint64_t key) { return {static_cast<std::uint32_t>(key >> 32), static_cast<std::uint32_t>(key)}; }
  };
  /// Where Sigma cuts the way from `above` to `below`, between places on both sides of it.
  struct Edge {
    double at = 0.0, low = 0.0, high = 1.0;
  };
  Vec3 origin_ = Vec3::Zero();
  Mat3 axes_ = Mat3::Identity();  // of the lattice, columns, which are longer than 1 where cells are longer than `cell_`
  bool mirrored_ = false;
  double cell_ = 0.0;
  std::vector<Key> cells_, near_, nodes_;
  PressureBatch node_, vertex_, some_;
  std::vector<Cut> cuts_, unique_;
  FirstCome numbered_;
  std::vector<Edge> edge_;
  std::vector<std::size_t> open_;
  std::vector<std::uint8_t> met_;  // vertices that Newton's method placed
};

}  // namespace supple::collision
