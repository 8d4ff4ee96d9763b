/// @file supple/implicit/blend.h
/// How the parts of one body combine where their supports overlap. A node is a group of parts whose primitives are summed;
/// the rule joins the nodes' sums f_k into one potential F + c. Every rule is continuous, homogeneous of degree one in the
/// f_k, at least their maximum and, except for Ricci's, at most their sum.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "supple/core/types.h"

namespace supple::implicit {

enum class BlendRule : std::uint8_t {
  Sum,       ///< sum over all: every two parts blend
  /// max over k of (f_k + sum over j of w_kj min(f_j, f_k)): nodes with weight 1 between them sum, those with weight 0 unite
  /// with a crease; two nodes give max + w min (blending graph of Opalach & Maddock 1993, made continuous)
  Graph,
  Ricci,     ///< (sum f_k^n)^(1/n), between sum and union (Ricci 1973)
  /// max over pairs of the arc operator, opened by the angle between the gradients: where surfaces cross
  /// they blend, where they are parallel or face each other they unite (after Gourmel et al. 2013). Where a gradient vanishes, as
  /// half way between two blobs of a node, the angle is undefined and the field jumps
  Gradient,
};

/// Nodes a < b blend with this weight in [0, 1].
struct BlendEdge {
  std::uint32_t a = 0, b = 0;
  double weight = 1.0;
};

struct Blend {
  BlendRule rule = BlendRule::Sum;
  std::vector<std::uint32_t> node{};  ///< of each part; empty: every part is a node
  std::vector<BlendEdge> edge{};      ///< Graph: sorted by (a, b); pairs that are not listed have weight 0
  double exponent = 4.0;            ///< Ricci n, >= 1
  double opening = 0.3;             ///< Gradient: t_b in (0, 1) where gradients are perpendicular; smaller blends more widely
};

/// The arc operator G_t(a, b), a, b >= 0, t in [0, 1]: max(a, b) where min <= t max, else
/// (a^2 + b^2) / (t s + sqrt(t^2 s^2 - (t^2 + 2 t - 1)(a^2 + b^2))), s = a + b: level sets are circular arcs about
/// (t C, t C) that join the lines of the union smoothly. C^1; t = 0: sqrt(a^2 + b^2); t = 1: max.
struct ArcBlend {
  double value = 0.0;
  double by_a = 0.0, by_b = 0.0;  ///< dG/da, dG/db
  double by_t = 0.0;              ///< dG/dt
};
[[nodiscard]] ArcBlend arc_blend(double a, double b, double t) noexcept;

/// t for the cosine x of the angle between two gradients: t_b + (1 - t_b) x^2 (2 - x^2), 1 where they are parallel.
struct Opening {
  double t = 1.0;
  double slope = 0.0;  ///< dt/dx
};
[[nodiscard]] Opening opening_of(double opening, double cosine) noexcept;

/// Weight of a bond that broke `age` ago and fades within `time`, both [s]: from 1 to 0 as 1 - s^2 (3 - 2 s), s = age / time,
/// so that a surface separates without a jump in position or velocity.
[[nodiscard]] double fading(double age, double time) noexcept;

}  // namespace supple::implicit
