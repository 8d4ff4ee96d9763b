/// @file panel_rule.h
/// The contact surface of a pair by panels: few at first, more where the error is largest.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "surface/find_peak.h"
#include "surface/panels/panels.h"
#include "surface/polar/apex.h"
#include "surface/polar/polar_cover.h"

namespace supple::collision {

/// A place of a patch where a third body presses harder than the pair.
struct ImprintPlace {
  Vec3 at;
  std::size_t third;  ///< of `PanelJob::third`
};

/// A place of Sigma where the pair presses harder than all third bodies.
struct FreePlace {
  Vec3 at, normal;
  double pressure;
};

struct PanelJob {
  PairPressure& pressure;
  std::span<const ThirdLevel> third;  ///< that reach the overlap
  const Box& overlap;                 ///< finite
  std::span<const Vec3> starts;       ///< places near Sigma; each of its patches should have one
  double error;                       ///< as in ContactSettings::error
  Vec3 reference;                     ///< that sums are about
  bool graph_only;                    ///< fits only where Sigma seems to be one graph over a plane
  const PolarCover* star = nullptr;   ///< panels of a star about its origin, which holds one patch; or null: of the plane across the mean normal
  std::span<const ImprintPlace> imprint{};  ///< that may lie between nodes
  std::span<const FreePlace> free{};        ///< that may, too
  std::array<std::optional<Apex>, 2> apex{};  ///< that what A, B lose flows out of: what flows is held to the error, too
};

struct PanelOutcome {
  PatchSums sums;
  double estimate = 1.0;
  double largest = 0.0;    ///< pressure [Pa]
  double thickness = 0.0;  ///< of the overlap there, to first order [m]
};

/// Room of `solve_by_panels`, empty between calls but for its capacity.
struct PanelRoom {
  PanelArena arena;
  std::vector<Panel> panel, chosen;
  std::vector<std::uint32_t> which, order;
  std::vector<implicit::Kink> kink;
  std::vector<Vec3> start, normal;     // places that press, in the frame of the rays; normals there
  std::vector<double> start_pressure;  // about that of Sigma near these [Pa]
  std::vector<Vec3> free;              // angles, shares and heights of places that the pair presses hardest on,
  std::vector<double> free_pressure;   // and how hard [Pa]
  /// Out of a body, from a place of Sigma, and between which lengths the body ends.
  struct Way {
    Vec3 from;
    double length, low, high;
  };
  std::vector<Way> way;
  std::vector<Vec3> far;
  PressureBatch batch;
  std::vector<double> value, other;
};

/// @param points  receives those of Sigma
/// @return false where there is no place to start from, Sigma is nowhere positive but beneath third bodies, or it does not fit
bool solve_by_panels(const PanelJob& job, PanelRoom& room, PatchPoints& points, PanelOutcome& out);

}  // namespace supple::collision
