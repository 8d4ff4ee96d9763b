/// @file tests/scenes/contact_stress.h
/// Scenes that try contact hard, and what became of them: used by a short test and by the stress program.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "supple/core/error.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes::stress {

enum class Outcome {
  Held,        ///< nothing passed, energy within Verlet's swing
  Overloaded,  ///< more than the pair can hold; the run reports it, and ends where one body passes the other
  Gains,       ///< more energy than there was
  Passed,      ///< one body is behind the other and no warning was given, or in spite of a barrier
  Stopped,     ///< ended by an error: diverged, or too many substeps
};

struct Result {
  Outcome outcome = Outcome::Held;
  bool valid = true;      ///< within half of what the pair can hold, so that it must be held
  std::string reason;
  double energy_error = 0.0;
};

inline constexpr double kRadius = 0.1;  ///< of every ball [m]
/// Verlet's energy swings by some (omega dt)^2 = 9 % at the automatic step.
inline constexpr double kSwing = 0.09;

inline std::string text(double x) {
  char digits[32];
  std::snprintf(digits, sizeof digits, "%.17g", x);
  return digits;
}

/// A ball of pressure E (1 - r/R) about its whole radius.
inline std::string ball(const std::string& name, const Vec3& at, const Vec3& velocity, double mass, double E,
                        const std::string& rest = "") {
  return "  - name: " + name + "\n    particles: {arrange: single, at: [" + text(at.x()) + ", " + text(at.y()) + ", " +
         text(at.z()) + "], velocity: [" + text(velocity.x()) + ", " + text(velocity.y()) + ", " + text(velocity.z()) +
         "], mass: " + text(mass) + "}\n    skeleton: [{shape: point, kernel: {type: gascuel, radius: 0.15, thickness: 0.1, slope: 5}}]\n" +
         "    contact: {modulus: " + text(2.0 * E) + "}\n" + rest;
}

inline std::string head(double frame_rate, const std::string& rest = "") {
  return "schema: 1\nduration: 100 s\nframe_rate: " + text(frame_rate) +
         "\ntime_step: {max_substeps: 1048576}\n" + (rest.empty() ? "contact: {error: 0.001}\n" : rest) + "objects:\n";
}

/// Steps frames until `done`, then judges. @param order  whether the bodies are still where they belong; with hard cores they
/// must be, however hard they press
template <class Done, class Order>
Result judge(const std::string& scene, int frames, bool valid, const Done& done, const Order& order) {
  Result result;
  result.valid = valid;
  try {
    Simulation simulation(parse_scene(scene, "stress.yaml", "."));
    while (simulation.frame() <= frames && !done(simulation)) simulation.step_frame();
    result.energy_error = simulation.audits().energy_error;
    for (const Vec3& x : simulation.state().particles.position) {
      if (!x.allFinite()) throw Error(ErrorKind::Diverged, Fault{.expected = "not finite"});
    }
    const bool told = !simulation.state().record.overloads.empty();
    const bool hard = simulation.scene().contact.core == CoreName::Barrier;
    if ((hard || !told) && !order(simulation)) {
      result.outcome = Outcome::Passed;
    } else if (told) {
      result.outcome = Outcome::Overloaded;
    } else if (!(result.energy_error <= kSwing)) {
      result.outcome = Outcome::Gains;
    }
  } catch (const Error& error) {
    result.reason = error.what();
    result.outcome = result.reason.find("pass through each other") != std::string::npos ? Outcome::Overloaded : Outcome::Stopped;
  }
  return result;
}

inline double x_of(const Simulation& s, std::size_t i) { return s.state().particles.position[i].x(); }
inline double z_of(const Simulation& s, std::size_t i) { return s.state().particles.position[i].z(); }

/// U_max of two such balls, and of one on a rigid plane [J].
inline double capacity(double E) { return std::numbers::pi * E * kRadius * kRadius * kRadius / 3.0; }

/// Two free balls, 1 and `ratio` kg, that meet a tenth of a radius off centre at `speed` radii a second.
inline Result meet(double E, double ratio, double speed, double frame_rate = 24.0, const std::string& rest = "") {
  const double v = speed * kRadius;
  const double energy = 0.5 * ratio / (1.0 + ratio) * v * v;
  const std::string scene = head(frame_rate, rest) +
                            ball("a", Vec3(-0.102, 0, 0), Vec3(v * ratio / (1.0 + ratio), 0, 0), 1.0, E) +
                            ball("b", Vec3(0.102, 0.01, 0), Vec3(-v / (1.0 + ratio), 0, 0), ratio, E);
  return judge(
      scene, static_cast<int>(10.0 / speed * frame_rate) + 2, energy <= 0.49 * capacity(E),
      [](const Simulation& s) {
        const auto& p = s.state().particles;
        const Vec3 d = p.position[1] - p.position[0];
        return d.norm() > 2.1 * kRadius && d.dot(p.velocity[1] - p.velocity[0]) > 0.0;
      },
      [](const Simulation& s) { return x_of(s, 1) > x_of(s, 0); });
}

/// Ten balls on a rigid floor, 0.1 kg the lowest and `ratio` times that the highest.
inline Result stack(double E, double ratio) {
  std::string scene = head(24.0, "contact: {error: 0.001}\ngravity: [0, 0, -9.81]\n");
  double load = 0.0;
  for (int i = 0; i < 10; ++i) {
    const double mass = 0.1 * std::pow(ratio, i / 9.0);
    load += 9.81 * mass;
    scene += ball("ball" + std::to_string(i), Vec3(0, 0, kRadius * (2 * i + 1)), Vec3::Zero(), mass, E,
                  "    medium: {linear: 20, angular: 20}\n");
  }
  scene += "obstacles: [{name: floor, shape: plane, modulus: 1e9, slope: 1000}]\n";
  // From first touch the load swings to twice its weight.
  return judge(
      scene, 25, 2.0 * load <= std::numbers::pi * E * kRadius * kRadius / 6.0, [](const Simulation&) { return false; },
      [](const Simulation& s) {
        for (std::size_t i = 0; i + 1 < 10; ++i) {
          // What an unstable stack squeezes out sideways has not passed through.
          const Vec3 d = s.state().particles.position[i + 1] - s.state().particles.position[i];
          if (!(d.z() > 0.0) && std::hypot(d.x(), d.y()) < kRadius) return false;
        }
        return z_of(s, 0) > -0.2 * kRadius;  // at 0 the lowest ball holds what it can hold
      });
}

/// A ball of 1 kg between two stiff plates of `ratio` kg each, pressed by forces that flatten it to half its diameter.
inline Result squeeze(double E, double ratio) {
  // Each side gives way by R/2: F = pi E d^2 (1 - 2 d / 3 R).
  const double d = 0.5 * kRadius, force = std::numbers::pi * E * d * d * (1.0 - 2.0 * d / (3.0 * kRadius));
  const double least = std::min(1.0, ratio);
  const double rate = std::sqrt(std::numbers::pi * E * kRadius / least);  // of the ball's contact [1/s]
  const auto plate = [&](const std::string& name, double side) {
    return "  - name: " + name + "\n    particles: {arrange: single, at: [0.007, 0.003, " + text(side * 0.13) + "], mass: " + text(ratio) +
           "}\n    skeleton: [{shape: square, half_size: 0.2, kernel: {type: gascuel, radius: 0.045, thickness: 0.03, slope: 30}}]\n" +
           "    contact: {modulus: " + text(100.0 * E) + "}\n    pins: [{particle: 0, position: false}]\n" +
           "    medium: {linear: " + text(2.0 * rate * std::sqrt(least / ratio)) + "}\n" +
           "    loads: [{particle: 0, force: [0, 0, " + text(-side * force) + "], ramp: " + text(20.0 * std::sqrt(ratio / least) / rate) + "}]\n";
  };
  const double span = 60.0 * std::sqrt(ratio / least) / rate;
  const double frame_rate = std::max(24.0, 24.0 / span);
  const std::string scene = head(frame_rate) + ball("ball", Vec3::Zero(), Vec3::Zero(), 1.0, E, "    medium: {linear: " + text(rate) + "}\n") +
                            plate("lower", -1.0) + plate("upper", 1.0);
  Result result = judge(
      scene, static_cast<int>(span * frame_rate) + 2, true, [](const Simulation&) { return false; },
      [](const Simulation& s) {
        const double gap = z_of(s, 2) - z_of(s, 1) - 0.06;
        return std::abs(gap - kRadius) < 0.1 * kRadius && z_of(s, 1) < z_of(s, 0) && z_of(s, 0) < z_of(s, 2);
      });
  return result;
}

/// A small ball shot at a thin plate that is held, `speed` [m/s], from `height` [m], frames of a millisecond.
inline Result shoot(double speed, double height, const std::string& rest = "", double modulus = 1e8) {
  const std::string scene = head(1000.0, rest) +
                            "  - name: ball\n    particles: {arrange: single, at: [0.013, 0.007, " + text(height) + "], velocity: [0, 0, " +
                            text(-speed) + "], mass: 0.001}\n    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.1}}]\n" +
                            "    contact: {modulus: " + text(modulus) + "}\n" +
                            "  - name: plate\n    particles: {arrange: single, mass: 1}\n"
                            "    skeleton: [{shape: square, half_size: 0.3, kernel: {type: wyvill, radius: 0.06}}]\n"
                            "    contact: {modulus: " + text(10.0 * modulus) + "}\n    pins: [{particle: 0}]\n";
  return judge(
      scene, static_cast<int>(1000.0 * 2.0 * height / speed) + 3, true,
      [](const Simulation& s) { return s.state().particles.velocity[0].z() > 0.0 && z_of(s, 0) > 0.2; },
      [](const Simulation& s) { return z_of(s, 0) > 0.0; });
}

}  // namespace supple::scenes::stress
