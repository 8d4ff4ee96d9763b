// Fitted objects in scenes: the file is read, its surface is the fitted one, and it moves.
#include <gtest/gtest.h>

#include <fstream>

#include "fit/shapes.h"
#include "supple/fit/fit.h"
#include "supple/implicit/field.h"
#include "supple/scenes/model.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/run.h"

namespace supple::fit {
namespace {

/// The field of an object of a model at rest.
implicit::Field field_of(const scenes::Model& model, std::size_t object) {
  const scenes::ObjectModel& o = model.objects[object];
  std::vector<Pose> poses;
  for (std::uint32_t i = o.first; i < o.last; ++i) poses.push_back({model.rest.position[i], model.rest.orientation[i]});
  implicit::PlacedSkeleton placed;
  implicit::Field field;
  implicit::place_skeleton(o.skeleton, poses, placed);
  implicit::index_field(o.skeleton, placed, field);
  return field;
}

class FittedScene : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    const Mesh mesh = test::moved_sphere(4, [](const Vec3& p) { return Vec3(0.15 * p.x() + 3.0, 0.1 * p.y(), 0.08 * p.z()); });
    object() = fit(test::saved(mesh, "pebble_data"), {.error = 0.03, .particles = 12});
    std::ofstream(temp_folder() / "pebble.yaml") << object_text(object(), "a pebble");
  }
  static FittedObject& object() {
    static FittedObject one;
    return one;
  }
  static scenes::Scene scene() {
    const std::string text = R"(schema: 1
duration: 0.1 s
frame_rate: 10
gravity: [0, 0, -9.81]
ground: {height: 0, slope: 300}
include: supple:materials
objects:
  - {name: first, include: pebble.yaml, particles: {at: [0, 0, 0.2]}}
  - {name: second, include: pebble.yaml, particles: {at: [1, 0, 0.4], axis: [1, 0, 0]}, scale: 2, material: rubber}
)";
    return scenes::parse_scene(text, "pebbles.yaml", temp_folder());
  }
};

TEST_F(FittedScene, HasTheFittedSurfaceAtItsPlaceAndScale) {
  const scenes::Model model = scenes::build_model(scene());
  ASSERT_EQ(model.objects.size(), 2U);
  const Quat turn = Quat::FromTwoVectors(Vec3::UnitZ(), Vec3::UnitX());
  for (const std::size_t k : {std::size_t{0}, std::size_t{1}}) {
    const implicit::Field field = field_of(model, k);
    std::vector<Vec3> points, gradient;
    for (const Vec3& p : object().surface.position) points.push_back(k == 0 ? Vec3(p + Vec3(0.0, 0.0, 0.2)) : Vec3(2.0 * (turn * p) + Vec3(1.0, 0.0, 0.4)));
    std::vector<double> value(points.size());
    gradient.resize(points.size());
    implicit::FieldView(field).evaluate(points, value, gradient);
    for (std::size_t i = 0; i < points.size(); ++i) EXPECT_LT(std::abs(value[i]), 1e-4 * gradient[i].norm() * object().report.diagonal);
  }
}

TEST(FittedRod, HasTheFittedSurfaceInAScene) {
  Mesh mesh = test::rod(0.3, 0.05);
  const Quat turn(Eigen::AngleAxisd(0.7, Vec3(1.0, 2.0, -1.0).normalized()));
  for (Vec3& p : mesh.position) p = turn * p;
  const FittedObject rod = fit(test::saved(mesh, "rod_data"), {.error = 0.02, .particles = 1});
  std::ofstream(temp_folder() / "rod.yaml") << object_text(rod, "a rod");
  const scenes::Model model = scenes::build_model(scenes::parse_scene("schema: 1\nduration: 1\nobjects:\n  - {name: it, include: rod.yaml, particles: {at: [0, 0, 0]}}\n", "rods.yaml", temp_folder()));
  const implicit::Field field = field_of(model, 0);
  for (const Vec3& p : rod.surface.position) {
    Vec3 gradient;
    const double value = implicit::FieldView(field).value(p, gradient);
    EXPECT_LT(std::abs(value), 1e-4 * gradient.norm() * rod.report.diagonal);
  }
}

TEST_F(FittedScene, TakesMassAndBondsFromItsMaterial) {
  const scenes::Model model = scenes::build_model(scene());
  const auto mass_of = [&](const scenes::ObjectModel& o) {
    double sum = 0.0;
    for (std::uint32_t i = o.first; i < o.last; ++i) sum += model.particles.mass[i];
    return sum;
  };
  const double volume = object().report.volume * (1.0 + object().report.volume_error);
  EXPECT_NEAR(mass_of(model.objects[0]) / (1000.0 * volume), 1.0, 0.01);
  EXPECT_NEAR(mass_of(model.objects[1]) / (8.0 * 1100.0 * volume), 1.0, 0.01);
  std::size_t frames = 0;
  for (const auto& law : model.interactions.bond_frame) frames += law.law.size();
  EXPECT_EQ(frames, 2 * object().bonds.size());
}

TEST_F(FittedScene, Runs) {
  scenes::RunOptions options{.folder = temp_folder() / "pebbles"};
  options.simulate_only = true;
  options.threads = 2;
  const scenes::RunResult result = scenes::run_scene(scene(), options);
  EXPECT_EQ(result.outcome, "done");
  EXPECT_EQ(result.frames, 2);
  EXPECT_EQ(result.warnings, std::vector<std::string>{});
}

TEST_F(FittedScene, IsReportedAsJson) {
  const std::string json = report_json(object().report);
  for (const char* key : {"\"two_sided\"", "\"rms\"", "\"volume_error\"", "\"genus\"", "\"primitives\"", "\"seconds\"", "\"rigid\": true"}) EXPECT_NE(json.find(key), std::string::npos) << key;
  EXPECT_NE(report_text(object().report).find("no free modes beyond six"), std::string::npos);
}

}  // namespace
}  // namespace supple::fit
