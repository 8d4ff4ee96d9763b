/// Bulges as high as holds what contacts displace: the volume of a bulge by quadrature, and the height at which it is the one asked for.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "supple/collision/bodies.h"
#include "supple/collision/deformed_field.h"

namespace supple::collision {

/// A bulge to be found, of width min(w, 6 a0 / k).
struct WantedBulge {
  std::uint32_t other = 0;  ///< the body that it lies around
  double volume = 0.0;      ///< that it should hold [m^3], > 0
  double stiffness = 1.0;   ///< k, in (0, 1]
  double highest = 0.0;     ///< a0 at most [Pa], > 0
  double width = 0.0;       ///< w at most [Pa]
  double guess = 0.0;       ///< of a0 [Pa], > 0
  double zone = 0.0;        ///< width of the zone along the surface for `guess`, about [m], > 0
  Vec3 centre = Vec3::Zero();  ///< of pressure [m]
};

struct FoundBulge {
  double height = 0.0;  ///< a0 [Pa]
  double held = 0.0;    ///< volume of the bulge [m^3]
};

/// What of a deformed pressure is the same whatever its heights.
struct BulgingBody {
  std::span<const ContactBody> bodies;
  std::uint32_t body = 0;
  std::span<const std::uint32_t> limiting;  ///< other bodies that a bulge could reach
  double most = 0.0;                        ///< of all bulges together [Pa]
  Box box;                                  ///< of {p >= -most}, finite
};

/// The heights at which each bulge of a body holds its volume to 1e-3 of it, or the highest ones where that is not enough. Where bulges
/// overlap, a point counts for each by its share in the sum. Volumes are those of {p < 0 < p^}: cubes that may
/// hold some of it are found by bounds, lines through each, along the axis nearest to grad p, have their share of it by the cubics through
/// values and slopes at their ends. Cubes are halved until two sizes agree.
[[nodiscard]] std::vector<FoundBulge> find_bulges(const BulgingBody& body, std::span<const WantedBulge> wanted);

}  // namespace supple::collision
