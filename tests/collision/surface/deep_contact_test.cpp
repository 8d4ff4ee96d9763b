/// Bodies pressed into one another by as much as their radius and more, where most of a soft body lies beyond the contact surface.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <optional>
#include <span>
#include <vector>

#include "benchmarks/contact_shapes.h"
#include "collision/bodies.h"
#include "supple/implicit/solids.h"

namespace supple::collision {
namespace {

constexpr double kSupport = 0.5, kModulus = 1e4;  // of a ball of Wyvill's kernel [m], [Pa]
constexpr double kStiffness = 1e6;                // of the plane [Pa/m]

std::vector<ContactSurface::Summary> query_all(std::span<const ContactBody> bodies, const ContactSettings& settings) {
  const Executor executor(1);
  ContactCandidates candidates;
  ContactSurface surface;
  find_contacts(bodies, broad_phase(bodies, {}, executor), executor, candidates);
  solve_contact_surface(bodies, candidates, settings, executor, surface);
  return surface.summary;
}

ContactSurface::Summary query(const std::array<ContactBody, 2>& bodies, double error) { return query_all(bodies, {.error = error}).at(0); }

ContactSurface::Summary ball_on_plane(double height, double error, double stiffness = kStiffness) {
  benchmarks::Rigid ball(benchmarks::wyvill_shape(implicit::ShapeKind::Point, Vec3::Zero(), kSupport), kModulus, 0.03);
  ball.put({});
  const implicit::HalfSpace plane{Vec3(0.0, 0.0, height), Vec3::UnitZ(), 1.0};
  const Pose still;
  return query({ball.body(), benchmarks::single_part(plane, stiffness, still)}, error);
}

double ball_pressure(double square) {
  const double t = std::max(1.0 - square / (kSupport * kSupport), 0.0);
  return kModulus * (t * t * t - 0.5);
}

/// The integral of the smaller pressure, by the midpoints of cells around the axis; its kinks cost the square of a cell.
double energy_on_plane(double height, double stiffness) {
  constexpr int kCells = 1200;
  const double cell = kSupport / kCells;
  double sum = 0.0;
  for (int j = -kCells; j < kCells; ++j) {
    for (int i = 0; i < kCells; ++i) {
      const double rho = (i + 0.5) * cell, z = (j + 0.5) * cell;
      sum += rho * std::max(std::min(ball_pressure(rho * rho + z * z), stiffness * (height - z)), 0.0);
    }
  }
  return 2.0 * benchmarks::kPi * cell * cell * sum;
}

/// Three balls of Wyvill's kernel, each in the others, at `at`.
struct Three {
  std::vector<benchmarks::Rigid> ball;
  explicit Three(const std::array<Vec3, 3>& at) {
    for (const Vec3& x : at) {
      ball.emplace_back(benchmarks::wyvill_shape(implicit::ShapeKind::Point, Vec3::Zero(), kSupport), kModulus, 0.03);
      ball.back().put({x, Quat::Identity()});
    }
  }
  [[nodiscard]] std::vector<ContactSurface::Summary> query(const ContactSettings& settings) const {
    std::vector<ContactBody> bodies;
    for (const benchmarks::Rigid& b : ball) bodies.push_back(b.body());
    return query_all(bodies, settings);
  }
};

double energy_of(std::span<const ContactSurface::Summary> pairs) {
  double sum = 0.0;
  for (const auto& s : pairs) sum += s.energy;
  return sum;
}

/// The integral of all pressures but the largest, by the midpoints of cells.
double energy_of_all_but_the_largest(const std::array<Vec3, 3>& at) {
  constexpr int kCells = 160;
  constexpr double kHalf = 0.45;
  const double cell = 2.0 * kHalf / kCells;
  double sum = 0.0;
  for (int k = 0; k < kCells; ++k) {
    for (int j = 0; j < kCells; ++j) {
      for (int i = 0; i < kCells; ++i) {
        const Vec3 x = cell * Vec3(i + 0.5, j + 0.5, k + 0.5) - Vec3::Constant(kHalf);
        double all = 0.0, largest = 0.0;
        for (const Vec3& centre : at) {
          const double p = std::max(ball_pressure((x - centre).squaredNorm()), 0.0);
          all += p;
          largest = std::max(largest, p);
        }
        sum += all - largest;
      }
    }
  }
  return sum * cell * cell * cell;
}

std::array<Vec3, 3> together(double far) { return {far * Vec3(0.11, 0.0, 0.02), far * Vec3(-0.09, 0.1, 0.0), far * Vec3(-0.05, -0.12, 0.01)}; }

/// Normal force: the integral of the pressure on Sigma over its projection, by Simpson's rule in rho = rim sin t.
double force_on_plane(double height) {
  const auto ball = [](double square) {
    const double t = 1.0 - square / (kSupport * kSupport);
    return std::array{kModulus * (t * t * t - 0.5), -3.0 * kModulus * t * t / (kSupport * kSupport)};  // and its rate over the square
  };
  const double radius_square = kSupport * kSupport * (1.0 - std::cbrt(0.5)), rim = std::sqrt(radius_square - height * height);
  constexpr int kNodes = 4000;
  double force = 0.0;
  for (int i = 0; i <= kNodes; ++i) {
    const double t = 0.5 * benchmarks::kPi * i / kNodes, rho = rim * std::sin(t);
    double z = height;
    for (int step = 0; step < 30; ++step) {  // ball = plane at z
      const auto [p, rate] = ball(rho * rho + z * z);
      z -= (p - kStiffness * (height - z)) / (2.0 * z * rate + kStiffness);
    }
    const double weight = i == 0 || i == kNodes ? 1.0 : i % 2 == 1 ? 4.0 : 2.0;
    force += weight * rho * kStiffness * (height - z) * rim * std::cos(t);
  }
  return force * 2.0 * benchmarks::kPi * 0.5 * benchmarks::kPi / kNodes / 3.0;
}

TEST(DeepContact, OfABallInAStiffPlaneIsItsIntegralPastItsMiddle) {
  for (const double height : {-0.15, -0.08, -0.05, -0.03, -0.02, -0.01, 0.0, 0.01, 0.02, 0.03, 0.06, 0.1, 0.15}) {
    for (const double error : {1e-3, 1e-6, 1e-8}) {
      const ContactSurface::Summary s = ball_on_plane(height, error);
      const double exact = force_on_plane(height);
      EXPECT_EQ(s.rule, height < 0.12 ? ContactRule::Polar : ContactRule::March) << height;  // half of the radius past the middle
      EXPECT_LE(s.error_estimate, error) << height;
      EXPECT_NEAR(s.force.z(), exact, s.error_estimate * exact + 1e-10 * exact) << height << ' ' << error;
    }
  }
}

TEST(DeepContact, OfABallInAStiffPlaneHasTheGradientOfItsEnergyAsForce) {
  constexpr double kStep = 1e-4;  // the third derivative of the energy is about that of F h / R^2: 1e-8 F
  for (const double height : {-0.1, -0.03, 0.0, 0.03, 0.1}) {
    const double rate = (ball_on_plane(height + kStep, 1e-8).energy - ball_on_plane(height - kStep, 1e-8).energy) / (2.0 * kStep);
    EXPECT_NEAR(rate, force_on_plane(height), 2e-5 * force_on_plane(0.0)) << height;
  }
}

TEST(DeepContact, OfABallInASoftPlaneHasItsEnergyHoweverDeep) {
  for (const double stiffness : {3e3, 3e4, 3e5}) {
    for (const double height : {-0.1, 0.0, 0.05, 0.1, 0.15, 0.2}) {
      const double exact = energy_on_plane(height, stiffness);
      for (const double error : {1e-3, 1e-5}) {
        const ContactSurface::Summary s = ball_on_plane(height, error, stiffness);
        EXPECT_NEAR(s.energy, exact, (4.0 * error + 2e-5) * exact) << stiffness << ' ' << height << ' ' << error;
        EXPECT_LE(s.largest_overlap, height + 0.228) << stiffness << ' ' << height;  // as deep as the ball reaches below the plane
      }
    }
  }
}

TEST(DeepContact, OfABallInASoftPlaneHasTheWorkOfItsForceAsEnergyToFineErrors) {
  constexpr double kStep = 5e-3, kError = 1e-8;  // Simpson's rule: h^5 / 90 times a fourth derivative of about F / R^4
  for (const double stiffness : {3e3, 3e4, 3e5}) {
    for (const double height : {0.0, 0.1, 0.15, 0.19}) {
      const auto at = [&](double more) { return ball_on_plane(height + more, kError, stiffness); };
      const ContactSurface::Summary low = at(-kStep), middle = at(0.0), high = at(kStep);
      const double work = kStep / 3.0 * (low.force.z() + 4.0 * middle.force.z() + high.force.z());
      EXPECT_NEAR(high.energy - low.energy, work, 1e-6 * middle.energy) << stiffness << ' ' << height;
    }
  }
}

/// The integral of the smaller pressure of two bodies over a box, and the volumes where each is the smaller one, by the midpoints of cells.
struct Overlap {
  double energy = 0.0;
  std::array<double, 2> volume{};
};
Overlap overlap_in(const Box& box, const ContactBody& a, const ContactBody& b, int cells = 120) {
  const Vec3 cell = box.extent() / cells;
  Overlap sum;
  std::vector<Vec3> row(static_cast<std::size_t>(cells));
  std::vector<double> of_a(row.size()), of_b(row.size());
  for (int k = 0; k < cells; ++k) {
    for (int j = 0; j < cells; ++j) {
      for (int i = 0; i < cells; ++i) row[static_cast<std::size_t>(i)] = box.lower + cell.cwiseProduct(Vec3(i + 0.5, j + 0.5, k + 0.5));
      a.field.evaluate(row, of_a);
      b.field.evaluate(row, of_b);
      for (std::size_t i = 0; i < row.size(); ++i) {
        const double p = a.material.modulus * of_a[i], q = b.material.modulus * of_b[i];
        if (!(std::min(p, q) > 0.0)) continue;
        sum.energy += std::min(p, q) * cell.prod();
        sum.volume[p < q ? 0 : 1] += cell.prod();
      }
    }
  }
  return sum;
}
double energy_in(const Box& box, const ContactBody& a, const ContactBody& b) { return overlap_in(box, a, b).energy; }

TEST(DeepContact, OfOtherShapesInASoftPlaneHasItsEnergyHoweverDeep) {
  for (const implicit::ShapeKind shape : {implicit::ShapeKind::Box, implicit::ShapeKind::Segment, implicit::ShapeKind::Disc}) {
    benchmarks::Rigid body(benchmarks::wyvill_shape(shape, Vec3(0.2, 0.12, 0.08), 0.3), kModulus, 0.03);
    body.put({Vec3::Zero(), Quat(0.9, 0.2, -0.3, 0.1).normalized()});
    const Box box = body.body().field.surface_box();
    for (const double share : {0.4, 0.6, 0.8}) {
      const implicit::HalfSpace plane{box.lower + share * box.extent(), Vec3::UnitZ(), 1.0};
      const Pose still;
      const ContactBody ground = benchmarks::single_part(plane, 5e4, still);
      const double exact = energy_in(box, body.body(), ground);
      for (const double error : {1e-3, 1e-5}) {
        const ContactSurface::Summary s = query({body.body(), ground}, error);
        EXPECT_NEAR(s.energy, exact, (4.0 * error + 1e-3) * exact) << static_cast<int>(shape) << ' ' << share << ' ' << error;  // cells: (1 / 120)^2 times 10
      }
    }
  }
}

TEST(DeepContact, OfARingAroundAStiffBallHasItsEnergy) {
  constexpr double kRing = 0.5;
  benchmarks::Rigid ring(benchmarks::wyvill_shape(implicit::ShapeKind::Ring, Vec3(kRing, 0.0, 0.0), 0.4), 1e4, 0.03);
  benchmarks::Rigid ball(benchmarks::wyvill_shape(implicit::ShapeKind::Point, Vec3::Zero(), 0.15), 1e7, 0.03);
  for (const double out : {0.05, 0.1, 0.14}) {
    ring.put({});
    ball.put({Vec3(kRing + out, 0.0, 0.0), Quat::Identity()});
    const double exact = energy_in(ball.body().field.surface_box(), ring.body(), ball.body());
    const ContactSurface::Summary s = query({ring.body(), ball.body()}, 1e-3);
    EXPECT_NEAR(s.energy, exact, 2e-3 * exact) << out;  // error, cells
    EXPECT_LE(s.largest_overlap, 0.14) << out;          // the ball is .137 m wide
  }
}

// A ball of linear pressure through a slab so stiff that its faces hardly yield: a patch on each, whose forces oppose each other.
TEST(DeepContact, OfABallThroughASlabHasThePatchesOfBothFaces) {
  constexpr double kRadius = 0.1, kHalf = 0.01, kSoft = 1e5, kStiff = 1e12;  // [m], [Pa/m]
  benchmarks::Rigid ball(benchmarks::linear_sphere(kRadius), kRadius * kSoft * benchmarks::kLinearModulus, 0.03);
  const implicit::SolidBox slab({}, Vec3(kHalf, 0.5, 0.5), 0.0, 1.0);
  const Pose still, turned{Vec3::Zero(), Quat(0.9, 0.3, -0.2, 0.1).normalized()};
  ContactBody wall = benchmarks::single_part(slab, kStiff, still);
  wall.fixed = true;
  // By a plane at the depth d a ball loses pi k d^2 (3 R - 2 d) / 3 in force and, as far as to its centre, the integral of that in energy.
  const auto force = [](double d) { return d > 0.0 ? benchmarks::kPi * kSoft * d * d * (3.0 * kRadius - 2.0 * d) / 3.0 : 0.0; };
  const auto energy = [](double d) { return d > 0.0 ? benchmarks::kPi * kSoft * d * d * d * (kRadius / 3.0 - d / 6.0) : 0.0; };
  for (const double x : {0.0899, 0.0895, 0.08, 0.05, 0.015}) {
    ball.put({Vec3(x, 0.003, -0.002), turned.orientation});
    const double near = kRadius - (x - kHalf), far = kRadius - (x + kHalf), exact = force(near) - force(far), load = force(near) + force(far);
    for (const double error : {1e-2, 1e-5}) {
      for (const bool with_energy : {true, false}) {
        const ContactSurface::Summary s = query_all(std::array{ball.body(), wall}, {.error = error, .energy = with_energy}).at(0);
        // What the slab yields: the depth of the ball over the ratio of the stiffnesses.
        const double yields = 10.0 * kSoft / kStiff * load, bound = s.error_estimate * std::max(exact, 1e-3 * load) + yields;
        EXPECT_NEAR(std::abs(s.force.x()), exact, bound) << x << ' ' << error << ' ' << with_energy;
        EXPECT_LE(s.error_estimate, error) << x << ' ' << error << ' ' << with_energy;
        if (!with_energy) continue;
        EXPECT_NEAR(s.energy, energy(near) - energy(far), 2.0 * std::max(error, 1e-4) * energy(near)) << x << ' ' << error;
      }
    }
  }
}

// Where the middle of the ball lies near a face, rays out of it all but lie in the patch there, and in it they do not meet it: samples are then no
// choice, however coarse the error.
TEST(DeepContact, OfABallWhoseMiddleLiesInAFaceIsNotLeftToSamples) {
  benchmarks::Rigid ball(benchmarks::linear_sphere(0.1), 2e4, 0.03);
  const implicit::SolidBox slab({}, Vec3(0.01, 0.5, 0.5), 0.0, 1.0);
  const Pose still;
  const ContactBody wall = benchmarks::single_part(slab, 1e12, still);
  for (const double x : {0.0085, 0.0099, 0.01, 0.0102, 0.012, 0.014}) {
    ball.put({Vec3(x, 0.003, -0.002), Quat::Identity()});
    const auto solve = [&](double error, ContactRule only) { return query_all(std::array{ball.body(), wall}, {.error = error, .only = only}).at(0); };
    const ContactSurface::Summary finest = solve(1e-4, ContactRule::March);
    const auto off = [&](const ContactSurface::Summary& s) { return (s.force - finest.force).norm() / std::max(finest.force.norm(), 1e-3 * finest.load); };
    for (const double error : {1e-1, 3e-2, 1e-2}) {
      const ContactSurface::Summary s = solve(error, ContactRule::None);
      EXPECT_LE(s.error_estimate, error) << x;
      EXPECT_LE(off(s), s.error_estimate + finest.error_estimate) << x << ' ' << error;
    }
  }
}

// Rods, discs and boxes through plates, at angles: against marching, which sees all of Sigma.
TEST(DeepContact, OfConvexBodiesThroughPlatesIsThatOfMarching) {
  using implicit::ShapeKind;
  benchmarks::Draw draw(7);
  int through = 0;
  for (int i = 0; i < 25; ++i) {
    const std::array<ShapeKind, 5> shapes{ShapeKind::Segment, ShapeKind::Point, ShapeKind::Ellipsoid, ShapeKind::Disc, ShapeKind::Box};
    const ShapeKind shape = shapes[static_cast<std::size_t>(i) % shapes.size()];
    const Vec3 size = shape == ShapeKind::Ellipsoid ? Vec3(0.2, 0.15, 0.3) : Vec3(0.15, 0.08, 0.05);
    benchmarks::Rigid body(benchmarks::wyvill_shape(shape, size, 0.15), kModulus * draw.logarithmic(0.1, 10.0), 0.03);
    benchmarks::Rigid plate(benchmarks::wyvill_shape(i % 2 == 0 ? ShapeKind::Rectangle : ShapeKind::Disc, Vec3(0.5, 0.5, 0.0), 0.06), kModulus, 0.03);
    plate.put({});
    body.put({Vec3(0.1, -0.05, draw.uniform(0.0, 0.25)), draw.rotation()});
    const auto query = [&](ContactRule only) {
      const auto all = query_all(std::array{body.body(), plate.body()}, {.error = 1e-3, .only = only});
      return all.empty() ? ContactSurface::Summary{} : all.front();
    };
    const ContactSurface::Summary found = query(ContactRule::None), marched = query(ContactRule::March);
    ASSERT_EQ(found.load > 0.0, marched.load > 0.0) << i;
    if (!(marched.load > 0.0)) continue;
    const double bound = found.error_estimate + marched.error_estimate, scale = std::max(marched.force.norm(), 1e-3 * marched.load);
    EXPECT_LE((found.force - marched.force).norm(), bound * scale) << i;
    EXPECT_NEAR(found.area / marched.area, 1.0, bound) << i;
    EXPECT_NEAR(found.energy / marched.energy, 1.0, 1e-2) << i;
    if (found.rule == ContactRule::March) ++through;
  }
  EXPECT_GE(through, 8);
}

/// Whether points of a box tell that A presses harder at one and B at another, both of them on both bodies: where these are convex Sigma lies between.
bool press_in_turn(const std::array<ContactBody, 2>& bodies, benchmarks::Draw& draw) {
  constexpr std::size_t kPoints = 20'000;
  const Box overlap = bodies[0].field.surface_box().intersection(bodies[1].field.surface_box());
  std::vector<Vec3> x(kPoints);
  for (Vec3& p : x) p = overlap.lower + overlap.extent().cwiseProduct(Vec3(draw.uniform(0.0, 1.0), draw.uniform(0.0, 1.0), draw.uniform(0.0, 1.0)));
  std::array<std::vector<double>, 2> value{std::vector<double>(kPoints), std::vector<double>(kPoints)};
  for (const std::size_t side : {0u, 1u}) bodies[side].field.evaluate(x, value[side]);
  bool one = false, other = false;
  for (std::size_t i = 0; i < kPoints; ++i) {
    const double a = bodies[0].material.modulus * value[0][i], b = bodies[1].material.modulus * value[1][i];
    one = one || (b > 0.0 && a > b);
    other = other || (a > 0.0 && b > a);
  }
  return one && other;
}

/// A convex body, thin or not: of a skeleton with samples, or a box without.
struct Convex {
  std::optional<benchmarks::Rigid> rigid;
  std::optional<implicit::SolidBox> box;
  Pose pose;
  double modulus = 0.0;

  Convex(benchmarks::Draw& draw, double thickness) : pose{0.05 * draw.direction(), draw.rotation()}, modulus(kModulus * draw.logarithmic(1e-3, 1e3)) {
    using implicit::ShapeKind;
    const auto kind = static_cast<std::size_t>(draw.uniform(0.0, 6.0));
    if (kind == 5) {
      box.emplace(pose, Vec3(0.5 * thickness, 0.3, 0.3), 0.0, 1.0);
      modulus *= 10.0;
      return;
    }
    const std::array<ShapeKind, 5> shapes{ShapeKind::Rectangle, ShapeKind::Disc, ShapeKind::Segment, ShapeKind::Point, ShapeKind::Box};
    rigid.emplace(benchmarks::wyvill_shape(shapes[kind], shapes[kind] == ShapeKind::Box ? Vec3(0.2, 0.2, 0.1 * thickness) : Vec3(0.2, 0.2, 0.0), thickness), modulus,
                  std::max(0.02, 0.3 * thickness));
    rigid->put(pose);
  }
  [[nodiscard]] ContactBody body() const { return rigid ? rigid->body() : benchmarks::single_part(*box, modulus, pose); }
};

/// How many pairs a test draws: more where SUPPLE_DRAWS says so.
int draws(int few) {
  const char* const asked = std::getenv("SUPPLE_DRAWS");
  return asked != nullptr ? std::atoi(asked) : few;
}

TEST(DeepContact, OfConvexBodiesIsNeverMissedHoweverThinOneIs) {
  benchmarks::Draw draw(11);
  int pressed = 0;
  for (int i = 0; i < draws(40); ++i) {
    const Convex thin(draw, draw.logarithmic(0.002, 0.1)), other(draw, draw.uniform(0.1, 0.25));
    const std::array<ContactBody, 2> bodies{thin.body(), other.body()};
    if (!press_in_turn(bodies, draw)) continue;
    ++pressed;
    const auto found = query_all(bodies, {.error = 0.1, .energy = false});
    ASSERT_EQ(found.size(), 1u) << i;
    EXPECT_GT(found[0].load, 0.0) << i;
  }
  EXPECT_GE(pressed, draws(40) / 2);
  RecordProperty("pressed", pressed);
}

// Within the ball the plate presses less everywhere but near the ball's surface: Sigma is a narrow ring there.
TEST(DeepContact, OfASoftPlateInABallIsNotTakenForOneWhollyWithin) {
  constexpr double kRadius = 0.1, kSlope = 1e5;
  benchmarks::Rigid ball(benchmarks::linear_sphere(kRadius), kRadius * kSlope * benchmarks::kLinearModulus, 0.03);
  const implicit::SolidBox plate({}, Vec3(0.001, 0.5, 0.5), 0.0, 1.0);
  const Pose still;
  for (const auto& [softer, x] : {std::pair(1.0, 0.02), std::pair(0.5, 0.01), std::pair(0.1, 0.02), std::pair(0.1, 0.03)}) {
    const ContactBody wall = benchmarks::single_part(plate, softer * kSlope, still);
    ball.put({Vec3(x, 0.0, 0.0), Quat::Identity()});
    const auto found = query_all(std::array{ball.body(), wall}, {.error = 1e-2});
    ASSERT_EQ(found.size(), 1u) << softer << ' ' << x;
    EXPECT_GT(found[0].load, 0.0) << softer << ' ' << x;
  }
}

// Seen otherwise cells lie otherwise. Where there are too many, or too long ones, what lies between their corners is unknown.
TEST(DeepContact, OfThinBodiesKeepsItsBounds) {
  benchmarks::Draw draw(11);
  int bounded = 0;
  for (int i = 0; i < draws(12); ++i) {
    const Convex thin(draw, draw.logarithmic(0.002, 0.1)), other(draw, draw.uniform(0.1, 0.25));
    const std::array<ContactBody, 2> bodies{thin.body(), other.body()};
    if (!press_in_turn(bodies, draw)) continue;
    const ContactSettings settings{.error = 1e-2, .energy = false, .only = ContactRule::March};
    const auto one = query_all(bodies, settings), same = query_all(benchmarks::seen_otherwise(bodies), settings);
    if (one.empty() || same.empty() || one[0].error_estimate >= 1.0 || same[0].error_estimate >= 1.0) continue;
    ++bounded;
    const double bound = one[0].error_estimate + same[0].error_estimate;
    EXPECT_LE((one[0].force + same[0].force).norm(), bound * std::max(same[0].force.norm(), 1e-3 * same[0].load)) << i;
    EXPECT_NEAR(one[0].area / same[0].area, 1.0, bound) << i;
  }
  EXPECT_GE(bounded, draws(12) / 4);
  RecordProperty("bounded", bounded);
}

// Planes of cells that are as long as the ball's features and as short as the slab's: cubes would be too many.
TEST(DeepContact, OfABallThroughAThinSlabIsAsExactAsAsked) {
  constexpr double kRadius = 0.1, kSoft = 1e5, kStiff = 1e12;  // [m], [Pa/m]
  benchmarks::Rigid ball(benchmarks::linear_sphere(kRadius), kRadius * kSoft * benchmarks::kLinearModulus, 0.03);
  // Of a plane so far from the middle; on both sides of it alike.
  const auto force = [](double z) { return benchmarks::kPi * kSoft * (kRadius - z) * (kRadius - z) * (kRadius + 2.0 * z) / 3.0; };
  for (const double half : {2e-3, 2e-4}) {
    const Pose lies{Vec3(0.02, -0.01, 0.03), Quat(0.9, 0.3, -0.2, 0.1).normalized()};
    const implicit::SolidBox slab(lies, Vec3(half, 0.5, 0.5), 0.0, 1.0);
    ContactBody wall = benchmarks::single_part(slab, kStiff, lies);
    wall.fixed = true;
    for (const double x : {0.08, 0.02}) {
      ball.put({lies.position + lies.orientation * Vec3(x, 0.003, -0.002), Quat::Identity()});
      const double near = force(x - half), far = force(x + half), exact = near - far, load = near + far;
      for (const double error : {1e-2, 1e-4}) {
        const ContactSurface::Summary s = query_all(std::array{ball.body(), wall}, {.error = error, .energy = false}).at(0);
        // What the slab yields, in each face: the depth of the ball over the ratio of the stiffnesses.
        const double yields = 10.0 * kSoft / kStiff * load, bound = s.error_estimate * std::max(exact, 1e-3 * load) + yields;
        EXPECT_NEAR(std::abs(s.force.dot(lies.orientation * Vec3::UnitX())), exact, bound) << half << ' ' << x << ' ' << error;
        EXPECT_LE(s.error_estimate, error) << half << ' ' << x << ' ' << error;
      }
    }
  }
}

/// pi E R^3 / 3: the integral of a linear ball's pressure E (1 - r/R).
double all_of(double modulus, double radius) { return benchmarks::kPi * 0.5 * modulus * radius * radius * radius / 3.0; }

void expect_within(const ContactSurface::Summary& s, double energy, double volume) {
  constexpr double kRegion = 1e-4;  // to which regions are filled at most
  EXPECT_EQ(s.reason, RuleReason::Within);
  EXPECT_EQ(s.rule, ContactRule::None);
  EXPECT_EQ(s.force, Vec3::Zero());
  EXPECT_EQ(s.error_estimate, 0.0);
  EXPECT_NEAR(s.energy, energy, kRegion * energy);
  EXPECT_NEAR(s.displaced_a + s.displaced_b, volume, kRegion * volume);
}

// There is no Sigma then, but the energy that it took: the contact energy has no jump where Sigma vanishes.
TEST(DeepContact, OfABodyWhollyWithinAnotherIsTheEnergyOfAllOfIt) {
  constexpr double kRadius = 0.1, kSoft = 2e4;
  const double energy = all_of(kSoft, kRadius), volume = 4.0 / 3.0 * benchmarks::kPi * kRadius * kRadius * kRadius;
  benchmarks::Rigid ball(benchmarks::linear_sphere(kRadius), kSoft, 0.03), large(benchmarks::linear_sphere(3.0 * kRadius), 10.0 * kSoft, 0.03);
  const implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 1.0};
  const Pose still;
  const ContactBody ground = benchmarks::single_part(plane, 1e9, still);
  for (const double depth : {1.01, 1.5, 8.0}) {
    ball.put({Vec3(0.02, -0.3, -depth * kRadius), Quat::Identity()});
    expect_within(query({ball.body(), ground}, 1e-6), energy, volume);
    expect_within(query({ground, ball.body()}, 1e-3), energy, volume);
    EXPECT_TRUE(query_all(std::array{ball.body(), ground}, {.error = 1e-4, .energy = false}).empty());
    ContactBody bare = ball.body();
    bare.samples = nullptr;
    expect_within(query({bare, ground}, 1e-4), energy, volume);
  }
  // By its samples where no primitive sits in the middle of it; and without a skeleton.
  benchmarks::Rigid ring(benchmarks::wyvill_shape(implicit::ShapeKind::Ring, Vec3(0.3, 0.0, 0.0), 0.1), kSoft, 0.03);
  ring.put({Vec3(0.0, 0.0, -0.5), Quat(0.8, 0.0, 0.6, 0.0)});
  const ContactSurface::Summary sunk = query({ring.body(), ground}, 1e-3);
  const double across = std::sqrt(1.0 - std::cbrt(0.5)) * 0.1;  // radius of the tube: Pappus' theorem
  EXPECT_EQ(sunk.reason, RuleReason::Within);
  EXPECT_NEAR(sunk.displaced_a, 2.0 * benchmarks::kPi * 0.3 * benchmarks::kPi * across * across, 1e-3 * sunk.displaced_a);
  const implicit::SolidBox pebble({Vec3(0.01, 0.02, 0.0), Quat::Identity()}, Vec3(0.02, 0.01, 0.01), 0.0, 1.0);
  ball.put({});
  const ContactSurface::Summary stone = query({ball.body(), benchmarks::single_part(pebble, 1e3, still)}, 1e-4);
  EXPECT_EQ(stone.reason, RuleReason::Within);
  EXPECT_NEAR(stone.displaced_b, 8.0 * 0.02 * 0.01 * 0.01, 1e-4 * stone.displaced_b);
  large.put({});
  for (const double x : {0.0, 0.05, 0.15}) {
    ball.put({Vec3(x, 0.0, 0.01), Quat::Identity()});
    expect_within(query({large.body(), ball.body()}, 1e-4), energy, volume);
  }
  // Past its middle most of the energy is there; the rest falls to nothing with what is left of Sigma.
  double before = 0.0;
  for (const double depth : {0.9, 0.97, 0.999}) {
    ball.put({Vec3(0.0, 0.0, -depth * kRadius), Quat::Identity()});
    const ContactSurface::Summary s = query({ball.body(), ground}, 1e-6);
    EXPECT_GT(s.load, 0.0);
    EXPECT_GT(s.energy, before);
    // What is missing is the work on the rest of the way, of less force than now: the area where the ball cuts the plane times the largest pressure there.
    const double cap = benchmarks::kPi * (kRadius * kRadius - depth * depth * kRadius * kRadius), pressure = 0.5 * kSoft * (1.0 - depth);
    EXPECT_NEAR(s.energy, energy, cap * pressure * kRadius * (1.0 - depth) + 1e-4 * energy) << depth;
    before = s.energy;
  }
}

TEST(DeepContact, OfEqualBodiesInOnePlaceIsTheEnergyOfOne) {
  constexpr double kRadius = 0.1, kSoft = 2e4;
  benchmarks::Rigid ball(benchmarks::linear_sphere(kRadius), kSoft, 0.03), same(benchmarks::linear_sphere(kRadius), kSoft, 0.03);
  const Pose place{Vec3(0.3, -2.0, 0.1), Quat(0.5, 0.5, -0.5, 0.5)};
  ball.put(place);
  same.put(place);
  expect_within(query({ball.body(), same.body()}, 1e-4), all_of(kSoft, kRadius), 4.0 / 3.0 * benchmarks::kPi * kRadius * kRadius * kRadius);
  // A bit off, and there is a plane of equal pressures between them.
  same.put({place.position + Vec3(1e-9, 0.0, 0.0), place.orientation});
  const ContactSurface::Summary apart = query({ball.body(), same.body()}, 1e-4);
  EXPECT_NE(apart.reason, RuleReason::Within);
  EXPECT_NEAR(apart.area, benchmarks::kPi * kRadius * kRadius, 1e-3 * apart.area);
  EXPECT_NEAR(apart.energy, all_of(kSoft, kRadius), 1e-3 * apart.energy);
  // Nor are those of another stiffness, which press harder all over.
  benchmarks::Rigid harder(benchmarks::linear_sphere(kRadius), 3.0 * kSoft, 0.03);
  harder.put(place);
  const double energy = all_of(kSoft, kRadius), volume = 4.0 / 3.0 * benchmarks::kPi * kRadius * kRadius * kRadius;
  expect_within(query({ball.body(), harder.body()}, 1e-4), energy, volume);
  ContactBody held = ball.body();
  held.fixed = true;
  expect_within(query({held, harder.body()}, 1e-4), energy, volume);
  // All of their surfaces presses alike then, but for rounding: that is no Sigma.
  implicit::Skeleton steep = benchmarks::linear_sphere(kRadius);
  steep.primitive[0].kernel = implicit::Kernel::gascuel(kRadius, 1.5 * kRadius, 1.0 / kRadius);
  benchmarks::Rigid soft(steep, 0.5 * kSoft, 0.03), hard(steep, kSoft, 0.03);
  soft.put({});
  hard.put({});
  expect_within(query({soft.body(), hard.body()}, 1e-4), energy, volume);
}

/// Bodies that are not convex, in one another beyond their middles.
struct DeepPair {
  const char* name;
  implicit::Skeleton a;
  double modulus_a;
  implicit::Skeleton b;
  double modulus_b;
  Pose pose;  // of B
};

std::vector<DeepPair> deep_pairs() {
  using benchmarks::wyvill_shape;
  using implicit::ShapeKind;
  const implicit::Skeleton ring = wyvill_shape(ShapeKind::Ring, Vec3(0.3, 0.0, 0.0), 0.15), ball = wyvill_shape(ShapeKind::Point, Vec3::Zero(), 0.5);
  const implicit::Skeleton plate = wyvill_shape(ShapeKind::Rectangle, Vec3(0.8, 0.8, 0.0), 0.2), stick = wyvill_shape(ShapeKind::Segment, Vec3(0.5, 0.0, 0.0), 0.15);
  implicit::Skeleton two;
  for (const double x : {-0.2, 0.2}) {
    implicit::Primitive p;
    p.kernel = implicit::Kernel::wyvill(0.3);
    p.offset.position = Vec3(x, 0.0, 0.0);
    two.primitive.push_back(p);
  }
  two.part_count = 1;
  const auto turned = [](const Vec3& at, double angle, const Vec3& axis) { return Pose{at, Quat(Eigen::AngleAxisd(angle, axis.normalized()))}; };
  const Pose upright = turned(Vec3(0.1, 0.02, 0.03), 1.57, Vec3(0.0, 1.0, 0.1)), leaning = turned(Vec3(0.25, 0.02, 0.1), 1.2, Vec3(0.1, 1.0, 0.1));
  return {{"soft ring in ball", ring, 1e3, ball, 1e4, {Vec3(0.2, 0.01, 0.02), Quat::Identity()}},
          {"soft ring through ball", ring, 1e3, ball, 1e4, {Vec3(0.35, 0.01, 0.02), Quat::Identity()}},
          {"stiff ring in ball", ring, 1e5, ball, 1e4, {Vec3(0.3, 0.01, 0.02), Quat::Identity()}},
          {"soft ring through plate", ring, 1e3, plate, 1e4, upright},
          {"stiff ring through plate", ring, 1e5, plate, 1e4, upright},
          {"soft ring within plate", ring, 1e3, plate, 1e4, {Vec3(0.01, 0.02, 0.05), Quat::Identity()}},
          {"stiff ring within plate", ring, 1e5, plate, 1e4, {Vec3(0.01, 0.02, 0.0), Quat::Identity()}},
          {"ring in ring", ring, 1e3, ring, 1e4, leaning},
          {"ring as stiff as stick", ring, 1e4, stick, 1e4, leaning},
          {"two soft balls in ball", two, 1e3, ball, 1e4, {Vec3(0.01, 0.05, 0.03), Quat::Identity()}},
          {"one of two soft balls beyond its middle", two, 1e3, ball, 1e4, {Vec3(0.01, 0.1, 0.03), Quat::Identity()}},
          {"ten soft balls in ten", benchmarks::ten_blobs(3), 1e3, benchmarks::ten_blobs(4), 1e4, {Vec3(0.03, 0.01, 0.02), Quat::Identity()}}};
}

/// Integral of min(p_A, p_B) over what two balls of Wyvill's kernel about one centre have in common.
double energy_of_nested(const std::array<double, 2>& support, const std::array<double, 2>& modulus) {
  constexpr int kShells = 20000;
  double sum = 0.0;
  for (int k = 0; k < kShells; ++k) {
    const double r = support[0] * (k + 0.5) / kShells;
    std::array<double, 2> p;
    for (const std::size_t side : {0u, 1u}) p[side] = modulus[side] * (std::pow(std::max(0.0, 1.0 - r * r / (support[side] * support[side])), 3) - 0.5);
    sum += std::max(0.0, std::min(p[0], p[1])) * 4.0 * std::numbers::pi * r * r * support[0] / kShells;
  }
  return sum;
}

// What one of them has more of everywhere leaves no Sigma between them; where their pressures cross there is a sphere of it.
TEST(DeepContact, OfBallsAboutOneCentreHasItsEnergyAndTakesFewEvaluationsWithoutSigma) {
  struct Case {
    std::array<double, 2> support, modulus;
    bool crosses;
  };
  for (const Case& c : {Case{{0.5, 0.5}, {1e4, 2e4}, false}, {{0.5, 0.8}, {1e4, 1e4}, false}, {{0.5, 0.3}, {2e6, 1e4}, false}, {{0.5, 0.4}, {1e4, 3e4}, true}}) {
    const Pose pose{Vec3(0.3, -0.2, 0.7), Quat::Identity()};
    benchmarks::Rigid one(benchmarks::wyvill_shape(implicit::ShapeKind::Point, Vec3::Zero(), c.support[0]), c.modulus[0], 0.03);
    benchmarks::Rigid other(benchmarks::wyvill_shape(implicit::ShapeKind::Point, Vec3::Zero(), c.support[1]), c.modulus[1], 0.03);
    one.put(pose);
    other.put(pose);
    const std::vector<ContactSurface::Summary> found = query_all(std::array{one.body(), other.body()}, {.error = 1e-3});
    ASSERT_EQ(found.size(), 1u);
    const ContactSurface::Summary& s = found[0];
    const double energy = energy_of_nested(c.support, c.modulus);
    EXPECT_NEAR(s.energy, energy, 2e-3 * energy);
    EXPECT_LT(s.force.norm(), 1e-9 * std::max(c.modulus[0], c.modulus[1]));
    EXPECT_EQ(s.reason == RuleReason::Within, !c.crosses);
    if (c.crosses) continue;
    // As many as filling the softer ball takes, as where both are the same.
    const benchmarks::Rigid& softer = c.support[1] < c.support[0] || c.modulus[1] < c.modulus[0] ? other : one;
    const std::vector<ContactSurface::Summary> alone = query_all(std::array{softer.body(), softer.body()}, {.error = 1e-3});
    ASSERT_EQ(alone.size(), 1u);
    EXPECT_LT(static_cast<double>(s.evaluations), 1.1 * static_cast<double>(alone[0].evaluations)) << c.support[1];
  }
}

TEST(DeepContact, OfBodiesThatAreNotConvexHasItsEnergyAndVolumes) {
  for (const DeepPair& pair : deep_pairs()) {
    benchmarks::Rigid a(pair.a, pair.modulus_a, 0.04), b(pair.b, pair.modulus_b, 0.04);
    b.put(pair.pose);
    const Box box = a.body().field.surface_box().intersection(b.body().field.surface_box());
    const Overlap exact = overlap_in(box, a.body(), b.body(), 160);
    const double all = exact.volume[0] + exact.volume[1];
    for (const double error : {1e-2, 1e-3}) {
      const ContactSurface::Summary s = query({a.body(), b.body()}, error);
      EXPECT_NEAR(s.energy, exact.energy, (error + 5e-4) * exact.energy) << pair.name << ' ' << error;  // cells
      EXPECT_NEAR(s.displaced_a, exact.volume[0], (2.0 * error + 2e-3) * all) << pair.name << ' ' << error;
      EXPECT_NEAR(s.displaced_b, exact.volume[1], (2.0 * error + 2e-3) * all) << pair.name << ' ' << error;
    }
  }
}

TEST(ThreeBodies, HaveTheEnergyOfAllPressuresButTheLargest) {
  for (const double far : {1.6, 1.3, 1.0}) {
    const double exact = energy_of_all_but_the_largest(together(far));
    for (const double error : {1e-3, 1e-5, 1e-8}) {
      const auto pairs = Three(together(far)).query({.error = error});
      ASSERT_EQ(pairs.size(), 3u);
      EXPECT_EQ(pairs[0].rule, ContactRule::Polar);
      // What flows through Sigma grows with the square of how near it is to the middles: the rule, made for forces, meets it later.
      EXPECT_NEAR(energy_of(pairs), exact, (20.0 * error + 2e-4) * exact) << far << ' ' << error;
    }
    EXPECT_NEAR(energy_of(Three(together(far)).query({.error = 1e-3, .only = ContactRule::March})), exact, 4e-3 * exact) << far;
  }
}

TEST(ThreeBodies, OfWhichOneIsARingHaveTheEnergyOfAllPressuresButTheLargest) {
  const std::array<double, 3> modulus{1e3, 1e4, 1.5e4};
  std::vector<benchmarks::Rigid> body;
  body.emplace_back(benchmarks::wyvill_shape(implicit::ShapeKind::Ring, Vec3(0.3, 0.0, 0.0), 0.15), modulus[0], 0.04);
  for (const std::size_t k : {1u, 2u}) body.emplace_back(benchmarks::wyvill_shape(implicit::ShapeKind::Point, Vec3::Zero(), 0.4), modulus[k], 0.04);
  body[1].put({Vec3(0.3, -0.1, 0.02), Quat::Identity()});
  body[2].put({Vec3(0.25, 0.15, -0.03), Quat::Identity()});
  const std::array bodies{body[0].body(), body[1].body(), body[2].body()};
  const Box box = bodies[1].field.surface_box().united(bodies[2].field.surface_box());
  constexpr int kCells = 120;
  const Vec3 cell = box.extent() / kCells;
  double exact = 0.0;
  for (int k = 0; k < kCells; ++k) {
    for (int j = 0; j < kCells; ++j) {
      for (int i = 0; i < kCells; ++i) {
        const Vec3 x = box.lower + cell.cwiseProduct(Vec3(i + 0.5, j + 0.5, k + 0.5));
        double all = 0.0, largest = 0.0;
        for (const ContactBody& b : bodies) {
          const double p = std::max(b.material.modulus * b.field.value(x), 0.0);
          all += p;
          largest = std::max(largest, p);
        }
        exact += (all - largest) * cell.prod();
      }
    }
  }
  EXPECT_NEAR(energy_of(query_all(bodies, {.error = 1e-3})), exact, 4e-3 * exact);
}

TEST(ThreeBodies, HaveForcesThatAreTheGradientOfTheirEnergy) {
  constexpr double kStep = 1e-3, kError = 1e-8;
  const std::array<Vec3, 3> middle = together(1.3);
  Vec3 force = Vec3::Zero();  // on the first
  for (const auto& s : Three(middle).query({.error = kError})) {
    if (s.bodies.a == 0) force += s.force;
  }
  for (int k = 0; k < 3; ++k) {
    const auto energy = [&](double by) {
      std::array<Vec3, 3> at = middle;
      at[0][k] += by;
      return energy_of(Three(at).query({.error = kError}));
    };
    const double rate = (energy(kStep) - energy(-kStep)) / (2.0 * kStep);
    // The energies' own errors over the step, and that of the difference, about (h / R)^2.
    EXPECT_NEAR(force[k], -rate, 4.0 * kError * energy(0.0) / kStep + kStep * kStep / (kSupport * kSupport) * force.norm()) << k;
  }
}

TEST(DeepContact, OfBallsHasTrueBoundsToADepthOfMoreThanARadius) {
  constexpr double kRadius = 0.4;
  for (const double share : {1.9, 1.7, 1.5, 1.3, 1.2, 1.15, 1.1, 1.05, 1.0, 0.95, 0.9}) {
    const double far = share * kRadius;
    benchmarks::Rigid a(benchmarks::linear_sphere(kRadius), benchmarks::kLinearModulus * kModulus, 0.03);
    benchmarks::Rigid b(benchmarks::linear_sphere(kRadius), benchmarks::kLinearModulus * kModulus, 0.03);
    a.put({});
    b.put({Vec3(far, 0.0, 0.0), Quat::Identity()});
    const benchmarks::Answer exact = benchmarks::spheres(kRadius, kModulus, kRadius, kModulus, far, Vec3::Zero(), Vec3::UnitX());
    for (const double error : {1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10}) {
      const ContactSurface::Summary s = query({a.body(), b.body()}, error);
      EXPECT_LE(s.error_estimate, error) << share;
      EXPECT_LE(benchmarks::difference(s, exact), s.error_estimate + 1e-12) << share << ' ' << error;
    }
  }
}

}  // namespace
}  // namespace supple::collision
