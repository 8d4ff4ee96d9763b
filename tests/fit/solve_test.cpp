// Least squares of primitives: known ones are found again.
#include "fit/solve.h"

#include <gtest/gtest.h>

#include "fit/measure.h"
#include "supple/core/math.h"

namespace supple::fit {
namespace {

std::vector<Blob> known() {
  std::vector<Blob> blobs(3);
  blobs[0] = {.centre = Vec3(-0.15, 0.0, 0.02), .axes = Vec3(0.5, 0.35, 0.3), .turn = Quat(Eigen::AngleAxisd(0.4, Vec3(1, 2, 3).normalized())), .form = Form::Ellipsoid};
  blobs[1] = {.centre = Vec3(0.2, 0.05, 0.0), .axes = Vec3(0.3, 0.3, 0.3)};
  blobs[2] = {.centre = Vec3(0.05, 0.2, -0.05), .axes = Vec3(0.25, 0.4, 0.3), .turn = Quat(Eigen::AngleAxisd(-0.7, Vec3(0, 1, 1).normalized())), .form = Form::Ellipsoid};
  return blobs;
}

Targets targets_of(const std::vector<Blob>& blobs) {
  implicit::Field field;
  build_field(blobs, field);
  const Mesh mesh = mesh_of(field, 0.01, Executor(1));
  Targets out;
  out.surface = sample_surface(mesh, 2000);
  std::vector<double> value(2000);
  std::vector<Vec3> gradient(2000);
  for (int step = 0; step < 4; ++step) {  // to the surface itself
    implicit::FieldView(field).evaluate(out.surface.position, value, gradient);
    for (std::size_t k = 0; k < value.size(); ++k) {
      out.surface.position[k] -= value[k] / gradient[k].squaredNorm() * gradient[k];
      out.surface.normal[k] = -gradient[k].normalized();
    }
  }
  out.size.assign(2000, 0.15);
  return out;
}

std::vector<Blob> disturbed() {
  std::vector<Blob> blobs = known();
  for (std::size_t k = 0; k < blobs.size(); ++k) {
    blobs[k].centre += 0.02 * Vec3(1.0, -1.0, k == 1 ? 1.0 : -0.5);
    blobs[k].axes *= k == 1 ? 1.15 : 0.9;
    if (blobs[k].form != Form::Ball) blobs[k].turn = (blobs[k].turn * Quat(Eigen::AngleAxisd(0.15, Vec3::UnitX()))).normalized();
  }
  return blobs;
}

const SolveOptions kOptions{.iterations = 30, .smallest = 0.01, .largest = 1.0};

TEST(Solve, FindsKnownEllipsoidsAgain) {
  std::vector<Blob> blobs = disturbed();
  const Targets targets = targets_of(known());
  EXPECT_LT(solve(blobs, targets, kOptions, Executor(2)), 1e-6);
  const std::vector<Blob> expected = known();
  for (std::size_t k = 0; k < blobs.size(); ++k) {
    EXPECT_LT((blobs[k].centre - expected[k].centre).norm(), 1e-4);
    EXPECT_LT((blobs[k].axes - expected[k].axes).norm(), 1e-3);
  }
}

const Blob kRod{.centre = Vec3(0.1, -0.05, 0.02), .axes = Vec3(0.4, 0.3, 0.3), .turn = Quat(Eigen::AngleAxisd(0.8, Vec3(1, -1, 2).normalized())), .form = Form::Segment};

TEST(Solve, FindsAKnownSegmentAgain) {
  SolveOptions options = kOptions;
  options.largest = 2.0;  // of balls whose surface is as long
  const Targets targets = targets_of({kRod});
  Blob start = kRod;
  start.centre += Vec3(0.02, -0.03, 0.01);
  start.axes = Vec3(0.3, 0.35, 0.35);
  start.turn = (start.turn * Quat(Eigen::AngleAxisd(0.15, Vec3::UnitZ()))).normalized();
  std::vector<Blob> blobs{start};
  EXPECT_LT(solve(blobs, targets, options, Executor(2)), 1e-6);
  EXPECT_LT((blobs[0].centre - kRod.centre).norm(), 1e-4);
  EXPECT_LT((blobs[0].axes - kRod.axes).norm(), 1e-3);
  EXPECT_GT(std::abs((blobs[0].turn * Vec3::UnitX()).dot(kRod.turn * Vec3::UnitX())), 1.0 - 1e-6);
}

TEST(Solve, LeavesFixedBlobsAsTheyAre) {
  const Targets targets = targets_of(known());
  const std::vector<Blob> start = disturbed();
  std::vector<Blob> blobs = start;
  SolveOptions options = kOptions;
  options.fixed = {0, 1, 0};
  balance(blobs, targets, options, Executor(2));
  solve(blobs, targets, options, Executor(2));
  EXPECT_EQ(blobs[1].centre, start[1].centre);
  EXPECT_EQ(blobs[1].axes, start[1].axes);
  EXPECT_NE(blobs[0].centre, start[0].centre);
  EXPECT_NE(blobs[2].centre, start[2].centre);
}

TEST(Blob, SlopesAreThoseOfDifferences) {
  constexpr double kStep = 1e-6;
  const SolveOptions free{.smallest = 1e-3, .largest = 10.0};
  for (const Blob& blob : {known()[0], kRod}) {
    for (const Vec3& own : {Vec3(0.05, 0.1, 0.08), Vec3(-0.45, 0.06, 0.03), Vec3(0.2, -0.12, 0.05)}) {  // beside a segment and beyond its end
      const Vec3 x = blob.centre + blob.turn * own;
      const BlobValue at = value_of(blob, x);
      ASSERT_GT(at.value, 0.0);
      for (Eigen::Index k = 0; k < kBlobParameters; ++k) {
        const BlobStep step = kStep * BlobStep::Unit(k);
        const double slope = (value_of(moved(blob, step, free), x).value - value_of(moved(blob, -step, free), x).value) / (2.0 * kStep);
        EXPECT_NEAR(at.slope[k], slope, 1e-7) << k;  // round-off of f over the step, and its third derivative times the square of the step
      }
    }
  }
}

TEST(Solve, GivesTheSameBitsForAnyNumberOfThreads) {
  const Targets targets = targets_of(known());
  std::vector<Blob> one = disturbed(), three = disturbed();
  SolveOptions few = kOptions;
  few.iterations = 3;
  EXPECT_EQ(solve(one, targets, few, Executor(1)), solve(three, targets, few, Executor(3)));
  for (std::size_t k = 0; k < one.size(); ++k) {
    EXPECT_EQ(one[k].centre, three[k].centre);
    EXPECT_EQ(one[k].axes, three[k].axes);
    EXPECT_EQ(one[k].turn.coeffs(), three[k].turn.coeffs());
  }
}

TEST(Solve, HeedsSigns) {
  // A ball that reaches beyond the data is drawn in by a point known to be outside.
  std::vector<Blob> blobs{{.centre = Vec3::Zero(), .axes = Vec3::Constant(0.5)}};
  Targets targets = targets_of(blobs);
  targets.outside.add(Vec3(0.2, 0.0, 0.0), 10.0);
  implicit::Field field;
  build_field(blobs, field);
  ASSERT_GT(implicit::FieldView(field).value(Vec3(0.2, 0.0, 0.0)), 0.0);
  solve(blobs, targets, kOptions, Executor(1));
  build_field(blobs, field);
  EXPECT_LT(implicit::FieldView(field).value(Vec3(0.2, 0.0, 0.0)), 0.0);
}

TEST(Balance, TakesBackWhatOverlappingBallsAddUpTo) {
  const Targets targets = targets_of({{.centre = Vec3::Zero(), .axes = Vec3::Constant(0.5)}});
  std::vector<Blob> twice(2, Blob{.centre = Vec3::Zero(), .axes = Vec3::Constant(0.5)});
  balance(twice, targets, kOptions, Executor(2));
  // Two in one place reach 1/2 where each is 1/4.
  const double expected = 0.5 * std::sqrt((1.0 - std::cbrt(0.5)) / (1.0 - std::cbrt(0.25)));
  EXPECT_NEAR(twice[0].axes.x(), expected, 2e-3);
  EXPECT_NEAR(twice[1].axes.x(), expected, 2e-3);
}

}  // namespace
}  // namespace supple::fit
