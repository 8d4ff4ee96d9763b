// What is measured of a state.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/support.h"
#include "supple/core/integrate.h"

namespace supple::core {
namespace {

using test::Draw;
using test::Particles;

TEST(Motion, OfARigidRotationIsKnown) {
  Particles p;
  p.add(Vec3(1, 0, 0), 2.0, 0.5);
  p.add(Vec3(-1, 0, 0), 2.0, 0.5);
  p.state.velocity = {Vec3(0, 3, 0), Vec3(0, -3, 0)};
  p.state.angular_momentum = {Vec3(0, 0, 1.5), Vec3(0, 0, 1.5)};
  const Motion motion = measure_motion(p.set, p.state);
  EXPECT_DOUBLE_EQ(motion.kinetic_energy, 2 * 0.5 * 2.0 * 9.0 + 2 * 0.5 * 0.5 * 9.0);
  EXPECT_EQ(motion.momentum, Vec3::Zero());
  EXPECT_EQ(motion.angular_momentum, Vec3(0, 0, 2 * 6.0 + 3.0));
  EXPECT_DOUBLE_EQ(motion.momentum_scale, 12.0);
  EXPECT_DOUBLE_EQ(motion.angular_momentum_scale, 15.0 + 12.0 * std::sqrt(0.5 * 3 * 0.5 / 2.0));
}

TEST(ShapeError, VanishesForEveryRigidMotion) {
  Draw draw(71);
  const std::vector<Vec3> spiral = test::make_spiral().state.position;
  std::vector<std::vector<Vec3>> shapes{spiral, {Vec3(1, 2, 3)}, {Vec3::Zero(), Vec3::UnitX(), 2 * Vec3::UnitX()}};
  shapes.emplace_back();
  for (int k = 0; k < 30; ++k) shapes.back().push_back(draw.vector(1.0));
  for (const std::vector<Vec3>& rest : shapes) {
    for (int k = 0; k < 20; ++k) {
      const Quat turn = draw.rotation();
      const Vec3 shift = draw.vector(3.0);
      std::vector<Vec3> now;
      for (const Vec3& x : rest) now.push_back(turn * x + shift);
      const ShapeError error = shape_error(rest, now);
      EXPECT_LT(error.largest, 1e-14);
      EXPECT_LE(error.rms, error.largest);
    }
    EXPECT_LT(shape_error(rest, rest).largest, 2e-15);
  }
}

TEST(ShapeError, MeasuresADilationAndRefusesAMirrorImage) {
  const std::vector<Vec3> rest{Vec3(1, 0, 0),  Vec3(-1, 0, 0), Vec3(0, 1, 0),
                               Vec3(0, -1, 0), Vec3(0, 0, 2),  Vec3(0, 0, -2)};
  std::vector<Vec3> now;
  for (const Vec3& x : rest) now.push_back(1.1 * x);
  EXPECT_NEAR(shape_error(rest, now).rms, 0.1 * std::sqrt((4 * 1.0 + 2 * 4.0) / 6.0), 1e-14);
  EXPECT_NEAR(shape_error(rest, now).largest, 0.2, 1e-14);

  const std::vector<Vec3> handed{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 2, 0), Vec3(0, 0, 3)};
  std::vector<Vec3> mirrored = handed;
  for (Vec3& x : mirrored) x.x() = -x.x();
  EXPECT_GT(shape_error(handed, mirrored).rms, 0.1);
}

TEST(Divergence, NamesItsCauseAndParticle) {
  Particles p;
  for (int i = 0; i < 3; ++i) p.add(Vec3(i, 0, 0));
  EXPECT_FALSE(find_divergence(p.set, p.state, 10.0, 5.0).found);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto cause_of = [&](auto change) {
    Particles broken = p;
    change(broken.state);
    const Divergence d = find_divergence(broken.set, broken.state, 10.0, 5.0);
    EXPECT_TRUE(d.found);
    EXPECT_EQ(d.particle, 1U);
    return d.cause;
  };
  EXPECT_EQ(cause_of([&](ParticleState& s) { s.position[1].y() = nan; }), "position is not finite");
  EXPECT_EQ(cause_of([&](ParticleState& s) { s.velocity[1].y() = nan; }), "velocity is not finite");
  EXPECT_EQ(cause_of([&](ParticleState& s) { s.orientation[1].x() = nan; }), "orientation is not a rotation");
  EXPECT_EQ(cause_of([&](ParticleState& s) { s.angular_momentum[1].z() = nan; }), "angular momentum is not finite");
  EXPECT_EQ(cause_of([&](ParticleState& s) { s.velocity[1].x() = 6.0; }), "speed");
  EXPECT_EQ(cause_of([&](ParticleState& s) { s.position[1].x() = -11.0; }), "distance from the origin");
}

TEST(Divergence, TellsTheValueAndTheLimit) {
  Particles p;
  p.add(Vec3::Zero());
  p.state.velocity[0] = Vec3(0, -8, 0);
  const Divergence d = find_divergence(p.set, p.state, 10.0, 5.0);
  EXPECT_DOUBLE_EQ(d.value, 8.0);
  EXPECT_DOUBLE_EQ(d.limit, 5.0);
}

}  // namespace
}  // namespace supple::core
