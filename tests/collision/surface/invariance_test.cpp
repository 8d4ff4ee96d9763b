/// What may not change when bodies in contact change places, are turned and moved together, or scaled: decisions on the accuracy of
/// contact ask for 1e-9, far below the errors that are asked for here, so that even what is left of these must be the same.
#include <gtest/gtest.h>

#include "benchmarks/contact_views.h"

namespace supple::collision {
namespace {

using namespace benchmarks;

void expect_same_in_any_view(std::string_view name, int poses, std::span<const double> errors, ContactRule rule = ContactRule::None) {
  constexpr double kRoundOff = 1e-9;
  const Answers rest = look({}, name, poses, errors, rule);
  for (const View& view : other_views()) {
    const Answers seen = look(view, name, poses, errors, rule);
    ASSERT_EQ(seen.size(), rest.size());
    for (std::size_t i = 0; i < rest.size(); ++i) {
      ASSERT_TRUE(rest[i]) << i;
      EXPECT_LE(change(rest[i], seen[i]), kRoundOff)
          << name << ", " << view.name << ", pose " << i / errors.size() << ", error " << errors[i % errors.size()];
    }
  }
}

class InvarianceOf : public ::testing::TestWithParam<const char*> {};

TEST_P(InvarianceOf, HoldsInAnyView) {
  expect_same_in_any_view(GetParam(), 25, std::array{1e-2, 1e-3, 1e-6});
}

INSTANTIATE_TEST_SUITE_P(Cases, InvarianceOf,
                         ::testing::Values("equal", "radii", "stiffness", "plane", "slab", "face_on_plane", "face_on_face", "ellipsoids", "plate",
                                           "capsules", "disc_on_box", "ten_blobs"),
                         [](const auto& which) { return std::string(which.param); });

TEST(Invariance, HoldsOfPairsThatAreMarched) {
  for (const char* name : {"equal", "slab"}) expect_same_in_any_view(name, 40, std::array{1e-3}, ContactRule::March);
  for (const char* name : {"radii", "ellipsoids", "plate", "ten_blobs"}) expect_same_in_any_view(name, 5, std::array{1e-3}, ContactRule::March);
}

TEST(Invariance, HoldsWhereEqualFacesChangePlaces) {
  // Nothing but how they lie tells which of two such boxes comes first.
  const implicit::Skeleton shape = linear_shape(implicit::ShapeKind::Box, Vec3(0.1, 0.08, 0.05), 0.02);
  Rigid a(shape, 1e6, 0.03), b(shape, 1e6, 0.03);
  const Executor executor(1);
  Draw draw(5);
  for (int pose = 0; pose < 25; ++pose) {
    const Quat turn = draw.rotation();
    a.put({draw.direction(), turn});
    const Vec3 at(draw.uniform(-0.1, 0.1), draw.uniform(-0.08, 0.08), 0.138);
    const ContactBody one = a.body();
    b.put({one.pose.front().position + turn * at, turn * Quat(Eigen::AngleAxisd(draw.uniform(0.0, kPi), Vec3::UnitZ()))});
    std::array<ContactBody, 2> bodies{one, b.body()};
    std::array<ContactSurface, 2> surface;
    for (ContactSurface& s : surface) {
      ContactCandidates candidates;
      find_contacts(bodies, broad_phase(bodies, {}, executor), executor, candidates);
      solve_contact_surface(bodies, candidates, {.error = 1e-3}, executor, s);
      std::swap(bodies[0], bodies[1]);
    }
    const ContactSurface::Summary &x = surface[0].summary.at(0), &y = surface[1].summary.at(0);
    EXPECT_LE((x.force + y.force).norm(), 1e-9 * x.force.norm()) << pose;
    EXPECT_NEAR(x.area, y.area, 1e-9 * x.area) << pose;
  }
}

}  // namespace
}  // namespace supple::collision
