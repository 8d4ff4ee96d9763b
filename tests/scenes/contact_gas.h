/// @file tests/scenes/contact_gas.h
/// Balls in a free elastic ring, in a plane: they collide again and again, and nothing acts from outside or takes energy.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>

#include "supple/core/integrate.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes::gas {

/// `count` balls of 1 g and 20 mm, each a body of its own, in a ring of 32 particles, at steps of exactly `dt` [s].
inline Simulation make(int count, double dt, double error, int threads = 1) {
  const auto text = [](double x) {
    char digits[32];
    std::snprintf(digits, sizeof digits, "%.17g", x);
    return std::string(digits);
  };
  std::string scene = "schema: 1\nduration: " + text(9e5 * dt) + "\nframe_rate: " + text(1.0 / dt) +
                      "\nplanar: true\ntime_step: {substeps: 1}\ncontact: {error: " + text(error) + "}\nobjects:\n";
  const int side = static_cast<int>(std::ceil(std::sqrt(count)));
  const double spacing = 0.5 / side;
  for (int k = 0; k < count; ++k) {
    // Speeds and places of no order, by the fractions of multiples of irrational numbers.
    const auto uneven = [k](double step) { return std::fmod(step * (k + 1), 1.0) - 0.5; };
    const double x = (k % side - 0.5 * (side - 1)) * spacing + 0.2 * spacing * uneven(0.618034);
    const double y = (k / side - 0.5 * (side - 1)) * spacing + 0.2 * spacing * uneven(0.414214);
    scene += "  - name: ball" + std::to_string(k) + "\n    particles: {arrange: single, at: [" + text(x) + ", " + text(y) +
             ", 0], mass: 0.001, velocity: [" + text(uneven(0.732051)) + ", " + text(uneven(0.236068)) + ", 0], spin: [0, 0, " +
             text(5.0 * uneven(0.645751)) +
             "]}\n    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.044}}]\n    contact: {modulus: 1e3}\n";
  }
  scene += "  - name: ring\n    particles: {arrange: ring, count: 32, radius: 0.5, mass: 0.01}\n"
           "    interactions: [{law: bond_frame, stretch: 50, rotation: 0.2}]\n"
           "    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.13}}]\n    contact: {modulus: 1e3}\n";
  return Simulation(parse_scene(scene, "gas.yaml", "."), {.threads = threads});
}

/// Largest errors over a run, relative to their scales.
struct Errors {
  double momentum = 0.0;          ///< over the largest sum of m |v|
  double angular_momentum = 0.0;  ///< over the largest sum of |x - c| m |v| + |L|
  double energy = 0.0;            ///< of kinetic, pair and contact energy, over the largest kinetic energy
  double contact = 0.0;           ///< largest contact energy over the same, to show that there were collisions
};

/// Motion is looked at after every step, energy after every `every` steps.
inline Errors run(Simulation& simulation, int steps, int every) {
  const core::ParticleSet& set = simulation.model().particles;
  const core::Motion start = core::measure_motion(set, simulation.state().particles);
  const Energies begin = simulation.energies();
  double momentum = 0.0, angular = 0.0, scale = 0.0, angular_scale = 0.0, energy = 0.0, contact = 0.0, kinetic = 0.0;
  for (int n = 1; n <= steps; ++n) {
    simulation.step();
    const core::Motion now = core::measure_motion(set, simulation.state().particles);
    momentum = std::max(momentum, (now.momentum - start.momentum).norm());
    angular = std::max(angular, (now.angular_momentum - start.angular_momentum).norm());
    scale = std::max(scale, now.momentum_scale);
    angular_scale = std::max(angular_scale, now.angular_momentum_scale);
    kinetic = std::max(kinetic, now.kinetic_energy);
    if (n % every != 0) continue;
    const Energies e = simulation.energies();
    energy = std::max(energy, std::abs(e.total() - begin.total()));
    contact = std::max(contact, e.contact);
  }
  return {momentum / scale, angular / angular_scale, energy / kinetic, contact / kinetic};
}

}  // namespace supple::scenes::gas
