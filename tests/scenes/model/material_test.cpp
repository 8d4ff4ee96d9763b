/// Objects with a `material`: bars against their modulus, masses, contact, and the names of shipped materials.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <string>

#include "supple/core/error.h"
#include "supple/scenes/model.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {
namespace {

constexpr double kModulus = 1e5, kDensity = 1000.0;

Scene read(const std::string& text) { return parse_scene(text, "test.yaml", "."); }

/// A scene whose last frame is a state of rest: backward Euler in steps of a hundred seconds. Loads are so small that bodies deform linearly.
std::string at_rest(const std::string& object) {
  return "schema: 1\nduration: 300 s\nframe_rate: 0.01\ntime_step: {size: 100 s}\nintegrator: {method: backward_euler}\nobjects:\n  - name: bar\n    contact: false\n"
         "    material: {youngs_modulus: 1e5, density: 1000, poissons_ratio: 0.2}\n" + object;
}

double root(double high, const std::function<double(double)>& rising) {
  double low = 0.0;
  for (int k = 0; k < 100; ++k) {
    const double middle = 0.5 * (low + high);
    (rising(middle) < 0.0 ? low : high) = middle;
  }
  return low;
}

/// A bar at rest and its displacements.
class Bar {
 public:
  explicit Bar(const std::string& object) : simulation_(read(at_rest(object))) {
    while (simulation_.frame() < simulation_.scene().frame_count()) simulation_.step_frame();
  }
  [[nodiscard]] double volume() const {
    double mass = 0.0;
    for (const double m : simulation_.model().particles.mass) mass += m;
    return mass / kDensity;
  }
  [[nodiscard]] Vec3 moved(std::size_t i) const { return simulation_.state().particles.position[i] - simulation_.model().rest.position[i]; }
  /// Mean over a section: particles column, column + columns, ...
  [[nodiscard]] Vec3 moved_section(std::size_t column, std::size_t columns) const {
    Vec3 sum = Vec3::Zero();
    double count = 0.0;
    for (std::size_t i = column; i < simulation_.model().particles.size(); i += columns, count += 1.0) sum += moved(i);
    return sum / count;
  }

 private:
  Simulation simulation_;
};

constexpr std::size_t kColumns = 21;
constexpr int kAcross = 4;
constexpr double kSpacing = 0.05, kLoad = 0.01;  // [m], [N] at each of the particles of the last section

std::string block(const std::string& force) {
  return R"(
    particles: {arrange: grid, columns: 21, rows: 4, layers: 4, spacing: 5 cm}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 8 cm}}]
    pins: [{repeat: {i: 4, j: 4}, particle: "${21*(i + 4*j)}", orientation: false}]
    loads: [{repeat: {i: 4, j: 4}, particle: "${20 + 21*(i + 4*j)}", force: )" + force + "}]\n";
}

/// Width of a square bar of this volume whose ends are as far from the outer particles as its sides.
double width_of(double volume) {
  const double along = kSpacing * (kColumns - 1), across = kSpacing * (kAcross - 1);
  const double beyond = root(1.0, [&](double b) { return (along + 2.0 * b) * std::pow(across + 2.0 * b, 2) - volume; });
  return across + 2.0 * beyond;
}

TEST(BulkMaterial, StretchesByItsModulus) {
  const Bar bar(block("[0.01, 0, 0]"));
  const double width = width_of(bar.volume());
  const double strain = (bar.moved_section(14, kColumns) - bar.moved_section(6, kColumns)).x() / (8.0 * kSpacing);
  EXPECT_NEAR(strain, kLoad * kAcross * kAcross / (kModulus * width * width), 0.002 * strain);
  // Opposite sides of the middle section, rows 0 and 3 of the first layer.
  const double across = (bar.moved(10 + 3 * kColumns) - bar.moved(10)).y() / (3.0 * kSpacing);
  EXPECT_NEAR(-across / strain, 0.2, 0.004);
}

TEST(BulkMaterial, BendsByItsModulus) {
  const Bar bar(block("[0, 0, 0.01]"));
  const double width = width_of(bar.volume()), length = kSpacing * (kColumns - 1), force = kLoad * kAcross * kAcross;
  const double second = std::pow(width, 4) / 12.0, shear = 5.0 / 6.0 * kModulus / (2.0 * 1.2);
  const double tip = force * std::pow(length, 3) / (3.0 * kModulus * second) + force * length / (shear * width * width);  // Timoshenko
  EXPECT_NEAR(bar.moved_section(kColumns - 1, kColumns).z(), tip, 0.02 * tip);
}

TEST(BulkMaterial, OfRodsStretchesAndBends) {
  const auto rod = [](const std::string& force) {
    return R"(
    particles: {arrange: line, count: 25, spacing: 4 cm}
    skeleton: [{shape: segment, half_length: 2 cm, kernel: {type: wyvill, radius: 5 cm}}]
    pins: [{particle: 0}]
    loads: [{particle: -1, force: )" + force + "}]\n";
  };
  const Bar stretched(rod("[1e-6, 0, 0]")), bent(rod("[0, 0, 1e-6]"));
  const double length = 24 * 0.04, pi = std::numbers::pi;
  const double radius = root(1.0, [&](double r) { return pi * r * r * length + 4.0 / 3.0 * pi * r * r * r - stretched.volume(); });
  const double area = pi * radius * radius, longer = 1e-6 * length / (kModulus * area);
  const double tip = 1e-6 * std::pow(length, 3) / (3.0 * kModulus * 0.25 * area * radius * radius);
  EXPECT_NEAR(stretched.moved(24).x(), longer, 0.002 * longer);
  EXPECT_NEAR(bent.moved(24).z(), tip, 0.02 * tip);
}

TEST(BulkMaterial, OfSheetsStretchesAndBends) {
  const auto sheet = [](const std::string& force) {
    return R"(
    particles: {arrange: grid, columns: 21, rows: 5, spacing: 4 cm}
    skeleton: [{shape: square, half_size: 2 cm, kernel: {type: wyvill, radius: 4 cm}}]
    pins: [{repeat: 5, particle: "${21*i}"}]
    loads: [{repeat: 5, particle: "${20 + 21*i}", force: )" + force + "}]\n";
  };
  const Bar stretched(sheet("[1e-6, 0, 0]")), bent(sheet("[0, 0, 1e-6]"));
  const double length = 0.8, width = 0.16;
  const double h = root(1.0, [&](double t) { return (length + t) * (width + t) * t - bent.volume(); });
  const double strain = (stretched.moved_section(15, 21) - stretched.moved_section(6, 21)).x() / (9 * 0.04);
  EXPECT_NEAR(strain, 5e-6 / (kModulus * (width + h) * h), 0.002 * strain);
  // Curvature in the middle, away from the clamp: moment over E I.
  const double curvature = (bent.moved_section(12, 21) - 2.0 * bent.moved_section(10, 21) + bent.moved_section(8, 21)).z() / std::pow(2 * 0.04, 2);
  EXPECT_NEAR(curvature, 5e-6 * 0.4 / (kModulus * (width + h) * h * h * h / 12.0), 0.02 * curvature);
}

TEST(BulkMaterial, GivesABallItsMassAndAWallItsPressure) {
  const Model model = build_model(read(R"(
schema: 1
duration: 1
objects:
  - name: ball
    particles: {arrange: single}
    material: {youngs_modulus: 1e5, density: 1200, damping_ratio: 0.1, friction: 0.7}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.2}}]
)"));
  const ObjectModel& ball = model.objects[0];
  const double radius = ball.iso_radius, mass = 1200.0 * 4.0 / 3.0 * std::numbers::pi * radius * radius * radius;
  EXPECT_NEAR(model.particles.mass[0], mass, 2e-3 * mass);
  EXPECT_TRUE(ball.collides);
  EXPECT_EQ(ball.material.friction, 0.7);
  // (1 - d^2/R^2)^3 falls by 6 d/R^2 (1 - d^2/R^2)^2 a metre; the pressure reaches E at a depth of one radius at this slope.
  const double slope = 6.0 * radius / 0.04 * std::pow(1.0 - radius * radius / 0.04, 2);
  EXPECT_NEAR(ball.material.modulus * slope * radius, 1e5, 1.0);
  EXPECT_NEAR(ball.material.dissipation, 1.5 * std::numbers::pi * 0.1 / (0.1 * std::sqrt(1e5 / 1200.0)), 1e-12);
}

TEST(BulkMaterial, DampsItsSlowestVibration) {
  for (const int count : {41, 81}) {
    const Model model = build_model(read("schema: 1\nduration: 1\nobjects:\n  - name: rod\n    particles: {arrange: line, spacing: 2 cm, count: " + std::to_string(count) +
                                         "}\n    material: {youngs_modulus: 1e5, density: 1000, damping_ratio: 0.1}\n"
                                         "    skeleton: [{shape: point, kernel: {type: wyvill, radius: 6 cm}}]\n"));
    const double pi = std::numbers::pi, between = 0.02 * (count - 1);
    const double radius = root(1.0, [&](double r) { return pi * r * r * between + 4.0 / 3.0 * pi * r * r * r - model.objects[0].solid_volume; });
    // A free bar bends at (4.730 / L)^2 r c, with r = radius / 2 and c = 10 m/s.
    const double omega = std::pow(4.7300 / (between + 2.0 * radius), 2) * 0.5 * radius * 10.0, time = 2.0 * 0.1 / omega;
    EXPECT_NEAR(model.interactions.stiffness_damping.at(0).time, time, 1e-3 * time);
  }
}

TEST(BulkMaterial, HasNames) {
  const std::string text = R"(
schema: 1
include: supple:materials
duration: 1
objects:
  - name: ball
    particles: {arrange: single}
    material: )";
  const std::string rest = "\n    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.2}}]\n";
  EXPECT_EQ(read(text + "rubber" + rest).objects[0].material->youngs_modulus, 2e6);
  EXPECT_EQ(read(text + "soft" + rest + "materials: {soft: {youngs_modulus: 1 kPa, density: 900}}\n").objects[0].material->density, 900.0);
  try {
    (void)read(text + "ruber" + rest);
    ADD_FAILURE() << "accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("did you mean 'rubber'"), std::string::npos) << error.what();
  }
}

TEST(BulkMaterial, LeavesTheRestToContact) {
  const auto modulus = [](const std::string& contact) {
    const Scene scene = read("schema: 1\nduration: 1\nobjects:\n  - name: a\n    particles: {arrange: single}\n    material: {youngs_modulus: 1e5, density: 1000}\n"
                             "    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.2}}]\n" + contact);
    const Model model = build_model(scene);
    return model.objects[0].collides ? model.objects[0].material.modulus : 0.0;
  };
  EXPECT_EQ(modulus("    contact: {modulus: 123}\n"), 123.0);
  EXPECT_EQ(modulus("    contact: false\n"), 0.0);
  EXPECT_EQ(modulus("    contact: {friction: 0.1}\n"), modulus(""));
}

}  // namespace
}  // namespace supple::scenes
