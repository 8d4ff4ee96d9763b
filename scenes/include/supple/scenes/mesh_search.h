/// @file supple/scenes/mesh_search.h
/// Defects of meshes: missed pieces (implicit/missed_pieces.h) found by searches, meshes that were not searched, intersecting triangles,
/// creases that are cut off to avoid these, and bulges that hold too little volume.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>

namespace supple::scenes {

/// Why a mesh is not searched.
enum class Unsearched : std::uint8_t {
  Bulges,      ///< contact deforms the body by bulges, which are not part of its field, or the body passes through another one
  Undecided,   ///< cells along its blends or bends would stay undecided
  Cost,        ///< the search would cost far more than meshing
  Mesher,      ///< the mesh is not made by marching cubes
};
inline constexpr std::array<std::string_view, 4> kUnsearchedNames{"bulges", "undecided", "cost", "mesher"};

/// Bulges of one object around another that hold less volume than their contacts displace (collision::BulgeVolume).
struct ShortBulges {
  std::uint64_t count = 0;  ///< number of contacts
  double held = 1.0;        ///< smallest share of the displaced volume [1]
  double time = 0.0;        ///< of that contact [s]
  void add(const ShortBulges& other) {
    count += other.count;
    if (!(other.held < held)) return;
    held = other.held;
    time = other.time;
  }
};

/// Counts over the meshes of one or several states; also bulges of grids.
struct SearchCounts {
  using Meshes = std::array<std::uint64_t, kUnsearchedNames.size()>;  ///< by reason
  std::uint64_t pieces = 0;     ///< found and added
  std::uint64_t undecided = 0;  ///< cells where a piece may be missing
  std::uint64_t crossings = 0;  ///< pairs of intersecting triangles of method delaunay
  std::map<std::string, Meshes> unsearched;  ///< by object, where there are any
  std::map<std::string, std::uint64_t> blunt;  ///< by object, where there are any: cells whose crease stays cut off, as triangles would intersect

  std::map<std::string, std::map<std::string, ShortBulges>> short_bulges;  ///< by the object that bulges and the one it bulges around, where there are any

  [[nodiscard]] bool empty() const {
    return pieces == 0 && undecided == 0 && crossings == 0 && unsearched.empty() && blunt.empty() && short_bulges.empty();
  }
  [[nodiscard]] std::uint64_t not_searched(Unsearched why) const {
    std::uint64_t sum = 0;
    for (const auto& [object, meshes] : unsearched) sum += meshes[static_cast<std::size_t>(why)];
    return sum;
  }
  void add(const SearchCounts& other) {
    pieces += other.pieces;
    undecided += other.undecided;
    crossings += other.crossings;
    for (const auto& [object, meshes] : other.unsearched) {
      for (std::size_t k = 0; k < meshes.size(); ++k) unsearched[object][k] += meshes[k];
    }
    for (const auto& [object, cells] : other.blunt) blunt[object] += cells;
    for (const auto& [object, around] : other.short_bulges) {
      for (const auto& [body, bulges] : around) short_bulges[object][body].add(bulges);
    }
  }
};

}  // namespace supple::scenes
