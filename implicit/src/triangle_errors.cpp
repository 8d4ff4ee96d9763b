#include "triangle_errors.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <span>
#include <utility>

#include "error_search.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"

namespace supple::implicit {
namespace {

constexpr std::uint32_t kNone = ~std::uint32_t{0};

using VertexWords = std::array<std::uint64_t, 6>;
VertexWords words_of(const Mesh& mesh, std::size_t v) {
  VertexWords words{};
  std::memcpy(words.data(), mesh.position[v].data(), sizeof(Vec3));
  std::memcpy(words.data() + 3, mesh.normal[v].data(), sizeof(Vec3));
  return words;
}

/// For each vertex of a mesh one of another mesh with the same bits; kNone where there is none.
std::vector<std::uint32_t> same_vertices(const Mesh& mesh, const Mesh& other) {
  const std::size_t slots = std::bit_ceil(2 * other.vertex_count() + 1);
  std::vector<std::uint32_t> table(slots, kNone);
  const auto slot_of = [&](const Mesh& of, std::size_t v) {
    const VertexWords words = words_of(of, v);
    std::size_t at = static_cast<std::size_t>(hash_bytes(std::as_bytes(std::span(words)))) & (slots - 1);
    while (table[at] != kNone && words_of(other, table[at]) != words) at = (at + 1) & (slots - 1);
    return at;
  };
  for (std::size_t v = 0; v < other.vertex_count(); ++v) table[slot_of(other, v)] = static_cast<std::uint32_t>(v);
  std::vector<std::uint32_t> same(mesh.vertex_count());
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) same[v] = table[slot_of(mesh, v)];
  return same;
}

/// For each triangle of a mesh one of another mesh with the same corners in the same order; kNone where there is none.
std::vector<std::uint32_t> same_triangles(const Mesh& mesh, const Mesh& other) {
  const std::vector<std::uint32_t> vertex = same_vertices(mesh, other);
  std::vector<std::uint32_t> start(other.vertex_count() + 1, 0), sorted(other.triangle_count());  // by the first corner
  for (const auto& t : other.triangle) ++start[t[0] + 1];
  for (std::size_t v = 0; v < other.vertex_count(); ++v) start[v + 1] += start[v];
  std::vector<std::uint32_t> next = start;
  for (std::size_t i = 0; i < other.triangle_count(); ++i) sorted[next[other.triangle[i][0]]++] = static_cast<std::uint32_t>(i);
  std::vector<std::uint32_t> same(mesh.triangle_count(), kNone);
  for (std::size_t i = 0; i < mesh.triangle_count(); ++i) {
    std::array<std::uint32_t, 3> t{};
    for (std::size_t k = 0; k < 3; ++k) t[k] = vertex[mesh.triangle[i][k]];
    if (t[0] == kNone) continue;
    for (std::uint32_t at = start[t[0]]; at < start[t[0] + 1]; ++at) {
      if (other.triangle[sorted[at]] == t) same[i] = sorted[at];
    }
  }
  return same;
}

}  // namespace

double TriangleErrors::measure(const FieldView& field, const Mesh& mesh, const Mesh& last, bool nothing,
                               const std::function<bool(const Box&)>& differs, const Executor& executor) {
  SUPPLE_EXPECTS(nothing || found_.size() == last.triangle_count());
  const std::vector<Found> known = std::exchange(found_, std::vector<Found>(mesh.triangle_count()));
  const std::vector<Box> known_wide = std::exchange(wide_, {});
  std::vector<std::uint32_t> fresh;
  std::vector<std::uint32_t> same;
  if (!nothing) same = same_triangles(mesh, last);
  for (std::size_t i = 0; i < mesh.triangle_count(); ++i) {
    const std::uint32_t of_last = nothing ? kNone : same[i];
    if (of_last != kNone) {
      Found found = known[of_last];
      const auto& t = mesh.triangle[i];
      const Vec3 centre = (mesh.position[t[0]] + mesh.position[t[1]] + mesh.position[t[2]]) / 3.0;
      const Box asked = found.wide != kNone ? known_wide[found.wide] : Box{centre, centre};
      if (!differs(asked)) {
        if (found.wide != kNone) {
          found.wide = static_cast<std::uint32_t>(wide_.size());
          wide_.push_back(asked);
        }
        found_[i] = found;
        continue;
      }
    }
    fresh.push_back(static_cast<std::uint32_t>(i));
  }
  std::vector<double> error(fresh.size());
  std::vector<Box> asked(fresh.size());
  constexpr std::size_t kPerTask = 512;
  executor.for_blocks(fresh.size(), kPerTask, [&](std::size_t begin, std::size_t end) {
    const std::size_t n = end - begin;
    centroid_errors(field, mesh, std::span(fresh).subspan(begin, n), std::span(error).subspan(begin, n), std::span(asked).subspan(begin, n));
  });
  for (std::size_t j = 0; j < fresh.size(); ++j) {
    Found& found = found_[fresh[j]];
    found.error = error[j];
    if (asked[j].lower == asked[j].upper) continue;
    found.wide = static_cast<std::uint32_t>(wide_.size());
    wide_.push_back(asked[j]);
  }
  double largest = 0.0;
  for (const Found& found : found_) largest = std::max(largest, found.error);
  return largest;
}

}  // namespace supple::implicit
