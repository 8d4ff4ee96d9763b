// Fitted shells: measured curvatures, and a cap and a tube that keep their shape and take it back.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>

#include "fit/shapes.h"
#include "supple/fit/fit.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"

namespace supple::fit {
namespace {

constexpr double kCapRadius = 0.5, kTubeRadius = 0.3, kThickness = 0.04;

/// A surface over a rectangle of parameters, open, or closed around the first one.
Mesh surface(std::uint32_t around, std::uint32_t along, const std::function<Vec3(double, double)>& place) {
  Mesh mesh;
  for (std::uint32_t j = 0; j <= along; ++j) {
    for (std::uint32_t i = 0; i < around; ++i) mesh.position.push_back(place(2.0 * std::numbers::pi * i / around, static_cast<double>(j) / along));
  }
  for (std::uint32_t j = 0; j < along; ++j) {
    for (std::uint32_t i = 0; i < around; ++i) {
      const std::uint32_t a = j * around + i, b = j * around + (i + 1) % around;
      mesh.triangle.push_back({a, b, b + around});
      mesh.triangle.push_back({a, b + around, a + around});
    }
  }
  return mesh;
}

/// The upper 60 degrees of a sphere, with a hole of 3 degrees at the pole.
Mesh cap() {
  return surface(48, 16, [](double angle, double share) {
    const double t = std::numbers::pi * (60.0 - 57.0 * share) / 180.0;
    return Vec3(kCapRadius * std::sin(t) * std::cos(angle), kCapRadius * std::sin(t) * std::sin(angle), kCapRadius * std::cos(t));
  });
}
Mesh tube() {
  return surface(48, 16, [](double angle, double share) { return Vec3(kTubeRadius * std::cos(angle), kTubeRadius * std::sin(angle), 0.8 * share); });
}

FittedObject shell(const Mesh& mesh, const std::string& name) {
  FittedObject object = fit(test::saved(mesh, name), {.error = 0.02, .particles = 80, .kind = Kind::Shell, .thickness = kThickness, .material = {.youngs_modulus = 1e4, .damping_ratio = 0.3}});
  std::ofstream(temp_folder() / (name + ".yaml")) << object_text(object, name);
  return object;
}

/// A shell that moves by itself, or with forces.
class MovingShell {
 public:
  MovingShell(const std::string& name, const std::string& keys)
      : simulation_(scenes::parse_scene("schema: 1\nduration: 4 s\nframe_rate: 10\nobjects: [{name: shell, include: " + name + ".yaml, contact: false, " + keys + "}]\n", "shell.yaml", temp_folder())) {}
  void run_to(double time) {
    while (simulation_.time() < time - 1e-9) simulation_.step_frame();
  }
  /// Largest way of a particle from its place in the file.
  [[nodiscard]] double moved() const {
    double out = 0.0;
    for (std::size_t i = 0; i < simulation_.model().particles.size(); ++i) out = std::max(out, (simulation_.state().particles.position[i] - simulation_.model().rest.position[i]).norm());
    return out;
  }
  /// Mean over the bonds of the curvature along them.
  [[nodiscard]] double curvature() const {
    const auto& bonds = simulation_.model().interactions.directed_form.at(0);
    double sum = 0.0;
    for (std::size_t b = 0; b < bonds.first.size(); ++b) {
      const core::PairPose pose = core::pair_pose(simulation_.model().particles, simulation_.state().particles, bonds.first[b], bonds.second[b]);
      sum += pose.r.dot(pose.normal_b - pose.normal_a) / pose.r.squaredNorm();
    }
    return sum / static_cast<double>(bonds.first.size());
  }

 private:
  scenes::Simulation simulation_;
};

TEST(FittedShell, MeasuresTheCurvaturesOfACap) {
  const FittedObject object = shell(cap(), "cap");
  ASSERT_EQ(object.frames.size(), 80U);
  EXPECT_TRUE(object.report.rigid);
  // The surface through samples of 0.11 R and less about each particle is a sphere's to second order: (0.11)^2 and less.
  for (const FittedFrame& f : object.frames) {
    EXPECT_NEAR(f.first * kCapRadius, 1.0, 0.05);
    EXPECT_NEAR(f.second * kCapRadius, 1.0, 0.05);
    EXPECT_GT(f.normal.z(), 0.4);
  }
}

TEST(FittedShell, MeasuresTheAxisOfATube) {
  const FittedObject object = shell(tube(), "tube");
  for (const FittedFrame& f : object.frames) {
    const bool along = std::abs(f.first) < std::abs(f.second);
    const Vec3 around = along ? Vec3(f.normal.cross(f.direction)) : f.direction;
    EXPECT_NEAR((along ? f.second : f.first) * kTubeRadius, 1.0, 0.05);
    EXPECT_NEAR((along ? f.first : f.second) * kTubeRadius, 0.0, 0.05);
    EXPECT_LT(std::abs(around.z()), 0.05);
  }
}

TEST(FittedShell, KeepsItsShapeAtRest) {
  for (const auto& [name, mesh, bent] : {std::tuple("cap", cap(), 1.0 / kCapRadius), std::tuple("tube", tube(), 0.5 / kTubeRadius)}) {
    (void)shell(mesh, name);
    MovingShell still(name, "medium: {linear: 1}");
    const double before = still.curvature();
    EXPECT_NEAR(before, bent, 0.1 * bent) << name;
    still.run_to(2.0);
    EXPECT_LT(still.moved(), 0.02 * kThickness + 0.005 * kCapRadius) << name;
    EXPECT_NEAR(still.curvature(), before, 0.01 * before) << name;
  }
}

TEST(FittedShell, ReturnsAfterAPush) {
  for (const auto& [name, mesh] : {std::pair("cap", cap()), std::pair("tube", tube())}) {
    const FittedObject object = shell(mesh, name);
    // The particles at the lowest z are held, the highest one is pushed against its normal for half a second.
    std::string pins;
    double lowest = 1.0;
    std::size_t pushed = 0;
    for (std::size_t i = 0; i < object.particles.size(); ++i) {
      lowest = std::min(lowest, object.particles[i].z());
      if (object.particles[i].z() > object.particles[pushed].z()) pushed = i;
    }
    for (std::size_t i = 0; i < object.particles.size(); ++i) {
      if (object.particles[i].z() < lowest + 0.05) pins += "{particle: " + std::to_string(i) + "}, ";
    }
    const Vec3 force = -0.5 * object.frames[pushed].normal;
    std::array<char, 96> text{};
    std::snprintf(text.data(), text.size(), "[%.9g, %.9g, %.9g]", force.x(), force.y(), force.z());
    MovingShell shell(name, "pins: [" + pins + "], loads: [{particle: " + std::to_string(pushed) + ", force: " + text.data() + ", until: 0.5 s, ramp: 0.2 s}]");
    const double before = shell.curvature();
    shell.run_to(0.5);
    const double pressed = shell.moved();
    EXPECT_GT(pressed, 0.3 * kThickness) << name;
    shell.run_to(4.0);
    EXPECT_LT(shell.moved(), 0.2 * pressed) << name;  // it still swings
    EXPECT_NEAR(shell.curvature(), before, 0.01 * before) << name;
  }
}

}  // namespace
}  // namespace supple::fit
