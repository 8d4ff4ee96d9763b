// A fitted bar against Young's modulus of its material.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cstdio>
#include <fstream>

#include "fit/sections.h"
#include "fit/shapes.h"
#include "supple/fit/fit.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"

namespace supple::fit {
namespace {

constexpr double kHalfLength = 0.6, kHalfWidth = 0.125, kModulus = 1e5;

/// A bar along x whose left end is held, with forces on the particles of its right end, and its displacements at rest.
class FittedBar {
 public:
  explicit FittedBar(double poissons_ratio, std::uint32_t particles = 300)
      : object_(fit(test::saved(test::block(Vec3(kHalfLength, kHalfWidth, kHalfWidth)), "bar"),
                    {.error = 0.04, .particles = particles, .material = {.youngs_modulus = kModulus, .density = 1000.0, .poissons_ratio = poissons_ratio}})) {
    std::ofstream(temp_folder() / "bar.yaml") << object_text(object_, "a bar");
  }
  [[nodiscard]] const FittedObject& object() const { return object_; }

  /// Strain along and across where the end is pulled by a force.
  [[nodiscard]] Vec3 stretched(double force) const {
    const std::vector<std::size_t> end = end_of(1.0);
    std::vector<Vec3> forces(end.size(), Vec3(force / static_cast<double>(end.size()), 0.0, 0.0));
    const std::vector<Vec3> moved = at_rest(end, forces);
    const Eigen::MatrixXd slope = fitted(moved, false);
    return {slope(1, 0), slope(2, 1), slope(3, 2)};
  }
  /// Curvature where a couple turns the end about an axis across.
  [[nodiscard]] double bent(double couple, Eigen::Index across) const {
    const std::vector<std::size_t> end = end_of(1.0);
    double mean = 0.0, square = 0.0;
    for (const std::size_t i : end) mean += object_.particles[i][across] / static_cast<double>(end.size());
    for (const std::size_t i : end) square += std::pow(object_.particles[i][across] - mean, 2);
    std::vector<Vec3> forces;
    for (const std::size_t i : end) forces.emplace_back(couple * (object_.particles[i][across] - mean) / square, 0.0, 0.0);
    return fitted(at_rest(end, forces), true)(3 + across, 0);
  }

 private:
  [[nodiscard]] std::vector<std::size_t> end_of(double side) const {
    std::vector<std::size_t> out;
    for (std::size_t i = 0; i < object_.particles.size(); ++i) {
      if (side * object_.particles[i].x() > kHalfLength - kHalfWidth) out.push_back(i);
    }
    return out;
  }
  /// Displacements in the middle, as linear functions of x, y and z, or with x y and x z.
  [[nodiscard]] Eigen::MatrixXd fitted(const std::vector<Vec3>& moved, bool bent) const {
    std::vector<std::size_t> middle;
    for (std::size_t i = 0; i < moved.size(); ++i) {
      if (std::abs(object_.particles[i].x()) < kHalfLength - 2.0 * kHalfWidth) middle.push_back(i);
    }
    Eigen::MatrixXd columns(middle.size(), bent ? 6 : 4), values(middle.size(), 3);
    for (Eigen::Index row = 0; row < columns.rows(); ++row) {
      const Vec3& p = object_.particles[middle[static_cast<std::size_t>(row)]];
      columns.row(row).head<4>() << 1.0, p.x(), p.y(), p.z();
      if (bent) columns.row(row).tail<2>() << p.x() * p.y(), p.x() * p.z();
      values.row(row) = moved[middle[static_cast<std::size_t>(row)]].transpose();
    }
    return columns.colPivHouseholderQr().solve(values);
  }
  /// By backward Euler in steps of a hundred seconds.
  [[nodiscard]] std::vector<Vec3> at_rest(const std::vector<std::size_t>& end, const std::vector<Vec3>& forces) const {
    std::string text = "schema: 1\nduration: 300 s\nframe_rate: 0.01\ntime_step: {size: 100 s}\nintegrator: {method: backward_euler}\nobjects:\n  - {name: bar, include: bar.yaml, contact: false, pins: [";
    for (const std::size_t i : end_of(-1.0)) text += "{particle: " + std::to_string(i) + ", orientation: false}, ";
    text += "], loads: [";
    for (std::size_t k = 0; k < end.size(); ++k) {
      std::array<char, 128> one{};
      std::snprintf(one.data(), one.size(), "{particle: %zu, force: [%.9g, 0, 0]}, ", end[k], forces[k].x());
      text += one.data();
    }
    scenes::Simulation simulation(scenes::parse_scene(text + "]}\n", "bar_at_rest.yaml", temp_folder()));
    while (simulation.frame() < simulation.scene().frame_count()) simulation.step_frame();
    std::vector<Vec3> out;
    for (std::size_t i = 0; i < object_.particles.size(); ++i) out.push_back(simulation.state().particles.position[i] - simulation.model().rest.position[i]);
    return out;
  }

  FittedObject object_;
};

TEST(FittedMaterial, StretchesAndBendsByItsModulus) {
  for (const auto& [nu, particles] : {std::pair(0.0, 300U), std::pair(0.2, 300U), std::pair(0.0, 500U), std::pair(0.2, 500U)}) {
    const FittedBar bar(nu, particles);
    EXPECT_EQ(bar.object().sections.size(), bar.object().bonds.size());
    constexpr double kStrain = 1e-3;
    const double width = 2.0 * kHalfWidth, force = kStrain * kModulus * width * width, couple = kStrain * kModulus * std::pow(width, 4) / 12.0;
    const Vec3 strain = bar.stretched(force);
    EXPECT_NEAR(strain.x(), kStrain, 0.02 * kStrain) << nu << ' ' << particles;
    EXPECT_NEAR(-0.5 * (strain.y() + strain.z()) / strain.x(), nu, 0.03) << nu << ' ' << particles;
    for (const Eigen::Index across : {1, 2}) EXPECT_NEAR(bar.bent(couple, across), kStrain, 0.02 * kStrain) << nu << ' ' << particles << ' ' << across;
  }
}

}  // namespace
}  // namespace supple::fit
