/// @file polar_job.h
/// What the polar rules need to know of a pair.
#pragma once

#include <optional>
#include <span>

#include "supple/collision/contact_surface.h"
#include "surface/find_peak.h"
#include "surface/pair_pressure.h"
#include "surface/patch_points.h"

namespace supple::collision {

/// A pair as its patches need it.
struct PolarJob {
  PairPressure& pressure;
  ContactSettings settings;
  Regions regions;         ///< what is wanted of the squeezed regions
  double extent = 0.0;     ///< longest half axis of a patch that is believed [m]
  double spacing = 0.0;    ///< of the seeds [m]; 0 where there are none
  std::optional<CommonAxis> axis;
  bool faces = false;      ///< the bodies are convex: they may touch with faces, and patches that kinks cross are parted about their middle
  Thirds third;  ///< bodies that may press harder on the patch: it is cut there
};

}  // namespace supple::collision
