/// The experiments of Lombardo & Puech 1995 as acceptance tests on the scenes we ship.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"
#include "support/source_dir.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

Scene library_scene(const std::string& name) {
  return read_scene(source_dir() / "scenes/library" / (name + ".yaml"));
}

std::size_t object_index(const Simulation& simulation, const std::string& name) {
  const auto& objects = simulation.model().objects;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    if (objects[i].name == name) return i;
  }
  ADD_FAILURE() << "no object " << name;
  return 0;
}

TEST(Figure6, SpiralDeformsVisiblyAndTakesItsShapeBack) {
  Simulation simulation(library_scene("figures/ball_hits_spiral"));
  while (simulation.frame() < simulation.scene().frame_count()) simulation.step_frame();
  const auto& record = simulation.state().record.objects[object_index(simulation, "spiral")];
  EXPECT_GE(record.largest_deformation, 0.05);
  EXPECT_LE(record.final_shape_error, 0.001);
  const Audits audits = simulation.audits();
  EXPECT_LT(audits.momentum_error, 1e-10);  // steps / frame x frames roundings of 1e-16, pin and ball included
  EXPECT_LT(audits.angular_momentum_error, 1e-10);
  EXPECT_LT(audits.contact_residual, 1e-10);
  EXPECT_GT(audits.largest_overlap, 0.0);
}

TEST(Figure6, ScenesOfTheTwoMemoriesDifferInTheirMemoryAlone) {
  Simulation frames(library_scene("figures/ball_hits_spiral"));
  Simulation curvature(library_scene("figures/spiral_pair_curvature"));
  const std::size_t spiral = object_index(frames, "spiral");
  EXPECT_EQ(frames.model().particles.mass, curvature.model().particles.mass);
  EXPECT_FALSE(frames.model().interactions.bond_frame.empty());
  EXPECT_TRUE(curvature.model().interactions.bond_frame.empty());
  while (frames.frame() < 40) {
    frames.step_frame();
    curvature.step_frame();
  }
  EXPECT_NE(frames.state().record.objects[spiral].largest_deformation,
            curvature.state().record.objects[spiral].largest_deformation);
}

TEST(Figure5, SpiralUncoilsToAnEquilibriumAndRecovers) {
  Simulation simulation(library_scene("figures/spiral_uncoils"));
  const ObjectModel& spiral = simulation.model().objects[object_index(simulation, "spiral")];
  ASSERT_FALSE(simulation.model().interactions.external.empty());
  const double release = simulation.model().interactions.external[0].end;
  const double ramp = simulation.model().interactions.external[0].ramp;
  ASSERT_LE(release - ramp, 20.0 + 1e-9);

  double speed_under_load = INFINITY;
  while (simulation.time() + 1.0 / simulation.scene().frame_rate < release - ramp + 1e-9) {
    simulation.step_frame();
    speed_under_load = 0.0;
    for (const Vec3& v : simulation.state().particles.velocity) {
      speed_under_load = std::max(speed_under_load, v.norm() / spiral.rest_diameter);
    }
  }
  EXPECT_LT(speed_under_load, 1e-6);
  const auto& record = simulation.state().record.objects[object_index(simulation, "spiral")];
  EXPECT_GT(record.final_shape_error, 0.05);  // it is uncoiled now

  while (simulation.frame() < simulation.scene().frame_count()) simulation.step_frame();
  EXPECT_LE(simulation.state().record.objects[object_index(simulation, "spiral")].final_shape_error, 0.001);
}

TEST(Figure5, OfPairCurvaturesIsConservativeAndForgetsPartOfTheShape) {
  Simulation simulation(library_scene("figures/spiral_uncoils_pair_curvature"));
  while (simulation.frame() < simulation.scene().frame_count()) simulation.step_frame();
  EXPECT_LT(simulation.audits().angular_momentum_error, 1e-11);
  EXPECT_LT(simulation.audits().energy_error, 1e-3);
  const double error = simulation.state().record.objects[0].final_shape_error;
  EXPECT_GT(error, 0.05);
  EXPECT_LT(error, 0.5);
}

TEST(Figure5, TakesItsShapeBackByLawsOfThePaperAlone) {
  Simulation simulation(library_scene("figures/spiral_uncoils_paper_laws"));
  while (simulation.frame() < simulation.scene().frame_count()) simulation.step_frame();
  EXPECT_LT(simulation.audits().energy_error, 1e-3);
  EXPECT_GT(simulation.state().record.objects[0].largest_deformation, 0.4);
  // Cohesion is quartic at rest, so the displacement falls with the root of time: a five-hundredth after 20 s.
  EXPECT_LT(simulation.state().record.objects[0].final_shape_error, 0.002 * simulation.state().record.objects[0].largest_deformation);
}

TEST(Figure6, TakesItsShapeBackByLawsOfThePaperAlone) {
  Simulation simulation(library_scene("figures/spiral_paper_laws"));
  while (simulation.frame() < simulation.scene().frame_count()) simulation.step_frame();
  const auto& spiral = simulation.state().record.objects[object_index(simulation, "spiral")];
  EXPECT_GT(spiral.largest_deformation, 0.05);
  EXPECT_LT(spiral.final_shape_error, 0.1 * spiral.largest_deformation);
}

TEST(Figure5, OfTheLawAsPrintedKeepsNeitherEnergyNorAngularMomentum) {
  Simulation simulation(library_scene("figures/spiral_uncoils_literal"));
  while (simulation.frame() < 200) simulation.step_frame();
  EXPECT_GT(simulation.audits().angular_momentum_error, 0.1);
  EXPECT_GT(simulation.audits().energy_error, 1.0);
  EXPECT_GT(simulation.state().record.objects[0].final_shape_error, 0.5);
}

/// The largest distance of a particle from its rest place so far, over a length, and the shape error at the end.
struct Dent {
  double depth = 0.0;
  double final_shape_error = 0.0;
};

Dent dent(const std::string& name, std::size_t particle, double length) {
  Simulation simulation(library_scene(name));
  Dent out;
  const Vec3 rest = simulation.model().rest.position[particle];
  while (simulation.frame() < simulation.scene().frame_count()) {
    simulation.step_frame();
    out.depth = std::max(out.depth, (simulation.state().particles.position[particle] - rest).norm() / length);
  }
  out.final_shape_error = simulation.state().record.objects[0].final_shape_error;
  EXPECT_LT(simulation.audits().momentum_error, 1e-10);
  return out;
}

TEST(Objects, AShellIsDentedAndTakesItsShapeBack) {
  const Dent shell = dent("objects/shell_dents", 0, 0.5);
  EXPECT_GT(shell.depth, 0.3);
  EXPECT_LT(shell.final_shape_error, 0.005);
}

TEST(Objects, ASheetIsDentedAndTakesItsShapeBack) {
  const Dent sheet = dent("objects/sheet_dents", 40, 0.8);
  EXPECT_GT(sheet.depth, 0.2);
  EXPECT_LT(sheet.final_shape_error, 0.005);
}

TEST(Figure4, TheScenesComeBackOrFlyApartOnTheirSideOfTheThreshold) {
  const auto side_after = [](const std::string& law, double ratio) {
    Scene scene = library_scene("figures/oscillation_" + law);
    scene.objects[0].particles.radius = ratio / std::sqrt(3.0);
    Simulation simulation(scene);
    while (simulation.frame() < simulation.scene().frame_count()) simulation.step_frame();
    const auto& x = simulation.state().particles.position;
    return (x[1] - x[0]).norm();
  };
  EXPECT_NEAR(side_after("cohesion", 0.60), 1.0, 0.02);
  EXPECT_GT(side_after("cohesion", 0.55), 3.0);
  EXPECT_NEAR(side_after("lennard_jones", 0.85), 1.0, 0.02);
  EXPECT_GT(side_after("lennard_jones", 0.80), 3.0);
}

}  // namespace
}  // namespace supple::scenes
