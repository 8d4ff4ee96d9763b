/// @file supple/scenes/contact_report.h
/// Everything about the contacts of a state in one call. `output.contacts` writes the same as tables.
///
///     const supple::scenes::ContactReport report = supple::scenes::report_contacts(simulation);
///     for (const auto& pair : report.pairs) std::cout << pair.a << ' ' << pair.b << ' ' << pair.force.norm() << '\n';
#pragma once

#include <string>
#include <vector>

#include "supple/scenes/simulation.h"

namespace supple::scenes {

struct ContactReport {
  struct Pair {
    std::string a, b;                      ///< names of the bodies
    collision::BodyPair bodies;            ///< their numbers, the fixed ones last
    Vec3 force = Vec3::Zero();             ///< on A, damping and friction included [N]; B gets the opposite
    Vec3 elastic_force = Vec3::Zero();     ///< on A without them [N]
    Vec3 centre_of_pressure = Vec3::Zero();  ///< [m]
    double area = 0.0;                     ///< [m^2]
    double largest_pressure = 0.0;         ///< [Pa]
    double largest_overlap = 0.0;          ///< of the undeformed bodies [m]
    double energy = 0.0;                   ///< of compression [J]
    double dissipated_power = 0.0;         ///< by damping and friction [W]
    double dissipated_work = 0.0;          ///< by damping and friction since the start, the integral of the power over the steps [J]
    double error_estimate = 0.0;           ///< relative, of force, area and centre of pressure
    collision::ContactRule rule = collision::ContactRule::None;
    std::size_t first = 0, last = 0;       ///< its points are [first, last) of `points`
  };
  std::vector<Pair> pairs;                 ///< pairs in contact, sorted by bodies
  collision::ContactSurface points;        ///< quadrature points: positions, normals, areas and pressures
  core::Loads loads;                       ///< contact loads on every particle, damping and friction included
  double energy = 0.0;                     ///< of all pairs [J]
  double dissipated_power = 0.0;           ///< of all pairs [W]
  double dissipated_work = 0.0;            ///< of all pairs that ever touched [J]
};
[[nodiscard]] ContactReport report_contacts(Simulation& simulation);

/// Name of a rule as the key `contact.rule` has it: "polar", "march" or "panels"; "none" without contact.
[[nodiscard]] const char* rule_name(collision::ContactRule rule);

}  // namespace supple::scenes
