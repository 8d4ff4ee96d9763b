#include "mesh/same_triangles.h"

#include <array>
#include <bit>
#include <cstring>

#include "supple/core/hash.h"

namespace supple::implicit {
namespace {

using VertexWords = std::array<std::uint64_t, 6>;
VertexWords words_of(const Mesh& mesh, std::size_t v) {
  VertexWords words{};
  std::memcpy(words.data(), mesh.position[v].data(), sizeof(Vec3));
  std::memcpy(words.data() + 3, mesh.normal[v].data(), sizeof(Vec3));
  return words;
}

}  // namespace

std::vector<std::uint32_t> same_vertices(const Mesh& mesh, const Mesh& other) {
  const std::size_t slots = std::bit_ceil(2 * other.vertex_count() + 1);
  std::vector<std::uint32_t> table(slots, kNoneSame);
  const auto slot_of = [&](const Mesh& of, std::size_t v) {
    const VertexWords words = words_of(of, v);
    std::size_t at = static_cast<std::size_t>(hash_bytes(std::as_bytes(std::span(words)))) & (slots - 1);
    while (table[at] != kNoneSame && words_of(other, table[at]) != words) at = (at + 1) & (slots - 1);
    return at;
  };
  for (std::size_t v = 0; v < other.vertex_count(); ++v) table[slot_of(other, v)] = static_cast<std::uint32_t>(v);
  std::vector<std::uint32_t> same(mesh.vertex_count());
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) same[v] = table[slot_of(mesh, v)];
  return same;
}

std::vector<std::uint32_t> same_triangles(const Mesh& mesh, const Mesh& other, std::span<const std::uint32_t> vertex) {
  std::vector<std::uint32_t> start(other.vertex_count() + 1, 0), sorted(other.triangle_count());  // by the first corner
  for (const auto& t : other.triangle) ++start[t[0] + 1];
  for (std::size_t v = 0; v < other.vertex_count(); ++v) start[v + 1] += start[v];
  std::vector<std::uint32_t> next = start;
  for (std::size_t i = 0; i < other.triangle_count(); ++i) sorted[next[other.triangle[i][0]]++] = static_cast<std::uint32_t>(i);
  std::vector<std::uint32_t> same(mesh.triangle_count(), kNoneSame);
  for (std::size_t i = 0; i < mesh.triangle_count(); ++i) {
    std::array<std::uint32_t, 3> t{};
    for (std::size_t k = 0; k < 3; ++k) t[k] = vertex[mesh.triangle[i][k]];
    if (t[0] == kNoneSame) continue;
    for (std::uint32_t at = start[t[0]]; at < start[t[0] + 1]; ++at) {
      if (other.triangle[sorted[at]] == t) same[i] = sorted[at];
    }
  }
  return same;
}

}  // namespace supple::implicit
