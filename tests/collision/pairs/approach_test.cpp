// What a pair can hold, and hard cores: closed forms of linear balls, conservation of impulses.
#include <gtest/gtest.h>

#include <numbers>

#include "collision/bodies.h"
#include "supple/collision/approach.h"
#include "supple/implicit/mesh_solid.h"
#include "supple/implicit/solids.h"
#include "support/closed_meshes.h"

namespace supple::collision {
namespace {

using testing::Blobs;
using testing::Linear;
using testing::LinearSphere;
using testing::Stage;

constexpr double kPi = std::numbers::pi;

TEST(ContactCapacity, OfEqualLinearBallsIsTheClosedForm) {
  // U of two balls of p = E (1 - r/R) in one place: integral of p over the ball, pi E R^3 / 3.
  const double R = 0.1, E = 1e6;
  const LinearSphere a{Vec3(0.02, 0.01, 0), Linear{R, 1.0 / R}}, b{Vec3(0.02, 0.01, 0.17), Linear{R, 1.0 / R}};
  Stage stage;
  stage.add(a, {a.centre}, E);
  stage.add(b, {b.centre}, E);
  // Midpoints of h = R/16 err by h^2 of the second derivative: 1e-2 at the kink in the middle.
  EXPECT_NEAR(contact_capacity(stage.bodies()[0], stage.bodies()[1], Vec3::UnitZ()) / (kPi * E * R * R * R / 3.0), 1.0, 5e-3);
  EXPECT_NEAR(contact_capacity(stage.bodies()[1], stage.bodies()[0], -Vec3::UnitZ()) / (kPi * E * R * R * R / 3.0), 1.0, 5e-3);
}

TEST(ContactCapacity, AboveWhatIsEnoughIsAnEnergyOnTheWay) {
  const double R = 0.1, E = 1e6;
  const LinearSphere a{Vec3(0, 0, 0), Linear{R, 1.0 / R}}, b{Vec3(0, 0, 0.17), Linear{R, 1.0 / R}};
  const implicit::HalfSpace plane{Vec3(0, 0, 0.08), -Vec3::UnitZ(), 1e6};
  Stage stage;
  stage.add(a, {a.centre}, E);
  stage.add(b, {b.centre}, E);
  stage.add(plane, {Vec3::Zero()}, E).fixed = true;
  for (const std::size_t other : {1u, 2u}) {
    const auto capacity = [&](double enough) { return contact_capacity(stage.bodies()[0], stage.bodies()[other], Vec3::UnitZ(), 12, enough); };
    const double all = contact_capacity(stage.bodies()[0], stage.bodies()[other], Vec3::UnitZ(), 12);
    EXPECT_GT(capacity(0.1 * all), 0.1 * all);
    EXPECT_LE(capacity(0.1 * all), 1.02 * all);  // sums of 8 cells across, where the capacity has 12
    EXPECT_EQ(capacity(1.1 * all), all);
  }
}

TEST(ContactCapacity, OfABallOnARigidPlaneIsAllOfItsPressure) {
  const double R = 0.5, E = 1e4;
  const LinearSphere ball{Vec3(0, 0, 0.45), Linear{R, 1.0 / R}};
  for (const Vec3& normal : {Vec3(0, 0, 1), Vec3(0.6, 0.0, 0.8)}) {
    const implicit::HalfSpace plane{Vec3::Zero(), normal, 1e6};
    Stage stage;
    stage.add(ball, {ball.centre}, E);
    stage.add(plane, {Vec3::Zero()}, E).fixed = true;
    EXPECT_NEAR(contact_capacity(stage.bodies()[0], stage.bodies()[1], -normal) / (kPi * E * R * R * R / 3.0), 1.0, 5e-3);
    EXPECT_NEAR(contact_capacity(stage.bodies()[1], stage.bodies()[0], normal) / (kPi * E * R * R * R / 3.0), 1.0, 5e-3);
  }
}

TEST(ContactCapacity, OfABallInSoftGroundIsAllOfItsPressureWhateverTheNormal) {
  const double R = 0.5, E = 1e4;
  const LinearSphere ball{Vec3(0, 0, 0.45), Linear{R, 1.0 / R}};
  const implicit::HalfSpace ground{Vec3::Zero(), Vec3::UnitZ(), 1.0};  // as hard as the middle of the ball at a depth of 10 m
  Stage stage;
  stage.add(ball, {ball.centre}, E);
  stage.add(ground, {Vec3::Zero()}, 1e3).fixed = true;
  for (const Vec3& way : {Vec3(0, 0, -1), Vec3(1e-9, -1e-9, -1), Vec3(1e-3, 0, -1)}) {
    EXPECT_NEAR(contact_capacity(stage.bodies()[0], stage.bodies()[1], way.normalized()) / (kPi * E * R * R * R / 3.0), 1.0, 2e-2);
  }
}

/// What a ball of p = E (1 - r/R) holds with its middle in that of a rigid plate: the integral of p over |z| < t/2.
double held_by_plate(double E, double R, double t) {
  return 2.0 * kPi * E * (R * R * t / 6.0 - t * t * t / 24.0 + t * t * t * t / (96.0 * R));
}

constexpr double kRigid = 1e10;  // [Pa]: plates are as hard as the ball some E/kRigid metres below their faces
/// Columns are divided until 3 percent of their sum are in doubt, and some cells squared of them see the rim of a circle to about as much.
constexpr double kOfColumns = 0.05;
/// Columns along a plate see it by squares of about a third of its thickness.
constexpr double kAlongPlate = 0.2;

TEST(ContactCapacity, OfABallOnAThinShelfIsThatOfTheShelf) {
  // Beside a block of 1 m, whose box is a hundred to a thousand times as long as the shelf is thick.
  const double R = 0.1, E = 1e4;
  for (const double t : {1e-2, 1e-3}) {
    const implicit::MeshSolid solid(test::both(test::block(Vec3(0.5, 0.5, 0.5), Vec3(0, 0, 0.5)), test::block(Vec3(0.45, 0.5, 0.5 * t), Vec3(0.85, 0, 0.6))), {});
    const LinearSphere ball{Vec3(0.9, 0.05, 0.6 + 0.5 * t + 0.999 * R), Linear{R, 1.0 / R}};
    Stage stage;
    stage.add(ball, {ball.centre}, E);
    stage.add(solid, {Vec3::Zero()}, kRigid).fixed = true;
    for (const int cells : {12, 24}) {
      EXPECT_NEAR(contact_capacity(stage.bodies()[0], stage.bodies()[1], -Vec3::UnitZ(), cells) / held_by_plate(E, R, t), 1.0, kOfColumns) << t << ' ' << cells;
      EXPECT_NEAR(contact_capacity(stage.bodies()[1], stage.bodies()[0], Vec3::UnitZ(), cells) / held_by_plate(E, R, t), 1.0, kOfColumns) << t << ' ' << cells;
    }
  }
}

TEST(ContactCapacity, OfABallOnAThinPlateDoesNotDependOnHowItLies) {
  const double R = 0.1, E = 1e4, t = 4e-3;
  for (const Vec3& tilt : {Vec3(0, 0, 0), Vec3(0.4, 0.2, 0.1), Vec3(0.9, -0.5, 0.3)}) {
    const Pose pose{Vec3(0.3, 0.2, 0.1), Quat(Eigen::AngleAxisd(tilt.norm(), tilt.norm() > 0.0 ? Vec3(tilt.normalized()) : Vec3::UnitX()))};
    const Vec3 normal = pose.orientation * Vec3::UnitZ(), across = pose.orientation * Vec3::UnitX();
    const LinearSphere on_face{pose.to_world(Vec3(0, 0, 0.5 * t + 0.99 * R)), Linear{R, 1.0 / R}}, on_edge{pose.to_world(Vec3(0.5 + 0.99 * R, 0, 0)), Linear{R, 1.0 / R}};
    const implicit::SolidBox box(pose, Vec3(0.5, 0.5, 0.5 * t), 0.0, 1.0);
    const implicit::MeshSolid mesh(test::block(Vec3(0.5, 0.5, 0.5 * t)), {.slope = 1.0, .pose = pose});
    for (const implicit::FieldView plate : {implicit::FieldView(box), implicit::FieldView(mesh)}) {
      Stage stage;
      stage.add(on_face, {on_face.centre}, E);
      stage.add(on_edge, {on_edge.centre}, E);
      stage.add(plate, {pose.position}, kRigid).fixed = true;
      EXPECT_NEAR(contact_capacity(stage.bodies()[0], stage.bodies()[2], -normal) / held_by_plate(E, R, t), 1.0, kOfColumns) << tilt.transpose() << ' ' << plate.convex();
      EXPECT_NEAR(contact_capacity(stage.bodies()[1], stage.bodies()[2], -across) / held_by_plate(E, R, t), 1.0, kAlongPlate) << tilt.transpose() << ' ' << plate.convex();
    }
  }
}

TEST(ContactCapacity, OfABallOnAThinShellIsThatOfAPlateBentLikeIt) {
  const double R = 0.1, E = 1e4, t = 4e-3;
  const implicit::MeshSolid shell(test::both(test::octahedral_sphere(1.0, 5), [t] {
                                    Mesh inner = test::octahedral_sphere(1.0 - t, 5);
                                    for (auto& c : inner.triangle) std::swap(c[1], c[2]);
                                    return inner;
                                  }()), {});
  const LinearSphere ball{Vec3(0, 0, 1.0 + 0.99 * R), Linear{R, 1.0 / R}};
  Stage stage;
  stage.add(ball, {ball.centre}, E);
  stage.add(shell, {Vec3::Zero()}, kRigid).fixed = true;
  // The shell leaves the plane by R^2/2 where the ball ends, a twentieth of R, and its flat triangles by a thousandth.
  EXPECT_NEAR(contact_capacity(stage.bodies()[0], stage.bodies()[1], -Vec3::UnitZ()) / held_by_plate(E, R, t), 1.0, kOfColumns);
}

TEST(ContactCapacity, OfABallOnAPlateOfBlobsIsWhatASumOverSmallCellsFinds) {
  const double R = 0.1, E = 1e3;
  std::vector<Vec3> centres;
  for (int j = -20; j <= 20; ++j) {
    for (int i = -20; i <= 20; ++i) centres.emplace_back(0.015 * i, 0.015 * j, 0.0);
  }
  const Blobs plate(centres, 0.02);
  const double half = plate.field.surface_box().upper.z();
  const LinearSphere ball{Vec3(0.003, 0.002, half + 0.99 * R), Linear{R, 1.0 / R}};
  Stage stage;
  stage.add(ball, {ball.centre}, E);
  stage.add(plate.field, plate.centre, 1e3);
  const Vec3 middle(0, 0, -ball.centre.z());
  constexpr int kCells = 128;
  double sum = 0.0;
  for (int k = 0; k < kCells / 8; ++k) {
    for (int j = 0; j < kCells; ++j) {
      for (int i = 0; i < kCells; ++i) {
        const Vec3 x(ball.centre.x() + R * (2.0 * (i + 0.5) / kCells - 1.0), ball.centre.y() + R * (2.0 * (j + 0.5) / kCells - 1.0), half * (16.0 * (k + 0.5) / kCells - 1.0));
        const double of_ball = E * (1.0 - (x - ball.centre - middle).norm() / R), of_plate = 1e3 * implicit::FieldView(plate.field).value(x);
        sum += std::max(0.0, std::min(of_ball, of_plate));
      }
    }
  }
  const double reference = sum * 8.0 * R * R * half / (kCells * kCells * (kCells / 8));
  EXPECT_NEAR(contact_capacity(stage.bodies()[0], stage.bodies()[1], -Vec3::UnitZ()) / reference, 1.0, kOfColumns);
}

TEST(ContactCapacity, HasTheEnergyOfTheContactAtItsStart) {
  const LinearSphere a{Vec3::Zero(), Linear{1.0, 1.0}}, b{Vec3(0.3, 0.1, 0.9), Linear{0.7, 1.0}};
  Stage stage;
  stage.add(a, {a.centre}, 5.0);
  stage.add(b, {b.centre}, 9.0);
  stage.solve({.error = 1e-8});
  const double energy = stage.surface.summary.at(0).energy;
  EXPECT_NEAR(shifted_energy(stage.bodies()[0], stage.bodies()[1], Vec3::Zero(), Vec3::UnitZ(), 48), energy, 5e-3 * energy);
}

/// Two chains of blobs that run into each other, deep, with turning parts.
struct Deep {
  Blobs a{{Vec3(0, 0, 0), Vec3(0.5, 0, 0.05), Vec3(1.0, 0.1, 0)}, 0.6};
  Blobs b{{Vec3(0.45, -0.1, 0.25), Vec3(0.7, 0.3, 0.5)}, 0.6};
  Stage stage;
  std::vector<PartMobility> mobility;
  std::vector<double> mass[2] = {{1.0, 2.0, 0.5}, {3.0, 0.1}};

  Deep() {
    stage.add(a.field, a.centre, 10.0).core_value = 0.5;
    stage.add(b.field, b.centre, 30.0).core_value = 0.5;
    stage.velocity(0) = {Vec3(0, 0.1, 2), Vec3(0.2, 0, 3), Vec3(-0.1, 0, 1)};
    stage.velocity(1) = {Vec3(0, 0, -4), Vec3(1, 0, -2)};
    stage.spin(0) = {Vec3(1, 0, 0), Vec3(0, 2, 0), Vec3(0, 0, 1)};
    stage.spin(1) = {Vec3(0, 1, 0), Vec3(2, 0, 1)};
    mobility.resize(2);
    for (const std::size_t s : {0u, 1u}) {
      for (const double m : mass[s]) {
        mobility[s].inverse_mass.push_back(Vec3::Constant(1.0 / m));
        mobility[s].inverse_inertia.push_back(Mat3::Identity() / (0.1 * m));
      }
    }
    stage.solve({.error = 1e-3});
  }
};

TEST(HardCores, TurnTheApproachBackAndKeepEnergyAndMomenta) {
  Deep deep;
  ASSERT_EQ(deep.stage.surface.summary.size(), 1u);
  const ContactSurface::Summary& s = deep.stage.surface.summary[0];
  ASSERT_GT(s.largest_pressure, core_pressure(deep.stage.bodies()[0], deep.stage.bodies()[1]));
  const Approach before = measure_approach(deep.stage.bodies(), s);
  ASSERT_GT(before.speed, 1.0);
  std::vector<PartLoads> impulses(2);
  for (const std::size_t i : {0u, 1u}) {
    impulses[i].force.assign(deep.mass[i].size(), Vec3::Zero());
    impulses[i].torque.assign(deep.mass[i].size(), Vec3::Zero());
  }
  const CoreImpulses report = hold_cores(deep.stage.bodies(), deep.mobility, deep.stage.surface, impulses);
  EXPECT_EQ(report.turned, 1u);
  EXPECT_TRUE(report.settled);
  Vec3 momentum = Vec3::Zero(), angular = Vec3::Zero();
  double gain = 0.0, kinetic = 0.0;
  for (const std::size_t i : {0u, 1u}) {
    for (std::size_t k = 0; k < deep.mass[i].size(); ++k) {
      const double m = deep.mass[i][k];
      const Vec3 j = impulses[i].force[k], turn = impulses[i].torque[k];
      momentum += j;
      angular += deep.stage.pose(i)[k].position.cross(j) + turn;
      Vec3 &v = deep.stage.velocity(i)[k], &w = deep.stage.spin(i)[k];
      kinetic += 0.5 * m * v.squaredNorm() + 0.05 * m * w.squaredNorm();
      v += j / m;
      w += turn / (0.1 * m);
      gain += 0.5 * m * v.squaredNorm() + 0.05 * m * w.squaredNorm();
    }
  }
  const Approach after = measure_approach(deep.stage.bodies(), s);
  EXPECT_NEAR(after.speed, -before.speed, 1e-12 * before.speed);
  EXPECT_LT(momentum.norm(), 1e-12);
  EXPECT_LT(angular.norm(), 1e-12);
  EXPECT_NEAR(gain, kinetic, 1e-12 * kinetic);
}

TEST(HardCores, LeaveAloneWhatPartsAndWhatIsShallow) {
  Deep parting;
  for (const std::size_t i : {0u, 1u}) {
    for (Vec3& v : parting.stage.velocity(i)) v = -v;
    for (Vec3& w : parting.stage.spin(i)) w = -w;
  }
  Deep shallow;
  for (ContactBody& body : shallow.stage.bodies()) body.core_value = 5.0;
  for (Deep* deep : {&parting, &shallow}) {
    std::vector<PartLoads> impulses(2);
    for (const std::size_t i : {0u, 1u}) {
      impulses[i].force.assign(deep->mass[i].size(), Vec3::Zero());
      impulses[i].torque.assign(deep->mass[i].size(), Vec3::Zero());
    }
    EXPECT_EQ(hold_cores(deep->stage.bodies(), deep->mobility, deep->stage.surface, impulses).turned, 0u);
    for (const PartLoads& loads : impulses) {
      for (const Vec3& j : loads.force) EXPECT_EQ(j, Vec3::Zero().eval());
    }
  }
}

}  // namespace
}  // namespace supple::collision
