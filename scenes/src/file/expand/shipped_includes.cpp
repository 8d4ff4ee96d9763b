#include "file/expand/shipped_includes.h"

namespace supple::scenes {
namespace {

/// Typical values of the materials' everyday kinds; steel has the largest Poisson's ratio that bonds carry (0.29 in tables).
constexpr std::string_view kMaterials = R"(materials:
  jelly: {youngs_modulus: 10 kPa, density: 1000 kg/m^3, poissons_ratio: 0.25, damping_ratio: 0.08, friction: 0.3}
  rubber: {youngs_modulus: 2 MPa, density: 1100 kg/m^3, poissons_ratio: 0.25, damping_ratio: 0.05, friction: 0.8}
  foam: {youngs_modulus: 60 kPa, density: 40 kg/m^3, poissons_ratio: 0.1, damping_ratio: 0.15, friction: 0.6}
  clay: {youngs_modulus: 500 kPa, density: 1800 kg/m^3, poissons_ratio: 0.25, damping_ratio: 0.3, friction: 0.6}
  steel: {youngs_modulus: 200 GPa, density: 7850 kg/m^3, poissons_ratio: 0.25, damping_ratio: 0.002, friction: 0.4}
)";

}  // namespace

std::optional<std::string_view> shipped_include(std::string_view name) {
  if (name == kShippedMaterials) return kMaterials;
  return std::nullopt;
}

}  // namespace supple::scenes
