/// @file contact_views.h
/// Contact queries of the same two bodies in other frames and orders; the results should agree up to round-off.
#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "contact_cases.h"

namespace supple::benchmarks {

struct View {
  std::string_view name;
  Stage stage;
  bool swapped = false;  ///< the bodies change places
};

/// Swapped, turned and moved, a thousandth and a thousand times as large.
inline std::array<View, 4> other_views() {
  const Pose elsewhere{Vec3(0.3, -0.2, 0.5), Quat(0.3, -0.5, 0.7, 0.2).normalized()};
  return {{{"swapped", {}, true}, {"turned", {1.0, elsewhere}}, {"small", {1e-3, {}}}, {"large", {1e3, {}}}}};
}

/// A query's answer as the bodies of the default stage, in their order, have it.
struct Seen {
  Vec3 force = Vec3::Zero(), centre = Vec3::Zero();
  double area = 0.0;
  std::uint64_t points = 0;
};
using Answers = std::vector<std::optional<Seen>>;  ///< pose by pose, error by error; nothing where bodies are apart

/// @param name  of a case of `for_cases`
inline Answers look(const View& view, std::string_view name, int poses, std::span<const double> errors,
                    collision::ContactRule rule = collision::ContactRule::None, std::uint64_t seed = 2026) {
  Answers answers;
  const Executor executor(1);
  collision::ContactCandidates candidates;
  collision::ContactSurface surface;
  const auto wanted = [name](std::string_view other) { return other == name; };
  for_cases(view.stage, wanted, [&](std::string_view, const auto& make_pose) {
    Draw draw(seed);
    for (int pose = 0; pose < poses; ++pose) {
      Pair pair = make_pose(draw);
      if (view.swapped) std::swap(pair.bodies[0], pair.bodies[1]);
      for (const double error : errors) {
        find_contacts(pair.bodies, collision::broad_phase(pair.bodies, {}, executor), executor, candidates);
        solve_contact_surface(pair.bodies, candidates, {.error = error, .only = rule}, executor, surface);
        answers.emplace_back();
        if (surface.summary.empty() || surface.summary.front().points == 0) continue;
        const collision::ContactSurface::Summary& s = surface.summary.front();
        const double length = view.stage.length;
        const Quat back = view.stage.pose.orientation.conjugate();
        const Vec3 force = back * s.force / (length * length);
        answers.back() = Seen{view.swapped ? Vec3(-force) : force, back * (s.centre_of_pressure - view.stage.pose.position) / length,
                              s.area / (length * length), s.points};
      }
    }
  });
  return answers;
}

/// Largest relative difference of force, area and centre of pressure (over the root of the area); 1 where only one is there.
inline double change(const std::optional<Seen>& one, const std::optional<Seen>& other) {
  if (!one || !other) return one || other ? 1.0 : 0.0;
  return std::max({(one->force - other->force).norm() / one->force.norm(), std::abs(other->area / one->area - 1.0),
                   (one->centre - other->centre).norm() / std::sqrt(one->area)});
}

}  // namespace supple::benchmarks
