/// @file supple/collision/deformed_field.h
/// The field of a body with its contacts (Gascuel 1993): compressed inside the others, bulging around them. What is
/// meshed and drawn.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "supple/collision/bodies.h"
#include "supple/collision/contact_surface.h"
#include "supple/core/content_versions.h"

namespace supple::collision {

struct WantedBulge;

/// Bulge of the propagation zone, h(x) for x in [0, w]: h(0) = 0, h'(0) = k, h(w/2) = a0, h'(w/2) = 0, h(w) = h'(w) = 0;
/// C^1. Its maximum is a0 iff w k <= 6 a0. (Gascuel 1993; Wyvill, FCG 22.7, with two misprints corrected.)
struct BulgeProfile {
  double stiffness = 0.0;  ///< k
  double height = 0.0;     ///< a0
  double width = 0.0;      ///< w
  [[nodiscard]] double value(double x) const noexcept;
  [[nodiscard]] double slope(double x) const noexcept;
};
/// w_eff = min(w, lambda a0 / k), lambda = 6: the bulge vanishes with a0, so nothing pops at first touch.
[[nodiscard]] double effective_width(double width, double height, double stiffness) noexcept;

struct BulgeSettings {
  double attenuation = 0.4;  ///< alpha: a0 = alpha times the largest contact pressure; 0 switches bulges off
  double width = 0.15;       ///< w: zone width at most as a share of the other body's feature size [1], > 0; infinite: w is 6 a0 as far as its kernels reach
  bool keep_volume = false;  ///< a0 in place of `attenuation` such that the bulge holds what the contact displaces, see `BulgeVolume`
  /// The term as published, for comparison; not beside `keep_volume`. x [m] is the distance to the surface of the other body j
  /// along grad p_j, k = |grad p_j| where that path ends, and w is `width` times the feature size of j, or of the body
  /// itself where j has none, whatever a0. Its defects: the bulge pops up at first touch (2 k w / 27 for a0 = 0), rises
  /// above a0 where w k > 6 a0, and grows with the stiffness of j, at most to half of what would fill the empty space
  /// around the body; the bulges of two bodies may hold the same point, and those of several add up, in a third body too.
  bool literal = false;
};

/// What a bulge of `BulgeSettings::keep_volume` should hold, and holds. They agree to 1e-3 unless the bulge is as high as it may be: a third
/// of its width, less beside what is steeper, or half of what would fill the empty space around the body. Its slope k at the rim is 1, so that it joins the compression
/// with one slope, unless the other body is steeper: k is |grad p_i| / |grad p_j| then, which leaves a crease at the rim.
struct BulgeVolume {
  std::uint32_t other = 0;  ///< the body that it lies around
  double displaced = 0.0;   ///< [m^3]
  double held = 0.0;        ///< [m^3]
  [[nodiscard]] bool falls_short() const { return held < (1.0 - 2e-3) * displaced; }
};

/// Height a0 [Pa] of a bulge of k = 1 that holds the volume `displaced` [m^3], to first order. The rim of Sigma holds
/// w (24 a0 + w) / 48 times the integral of ds / (|grad_Sigma p| |grad(p_A - p_B)|), which is area^2 / (2 load steepness) for
/// pressures that fall as a paraboloid; a sphere on a plane is Gascuel's case.
/// @param width  of the zone at most [Pa]: beyond it a lower one grows instead
/// @param load  integral of p dA [N]   @param steepness  |grad(p_A - p_B)| [Pa/m]
[[nodiscard]] double volume_keeping_height(double displaced, double area, double load, double steepness, double width) noexcept;

/// The deformed pressure of body i: p^_i = p_i inside every other body, p_i + h(...) outside (the bulge around each body
/// that it touches), in Pa. Space goes to the largest positive one, so body i with its contacts is
/// {p^_i > 0, p^_i >= p^_j}: deformed pressures are what polygonise_partition takes. The bulge uses -p_j as its coordinate (k = 1):
/// h <= -p_j there, so two bulges can never hold the same point, and the C^1 join with the compression is exact. Where
/// several bodies are near, the sum of the bulges is limited to the smallest -p_m of all of them: deformed pressures stay continuous
/// across every surface and no bulge enters a third body. `BulgeSettings::literal` has neither.
class DeformedPressure {
 public:
  /// @param body  index of the body in `bodies`; views are kept, so everything must outlive this
  DeformedPressure(std::span<const ContactBody> bodies, std::uint32_t body, const ContactSurface& surface,
             const BulgeSettings& settings);
  void evaluate(std::span<const Vec3> points, std::span<double> values) const;
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const;
  void evaluate_parts(std::span<const Vec3> points, implicit::FieldParts& parts) const;  ///< of the undeformed field, in Pa
  [[nodiscard]] Interval bound(const Box& box) const;
  [[nodiscard]] double gradient_bound(const Box& box) const;
  [[nodiscard]] Box surface_box() const;
  [[nodiscard]] double feature_size() const;
  [[nodiscard]] std::span<const BulgeVolume> volumes() const { return volumes_; }  ///< of `BulgeSettings::keep_volume`, else none
  /// All that the deformed pressure depends on, bit by bit. @param field  a number for the field of a body, by index in `bodies`: equal ones mean
  /// equal fields
  void add_content(const std::function<std::uint64_t(std::uint32_t)>& field, ContentWords& words) const;

 private:
  struct Neighbour {
    std::uint32_t body;
    BulgeProfile profile;  ///< in pressure units, k = 1; literal: w [m], k of each point its own
  };
  /// Adds the bulge around a neighbour that should hold what their contact displaces. @param contact  in `summary`  @param width  at most [m]
  void want_volume(const ContactSurface& surface, std::size_t contact, std::uint32_t other, double width, std::vector<WantedBulge>& wanted) const;
  void keep_volumes(std::span<const WantedBulge> wanted);
  void find_limiting();
  /// Values, and gradients where `gradients` is not empty.
  void evaluate_at(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const;
  /// What the literal bulge around a neighbour adds in a box at most [Pa]
  [[nodiscard]] double literal_rise(const Neighbour& neighbour, const Box& box) const;

  std::span<const ContactBody> bodies_;
  std::uint32_t body_;
  std::vector<Neighbour> neighbours_;
  std::vector<std::uint32_t> limiting_;  ///< other bodies that a bulge could reach
  std::vector<BulgeVolume> volumes_;
  bool literal_ = false;
  double highest_ = 0.0;                 ///< of one bulge; not where volumes are kept [Pa]
  double together_ = std::numeric_limits<double>::infinity();  ///< all bulges are cut off there [Pa]
  double rise_ = 0.0;                    ///< largest possible sum of the bulges [Pa]
  Box box_;                              ///< of {deformed pressure >= 0}
};

/// The deformed field itself: F~_i = (p^_i - max over j of max(p^_j, 0)) / P_i: iso surfaces of touching bodies coincide.
class DeformedField {
 public:
  DeformedField(std::span<const ContactBody> bodies, std::uint32_t body, const ContactSurface& surface,
                const BulgeSettings& settings);
  /// What `others` leave of a deformed pressure. @param modulus  P_i [Pa], > 0
  DeformedField(DeformedPressure own, std::vector<DeformedPressure> others, double modulus)
      : own_(std::move(own)), others_(std::move(others)), modulus_(modulus) {}
  void evaluate(std::span<const Vec3> points, std::span<double> values) const;
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const;
  void evaluate_parts(std::span<const Vec3> points, implicit::FieldParts& parts) const;  ///< of the undeformed field
  [[nodiscard]] Interval bound(const Box& box) const;
  [[nodiscard]] double gradient_bound(const Box& box) const;
  [[nodiscard]] Box surface_box() const;
  [[nodiscard]] double feature_size() const;

 private:
  DeformedPressure own_;
  std::vector<DeformedPressure> others_;
  double modulus_;
};

/// How deep a point lies in the body with its contacts, to first order [m]: the least of p^ / |grad p^| of its own deformed pressure and
/// of (p^ - p^_j) / |grad (p^ - p^_j)| against every other's. Unlike F~ / |grad F~| it knows the contact surface also where the
/// other holds nothing, and is no deeper there than that is far; > 0 inside, of slope 1.
class DeformedDepth {
 public:
  /// @param others  deformed pressures of bodies that touch this one
  DeformedDepth(DeformedPressure own, std::vector<DeformedPressure> others) : own_(std::move(own)), others_(std::move(others)) {}
  void evaluate(std::span<const Vec3> points, std::span<double> values) const;
  /// Gradients are unit vectors, or 0 where none is.
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const;
  void evaluate_parts(std::span<const Vec3> points, implicit::FieldParts& parts) const { own_.evaluate_parts(points, parts); }
  [[nodiscard]] Interval bound(const Box& box) const;
  [[nodiscard]] double gradient_bound(const Box& /*box*/) const { return 1.0; }
  [[nodiscard]] Box surface_box() const { return own_.surface_box(); }
  [[nodiscard]] double feature_size() const { return own_.feature_size(); }

 private:
  DeformedPressure own_;
  std::vector<DeformedPressure> others_;
};

}  // namespace supple::collision
