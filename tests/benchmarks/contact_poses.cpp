/// @file contact_poses.cpp
/// Contact queries in many random poses: eight cases, worst and middle CPU time and error over the poses, one JSON
/// object a line. A query is broad phase, candidates and contact surface of two bodies, through the general path, with
/// no state from another pose. Spheres of linear pressure have closed forms: the isobar at pressure p is a circle. The
/// other cases are measured against the finest rule for the two bodies in the other order, which has other nodes; what it
/// may itself be off by is added to the bounds.
///   contact_poses [POSES] [CASE]
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "supple/collision/contact_surface.h"
#include "supple/core/hash.h"
#include "supple/core/math.h"
#include "supple/implicit/field.h"

namespace {

using namespace supple;

constexpr double kPi = std::numbers::pi;

class Draw {
 public:
  explicit Draw(std::uint64_t seed) : engine_(seed) {}
  double uniform(double lower, double upper) {
    return lower + (upper - lower) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }
  double logarithmic(double lower, double upper) { return std::exp(uniform(std::log(lower), std::log(upper))); }
  Vec3 direction() {
    const double z = uniform(-1.0, 1.0), r = std::sqrt(1.0 - z * z);
    const auto [s, c] = math::sin_cos(uniform(0.0, 2.0 * kPi));
    return {r * c, r * s, z};
  }
  Quat rotation() {
    const Vec3 axis = direction();
    return Quat(Eigen::AngleAxisd(uniform(0.0, kPi), axis));
  }

 private:
  std::mt19937_64 engine_;
};

/// One part of a body that moves as a whole; only pose and field differ.
collision::ContactBody single_part(const implicit::FieldView& field, double modulus, const Pose& pose) {
  static const Vec3 kStill = Vec3::Zero();
  collision::ContactBody body;
  body.field = field;
  body.material.modulus = modulus;
  body.pose = {&pose, 1};
  body.velocity = {&kStill, 1};
  body.angular_velocity = {&kStill, 1};
  return body;
}

/// A rigid body: its field and samples in the pose it was put in.
class Rigid {
 public:
  Rigid(implicit::Skeleton skeleton, double modulus, double spacing)
      : skeleton_(std::move(skeleton)), modulus_(modulus), layout_(implicit::make_sample_layout(skeleton_, spacing)) {
    put({});
    implicit::SampleState kept;
    implicit::sample_surface(skeleton_, layout_, {&pose_, 1}, field_, {}, Executor(1), kept, rest_);
  }
  void put(const Pose& pose) {
    pose_ = pose;
    implicit::place_skeleton(skeleton_, {&pose_, 1}, placed_);
    implicit::index_field(skeleton_, placed_, field_);
    samples_ = rest_;
    for (std::size_t i = 0; i < samples_.point.size(); ++i) {
      samples_.point[i] = pose.position + pose.orientation * rest_.point[i];
      samples_.normal[i] = pose.orientation * rest_.normal[i];
    }
  }
  [[nodiscard]] collision::ContactBody body() const {
    collision::ContactBody b = single_part(field_, modulus_, pose_);
    b.samples = &samples_;
    return b;
  }

 private:
  implicit::Skeleton skeleton_;
  double modulus_;
  implicit::SampleLayout layout_;
  implicit::PlacedSkeleton placed_;
  implicit::Field field_;
  implicit::SurfaceSamples rest_, samples_;
  Pose pose_;
};

/// Sphere of radius r with p = E (1 - d / r) inside: Gascuel's kernel, linear as far as the surface.
implicit::Skeleton linear_shape(implicit::ShapeKind shape, const Vec3& size, double r) {
  implicit::Skeleton skeleton;
  implicit::Primitive p;
  p.shape = shape;
  p.size = size;
  p.kernel = implicit::Kernel::gascuel(r, 1.5 * r, 0.5 / r);
  skeleton.primitive.push_back(p);
  skeleton.part_count = 1;
  return skeleton;
}
implicit::Skeleton linear_sphere(double r) { return linear_shape(implicit::ShapeKind::Point, Vec3::Zero(), r); }
/// F = slope (r - d) there, so that p = E (1 - d / r) has the modulus E / (slope r) = 2 E.
constexpr double kLinearModulus = 2.0;

implicit::Skeleton wyvill_shape(implicit::ShapeKind shape, const Vec3& size, double support) {
  implicit::Skeleton skeleton;
  implicit::Primitive p;
  p.shape = shape;
  p.size = size;
  p.kernel = implicit::Kernel::wyvill(support);
  skeleton.primitive.push_back(p);
  skeleton.part_count = 1;
  return skeleton;
}

/// Ten blobs in a lump, their supports overlapping.
implicit::Skeleton ten_blobs(std::uint64_t seed) {
  Draw draw(seed);
  implicit::Skeleton skeleton;
  for (int i = 0; i < 10; ++i) {
    implicit::Primitive p;
    p.kernel = implicit::Kernel::wyvill(0.1 * draw.uniform(0.8, 1.2));
    p.offset.position = 0.05 * draw.direction();
    skeleton.primitive.push_back(p);
  }
  skeleton.part_count = 1;
  return skeleton;
}

/// What a query answers, for comparison.
struct Answer {
  double force = 0.0;
  double area = 0.0;
  Vec3 centre = Vec3::Zero();
};

/// Integrals over z of a stack of discs: pressures from 0 to p_max, radius^2 rho2(p), height z(p) over the origin along
/// `axis`; dz/dp by `slope`. F = pi integral of rho^2 dp; area = 2 pi integral of sqrt(rho^2 z'^2 + (rho rho')^2) dp.
template <class Disc>
Answer stack_of_discs(double p_max, const Vec3& origin, const Vec3& axis, const Disc& disc) {
  // p = p_max sin^2(t) is smooth at both ends; Simpson's rule with enough nodes for round-off.
  constexpr int kNodes = 4000;
  Answer sum;
  double load = 0.0, first = 0.0;
  for (int i = 0; i <= kNodes; ++i) {
    const double t = 0.5 * kPi * i / kNodes;
    const double weight = (i == 0 || i == kNodes ? 1.0 : i % 2 == 1 ? 4.0 : 2.0) * 0.5 * kPi / kNodes / 3.0;
    const double s = std::sin(t), c = std::cos(t);
    const double p = p_max * s * s, dp = 2.0 * p_max * s * c * weight;
    const auto [rho2, rho_rate, z, z_rate] = disc(p);  // rho^2, d(rho^2)/dp / 2, z, dz/dp
    const double ring = 2.0 * kPi * std::sqrt(std::max(rho2, 0.0) * z_rate * z_rate + rho_rate * rho_rate);
    sum.force += kPi * rho2 * dp;
    sum.area += ring * dp;
    load += p * ring * dp;
    first += p * z * ring * dp;
  }
  sum.centre = origin + (first / load) * axis;
  return sum;
}

/// Two spheres of linear pressure: A at `centre`, B a distance D along `axis`.
Answer spheres(double ra, double ea, double rb, double eb, double D, const Vec3& centre, const Vec3& axis) {
  const double p_max = (ra + rb - D) / (ra / ea + rb / eb);
  return stack_of_discs(p_max, centre, axis, [=](double p) {
    const double a = ra * (1.0 - p / ea), b = rb * (1.0 - p / eb);
    const double da = -ra / ea, db = -rb / eb;
    const double z = (D * D + a * a - b * b) / (2.0 * D), dz = (a * da - b * db) / D;
    return std::array<double, 4>{a * a - z * z, a * da - z * dz, z, dz};
  });
}

/// A sphere of linear pressure at height h over a body whose pressure is k times the depth.
Answer sphere_on_flat(double r, double e, double k, double h, const Vec3& centre, const Vec3& down) {
  const double p_max = (r - h) / (r / e + 1.0 / k);
  return stack_of_discs(p_max, centre, down, [=](double p) {
    const double a = r * (1.0 - p / e), z = h + p / k;
    return std::array<double, 4>{a * a - z * z, -a * r / e - z / k, z, 1.0 / k};
  });
}

double cpu_microseconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
}

struct Query {
  collision::ContactCandidates candidates;
  collision::ContactSurface surface;
  double cpu_us = 0.0;

  /// The least time of `repeats` queries.
  const collision::ContactSurface::Summary* ask(std::span<const collision::ContactBody> bodies, double error,
                                                int repeats) {
    const Executor executor(1);
    cpu_us = std::numeric_limits<double>::infinity();
    for (int i = 0; i < repeats; ++i) {
      const double start = cpu_microseconds();
      find_contacts(bodies, collision::broad_phase(bodies, {}), executor, candidates);
      solve_contact_surface(bodies, candidates, {.error = error}, executor, surface);
      cpu_us = std::min(cpu_us, cpu_microseconds() - start);
    }
    return surface.summary.empty() ? nullptr : &surface.summary.front();
  }
};

double difference(const collision::ContactSurface::Summary& s, const Answer& exact) {
  return std::max({std::abs(s.force.norm() / exact.force - 1.0), std::abs(s.area / exact.area - 1.0),
                   (s.centre_of_pressure - exact.centre).norm() / std::sqrt(exact.area)});
}

/// One pose: the bodies in it, and the closed form where there is one.
struct Pair {
  std::array<collision::ContactBody, 2> bodies;
  bool known = false;
  Answer exact;
};

template <class MakePose>
void measure(std::string_view name, int poses, const MakePose& make_pose) {
  constexpr std::array<double, 4> kErrors{1e-2, 1e-3, 1e-6, 1e-10};
  constexpr int kRepeats = 10;
  struct Line {
    std::vector<double> cpu, error;
    int missed = 0, march = 0, unmet = 0, bound_broken = 0;
  };
  std::array<Line, kErrors.size()> lines;
  Hasher hasher;
  Draw draw(2026);
  for (int pose = 0; pose < poses; ++pose) {
    const Pair pair = make_pose(draw);
    Query query;
    Answer exact = pair.exact;
    double floor = 0.0;  // what the reference itself may be off by
    if (!pair.known) {
      const std::array<collision::ContactBody, 2> swapped{pair.bodies[1], pair.bodies[0]};
      const auto* s = query.ask(swapped, 1e-10, 1);
      if (s == nullptr) continue;  // apart: another pose
      exact = {s->force.norm(), s->area, s->centre_of_pressure};
      floor = s->error_estimate;
    }
    for (std::size_t k = 0; k < kErrors.size(); ++k) {
      Line& line = lines[k];
      const auto* s = query.ask(pair.bodies, kErrors[k], kRepeats);
      if (s == nullptr) {
        ++line.missed;
        continue;
      }
      hasher.add(std::span<const Vec3>(&s->force, 1));
      const double error = difference(*s, exact);
      line.cpu.push_back(query.cpu_us);
      line.error.push_back(error);
      line.march += s->rule == collision::ContactRule::March ? 1 : 0;
      line.unmet += s->error_estimate > kErrors[k] ? 1 : 0;
      line.bound_broken += error > s->error_estimate + floor ? 1 : 0;
    }
  }
  for (std::size_t k = 0; k < kErrors.size(); ++k) {
    Line& line = lines[k];
    std::sort(line.cpu.begin(), line.cpu.end());
    std::sort(line.error.begin(), line.error.end());
    const std::size_t n = line.cpu.size();
    if (n == 0) continue;
    std::printf("{\"name\": \"collision/poses/%s/error=%g\", \"poses\": %zu, \"cpu_us_median\": %.1f, \"cpu_us_max\": %.1f, "
                "\"error\": %.2g, \"error_median\": %.2g, \"error_kind\": \"%s\", \"marched\": %d, \"missed\": %d, "
                "\"estimates_over\": %d, \"bounds_broken\": %d, \"hash\": \"%s\"}\n",
                std::string(name).c_str(), kErrors[k], n, line.cpu[n / 2], line.cpu.back(), line.error.back(),
                line.error[n / 2], "largest of force, area, centre", line.march, line.missed, line.unmet,
                line.bound_broken, to_hex(hasher.value()).c_str());
  }
  std::fflush(stdout);
}

Pose random_pose(Draw& draw, const Vec3& position) { return {position, draw.rotation()}; }

}  // namespace

int main(int argc, char** argv) {
  const int poses = argc > 1 ? std::atoi(argv[1]) : 1000;
  const std::string_view only = argc > 2 ? argv[2] : "";
  const auto wanted = [&](std::string_view name) { return only.empty() || only == name; };
  constexpr double kRadius = 0.1, kSpacing = 0.03, kShallow = 1e-3, kDeep = 0.3, kE = 1e6;

  const auto two_spheres = [&](std::string_view name, double rb, double eb) {
    if (!wanted(name)) return;
    Rigid a(linear_sphere(kRadius), kLinearModulus * kE, kSpacing);
    Rigid b(linear_sphere(rb), kLinearModulus * eb, kSpacing * rb / kRadius);
    measure(name, poses, [&](Draw& draw) {
      const Vec3 axis = draw.direction(), centre = draw.uniform(0.0, 1.0) * draw.direction();
      const double D = kRadius + rb - draw.logarithmic(kShallow, kDeep) * std::min(kRadius, rb);
      a.put(random_pose(draw, centre));
      b.put(random_pose(draw, centre + D * axis));
      return Pair{{a.body(), b.body()}, true, spheres(kRadius, kE, rb, eb, D, centre, axis)};
    });
  };
  two_spheres("equal", kRadius, kE);
  two_spheres("radii", 2.0 * kRadius, kE);
  two_spheres("stiffness", kRadius, 3.0 * kE);

  if (wanted("plane")) {
    Rigid ball(linear_sphere(kRadius), kLinearModulus * kE, kSpacing);
    implicit::HalfSpace plane{Vec3::Zero(), Vec3::UnitZ(), 1.0};
    const Pose origin;
    const double k = 100.0 * kE / kRadius;
    measure("plane", poses, [&](Draw& draw) {
      const Vec3 up = draw.direction(), centre = draw.uniform(0.0, 1.0) * draw.direction();
      const double h = kRadius - draw.logarithmic(kShallow, kDeep) * kRadius;
      ball.put(random_pose(draw, centre));
      plane = {centre - h * up, up, 1.0};
      collision::ContactBody ground = single_part(plane, k, origin);
      ground.fixed = true;
      return Pair{{ball.body(), ground}, true, sphere_on_flat(kRadius, kE, k, h, centre, -up)};
    });
  }
  if (wanted("slab")) {
    // The face of a box whose pressure rises linearly over its rounding.
    constexpr double kRounding = 0.1;
    Rigid ball(linear_sphere(kRadius), kLinearModulus * kE, kSpacing);
    Rigid slab(linear_shape(implicit::ShapeKind::Box, Vec3(0.3, 0.3, 0.05), kRounding), kLinearModulus * kE, 2.0 * kSpacing);
    measure("slab", poses, [&](Draw& draw) {
      const Pose pose = random_pose(draw, draw.uniform(0.0, 1.0) * draw.direction());
      slab.put(pose);
      const double h = kRadius - draw.logarithmic(kShallow, kDeep) * kRadius;
      const Vec3 at(draw.uniform(-0.15, 0.15), draw.uniform(-0.15, 0.15), 0.05 + kRounding + h);
      const Vec3 centre = pose.position + pose.orientation * at;
      ball.put(random_pose(draw, centre));
      return Pair{{ball.body(), slab.body()},
                  true,
                  sphere_on_flat(kRadius, kE, kE / kRounding, h, centre, -(pose.orientation * Vec3::UnitZ()))};
    });
  }
  /// Bodies without a closed form: a surface point of B is pressed into one of A, normal against normal.
  const auto pressed = [&](std::string_view name, Rigid& a, Rigid& b, double size) {
    if (!wanted(name)) return;
    measure(name, poses, [&](Draw& draw) {
      const auto point_of = [&](Rigid& body, const Pose& pose) {
        body.put(pose);
        const implicit::SurfaceSamples& samples = *body.body().samples;
        std::size_t i = 0;
        do {
          i = static_cast<std::size_t>(draw.uniform(0.0, 1.0) * static_cast<double>(samples.point.size()));
        } while (samples.valid[i] == 0);
        return std::pair(samples.point[i], samples.normal[i]);
      };
      const auto [x, n] = point_of(a, random_pose(draw, draw.uniform(0.0, 1.0) * draw.direction()));
      const auto [y, m] = point_of(b, {});
      const Quat spin(Eigen::AngleAxisd(draw.uniform(-kPi, kPi), n));
      const Quat turn = (spin * Quat::FromTwoVectors(m, -n)).normalized();
      b.put({x - draw.logarithmic(0.01, kDeep) * size * n - turn * y, turn});
      return Pair{{a.body(), b.body()}, false, {}};
    });
  };
  {
    Rigid a(wyvill_shape(implicit::ShapeKind::Ellipsoid, Vec3(0.2, 0.3, 0.25), 0.2), kE, kSpacing);
    Rigid b(wyvill_shape(implicit::ShapeKind::Ellipsoid, Vec3(0.25, 0.2, 0.2), 0.2), 2.0 * kE, kSpacing);
    pressed("ellipsoids", a, b, 0.1);
  }
  {
    Rigid ball(wyvill_shape(implicit::ShapeKind::Point, Vec3::Zero(), 0.22), kE, kSpacing);
    Rigid plate(wyvill_shape(implicit::ShapeKind::Rectangle, Vec3(0.15, 0.15, 0.0), 0.15), kE, kSpacing);
    pressed("plate", ball, plate, 0.07);
  }
  {
    Rigid a(ten_blobs(1), kE, kSpacing), b(ten_blobs(2), 2.0 * kE, kSpacing);
    pressed("ten_blobs", a, b, 0.05);
  }
  return 0;
}
