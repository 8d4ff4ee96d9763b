/// @file imprint.h
/// Imprints: where on a patch of Sigma a third body presses harder than the pair. They may lie between the points of any rule.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "surface/pair_pressure.h"
#include "surface/polar/polar_cover.h"

namespace supple::collision {

/// An imprint as a polygon, in units of u and v of the patch's frame.
struct Imprint {
  std::size_t third = 0;
  std::vector<Vec2> border;   ///< its corners, counterclockwise; on the rim where the body presses beyond it
  std::vector<Vec2> touches;  ///< those where a ray from the frame's origin touches the imprint
  std::vector<Vec3> leaves;   ///< near where its border meets the rim
  /// Middle of the part of a ray from the frame's origin that lies in it, over `way`; nothing where the ray misses it.
  [[nodiscard]] std::optional<double> middle_on(const Vec2& way) const;
};

/// How large an imprint is, to about a tenth.
struct ImprintSize {
  double share = 0.0;     ///< of the area of the patch
  double pressure = 0.0;  ///< largest of the pair at its border and its middle [Pa]
};

class ImprintFinder {
 public:
  /// A place of the patch where a body's pressure is positive and above that of the pair less `margin` [Pa].
  /// Of a convex body it begins where the core is nearest, as its level sets lie at equal distances, of others at a grid of points.
  std::optional<Vec3> find(PairPressure& pressure, const PolarCover& cover, const ContactBody& body, double margin);
  /// The border as seen from a place within. @return false where it does not end near the patch
  bool trace(PairPressure& pressure, const PolarCover& cover, const ContactBody& body, const Vec3& inside, Imprint& out);
  /// The size of the imprint around a place within. @return nothing where its border does not end near the patch
  std::optional<ImprintSize> measure(PairPressure& pressure, const PolarCover& cover, const ContactBody& body, const Vec3& inside);
  /// How much harder than the pair the body presses where Sigma is met along the axis, and that height.
  std::array<double, 2> excess_at(PairPressure& pressure, const PeakFrame& frame, const ContactBody& body, const Vec2& at, double height) {
    const Spot spot = look(pressure, frame, body, at, height);
    return {spot.excess, spot.height};
  }

 private:
  /// A place on Sigma.
  struct Spot {
    Vec2 at = Vec2::Zero();  // in units of u and v
    double height = 0.0, far = 0.0;  // distance from the frame's origin over that of the rim
    double p = 0.0, third = 0.0, excess = 0.0;  // pressures of the pair and of the third body, and how much that one is larger
    Vec2 fall = Vec2::Zero(), rise = Vec2::Zero();  // slopes of p and of the excess along Sigma
    [[nodiscard]] double least() const { return std::min(p, excess); }
    [[nodiscard]] bool on_rim() const { return p < excess; }
    [[nodiscard]] double slope(const Vec2& way) const { return (on_rim() ? fall : rise).dot(way); }
  };
  /// Of the border, as seen from the centre.
  struct Node {
    double turns = 0.0, radius = 0.0;  // direction; [m]
    Spot spot;
  };
  static Spot on_patch(const PolarCover& cover, const Vec2& at);
  void look(PairPressure& pressure, const PeakFrame& frame, const ContactBody& body);
  Spot look(PairPressure& pressure, const PeakFrame& frame, const ContactBody& body, const Vec2& at, double height);
  void begin_on_grid(PairPressure& pressure, const PolarCover& cover, const ContactBody& body);
  bool begin_at_core(PairPressure& pressure, const PolarCover& cover, const ContactBody& body);
  static Spot centre_at(const PeakFrame& frame, const Vec3& inside);
  bool send_ways(PairPressure& pressure, const PolarCover& cover, const ContactBody& body, const Spot& centre, std::size_t ways, double first);
  double move_to_middle(PairPressure& pressure, const PeakFrame& frame, const ContactBody& body, Spot& centre);
  bool follow_border(PairPressure& pressure, const PeakFrame& frame, const ContactBody& body, const Spot& centre, double enough, double farthest);
  /// A piece of the border, between two of its points, as seen from the centre.
  struct Piece {
    Spot centre;
    Node a, b;
  };
  bool leave_between(PairPressure& pressure, const PeakFrame& frame, const ContactBody& body, const Piece& piece, Node& out);
  std::optional<Vec2> touch_between(PairPressure& pressure, const PeakFrame& frame, const ContactBody& body, const Piece& piece);

  PressureBatch batch_;
  std::vector<Spot> spots_;
  std::vector<Node> nodes_;
  std::vector<Vec2> way_;  // directions of rays from the centre, over a metre
  std::vector<double> radius_, low_, high_, value_;
  std::vector<Vec3> place_, slope_;
  std::vector<std::uint8_t> done_;
};

}  // namespace supple::collision
