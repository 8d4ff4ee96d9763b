/// @file blend.h
/// A Blend prepared for evaluation.
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "supple/implicit/blend.h"

namespace supple::implicit {

/// Sums of one node at a point.
struct NodeSample {
  std::uint32_t node = 0;
  double value = 0.0;             ///< > 0
  Vec3 gradient = Vec3::Zero();
};

/// The potential and its derivatives by the nodes.
struct Combined {
  double value = 0.0;
  // Gradient: the pair that is the largest, and dF/dx by the cosine x of its angle; by_cosine is 0 otherwise.
  std::size_t first = 0, second = 0;
  double cosine = 0.0;
  double by_cosine = 0.0;
};

class BlendIndex {
 public:
  /// @param part_count  parts of the body
  void assign(const Blend& blend, std::size_t part_count);
  bool operator==(const BlendIndex&) const = default;
  [[nodiscard]] bool active() const noexcept { return rule_ != BlendRule::Sum; }
  [[nodiscard]] BlendRule rule() const noexcept { return rule_; }
  [[nodiscard]] std::uint32_t node_of(std::uint32_t part) const noexcept { return node_.empty() ? part : node_[part]; }

  /// Of the edge between two nodes of a graph, 0 where there is none.
  [[nodiscard]] double weight(std::uint32_t a, std::uint32_t b) const noexcept;

  /// @param nodes  at one point, in rising order   @param share  receives dF/df_k, shape of nodes
  [[nodiscard]] Combined combine(std::span<const NodeSample> nodes, std::span<double> share) const noexcept;

  /// As combine, of bounds: the rules rise with every f_k.
  struct NodeBound {
    std::uint32_t node = 0;
    Interval value{};
    double slope = 0.0;             ///< of |grad f_k|
    // Gradient: grad f_k lies within `turn` of `gradient`; infinite: unknown.
    Vec3 gradient = Vec3::Zero();
    double turn = std::numeric_limits<double>::infinity();
  };
  [[nodiscard]] Interval bound(std::span<const NodeBound> nodes) const;
  /// Of |grad F|; infinite for Gradient where two nodes are met, for the angle turns without a limit where gradients vanish.
  [[nodiscard]] double slope_bound(std::span<const NodeBound> nodes) const;
  /// Graph and Gradient: which sums of nodes' gradients may be that of F somewhere, by bounds of the f_k; `terms` receives them, those
  /// of one winning node in a row. False where Gradient blends.
  struct Term {
    std::size_t winner = 0, node = 0;  ///< positions in `nodes`
    double weight = 1.0;
    bool or_winner = false;            ///< the winner's gradient replaces the node's
  };
  [[nodiscard]] bool find_terms(std::span<const NodeBound> nodes, std::vector<Term>& terms) const;
  /// Ricci: the least and largest dF/df_k, by bounds of the f_k. @param all  bound(nodes)
  [[nodiscard]] Interval share(const NodeBound& node, const Interval& all) const;

 private:
  /// Calls use(j, weight) for the positions j in `nodes` of the neighbours of nodes[k].
  template <class Nodes, class Use>
  void for_neighbours(const Nodes& nodes, std::size_t k, const Use& use) const;

  /// Gradient: of t where the gradients of two nodes may turn as their bounds say.
  [[nodiscard]] Interval opening_range(const NodeBound& a, const NodeBound& b) const;

  BlendRule rule_ = BlendRule::Sum;
  double exponent_ = 4.0;
  double opening_ = 0.3;
  std::vector<std::uint32_t> node_;
  std::vector<std::uint32_t> offset_;     ///< neighbours of node k are [offset[k], offset[k + 1])
  std::vector<std::uint32_t> neighbour_;  ///< rising
  std::vector<double> weight_;
  std::vector<std::uint32_t> next_;       ///< scratch of assign
};

}  // namespace supple::implicit
