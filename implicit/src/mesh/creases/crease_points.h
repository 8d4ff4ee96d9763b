/// @file crease_points.h
/// Points where nodes of a blending graph meet on its surface.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <optional>
#include <span>
#include <unordered_map>
#include <utility>

#include "supple/core/hash.h"
#include "supple/core/types.h"
#include "supple/implicit/field_view.h"

namespace supple::implicit {

/// Where nodes meet on the surface, sought from a point between two vertices or in the middle of a cell, where both ends are one.
struct CreaseSearch {
  Vec3 from, to;
  std::array<std::uint32_t, 3> node{kNone, kNone, kNone};  ///< two or three of the fields; that of `from` first
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};

  CreaseSearch(const Vec3& a, const Vec3& b, std::span<const std::uint32_t> nodes) : from(a), to(b) {
    std::copy(nodes.begin(), nodes.end(), node.begin());
  }
  [[nodiscard]] std::span<const std::uint32_t> nodes() const { return std::span(node).first(node[2] == kNone ? 2 : 3); }
  [[nodiscard]] std::array<std::uint64_t, 8> words() const {
    std::array<std::uint64_t, 8> words{};
    for (std::size_t k = 0; k < 3; ++k) {
      words[k] = std::bit_cast<std::uint64_t>(from[static_cast<Eigen::Index>(k)]);
      words[3 + k] = std::bit_cast<std::uint64_t>(to[static_cast<Eigen::Index>(k)]);
    }
    words[6] = std::uint64_t{node[0]} << 32 | node[1];
    words[7] = node[2];
    return words;
  }
};

struct CreasePoint {
  Vec3 position, normal;
};

/// Results of searches for points of creases, kept from call to call.
class CreaseMemory {
 public:
  /// @param nothing  of the last call is valid
  void begin_call(bool nothing) {
    last_.clear();
    if (!nothing) last_.swap(now_);
    now_.clear();
  }
  /// The result of this search in the last call if it is still valid by `holds(search)`, else search_anew(search).
  template <class Holds, class Search>
  const std::optional<CreasePoint>& find(const CreaseSearch& search, const Holds& holds, const Search& search_anew) {
    const auto words = search.words();
    if (auto known = last_.extract(words); known && holds(search)) return now_.insert(std::move(known)).position->second;
    return now_.insert_or_assign(words, search_anew(search)).first->second;
  }
  void end_call() { last_.clear(); }
  [[nodiscard]] std::size_t bytes() const {
    constexpr std::size_t kNode = sizeof(Points::value_type) + 2 * sizeof(void*);
    return now_.size() * kNode + (now_.bucket_count() + last_.bucket_count()) * sizeof(void*);
  }

 private:
  using Words = std::array<std::uint64_t, 8>;
  struct WordsHash {
    std::size_t operator()(const Words& words) const { return hash_bytes(std::as_bytes(std::span(words))); }
  };
  using Points = std::unordered_map<Words, std::optional<CreasePoint>, WordsHash>;
  Points last_, now_;
};

/// Where the fields of up to three nodes vanish together, near a place: Newton's method, smallest steps.
/// @param farthest  from there [m]
[[nodiscard]] std::optional<Vec3> meeting_point(std::span<const FieldView> fields, std::span<const std::uint32_t> nodes, const Vec3& start,
                                                double farthest);

}  // namespace supple::implicit
