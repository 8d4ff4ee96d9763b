#include "supple/collision/approach.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "pairs/boxes.h"
#include "response/energy_loads.h"
#include "supple/core/error.h"
#include "surface/region/energy_columns.h"

namespace supple::collision {
namespace {

/// One body at a point where it is pushed along a normal.
struct Handle {
  const ContactBody* body = nullptr;
  const PartMobility* mobility = nullptr;  // null: impulses are none of its business
  implicit::FieldParts row;
  Vec3 point = Vec3::Zero(), normal = Vec3::Zero();

  void take(const ContactBody& b, const Vec3& x, const Vec3& n, const PartMobility* m = nullptr) {
    body = &b;
    mobility = m;
    point = x;
    normal = n;
    contributions_at(b, {&point, 1}, row);
  }
  /// Speed of the point along the normal, by contributions, with what impulses have added so far.
  [[nodiscard]] double speed(const PartLoads* added) const {
    Vec3 sum = Vec3::Zero();
    for (std::size_t e = 0; e < row.part.size(); ++e) {
      const std::size_t k = row.part[e];
      const Vec3 arm = point - body->pose[k].position;
      if (!body->velocity.empty()) sum += row.value[e] * body->velocity[k];
      if (!body->angular_velocity.empty()) sum += row.value[e] * body->angular_velocity[k].cross(arm);
      if (added == nullptr || mobility->inverse_mass.empty()) continue;
      sum += row.value[e] * mobility->inverse_mass[k].cwiseProduct(added->force[k]);
      sum += row.value[e] * (mobility->inverse_inertia[k] * added->torque[k]).cross(arm);
    }
    return sum.dot(normal);
  }
  /// Change of that speed by a unit impulse along the normal that is shared out by contributions.
  [[nodiscard]] double inverse_mass() const {
    if (mobility->inverse_mass.empty()) return 0.0;
    double sum = 0.0;
    for (std::size_t e = 0; e < row.part.size(); ++e) {
      const std::size_t k = row.part[e];
      const Vec3 lever = (point - body->pose[k].position).cross(normal);
      sum += row.value[e] * row.value[e] *
             (normal.dot(mobility->inverse_mass[k].cwiseProduct(normal)) + lever.dot(mobility->inverse_inertia[k] * lever));
    }
    return sum;
  }
  void push(double impulse, PartLoads& loads) const {
    for (std::size_t e = 0; e < row.part.size(); ++e) {
      const std::size_t k = row.part[e];
      const Vec3 j = (impulse * row.value[e]) * normal;
      loads.force[k] += j;
      loads.torque[k] += (point - body->pose[k].position).cross(j);
    }
  }
};

/// The box in which both bodies, A moved by `shift`, may have pressure.
Box overlap_of(const ContactBody& a, const ContactBody& b, const Vec3& shift) {
  const Box box = a.field.surface_box();
  return Box{box.lower + shift, box.upper + shift}.intersection(b.field.surface_box());
}

/// Midpoint sum over cells, and how wide the cells' part with pressure is.
struct CellSum {
  double energy = 0.0;            // [J]
  int positive = 0;               // cells with pressure of both
  std::array<int, 3> runs{};      // of such cells, along each axis
  /// Whether rows of cells with pressure are long enough to be seen as they are. @param cells  along each axis
  [[nodiscard]] bool resolved(int cells) const {
    constexpr double kLeast = 3.0, kShare = 0.2;  // cells, on average; of the row
    return positive >= std::max(kLeast, kShare * cells) * *std::max_element(runs.begin(), runs.end());
  }
};

CellSum energy_of_cells(const ContactBody& a, const ContactBody& b, const Vec3& shift, const Box& box, int cells) {
  const Vec3 cell = box.extent() / cells;
  thread_local std::vector<Vec3> point, moved;
  thread_local std::vector<double> of_a, of_b;
  thread_local std::vector<char> below, here;
  const auto n = static_cast<std::size_t>(cells) * static_cast<std::size_t>(cells);
  point.resize(n);
  moved.resize(n);
  of_a.resize(n);
  of_b.resize(n);
  below.assign(n, 0);
  here.resize(n);
  CellSum sum;
  for (int k = 0; k < cells; ++k) {
    for (int j = 0; j < cells; ++j) {
      for (int i = 0; i < cells; ++i) {
        const auto at = static_cast<std::size_t>(j * cells + i);
        point[at] = box.lower + cell.cwiseProduct(Vec3(i + 0.5, j + 0.5, k + 0.5));
        moved[at] = point[at] - shift;
      }
    }
    a.field.evaluate(moved, of_a);
    b.field.evaluate(point, of_b);
    for (std::size_t at = 0; at < n; ++at) {
      const double least = std::min(a.material.modulus * of_a[at], b.material.modulus * of_b[at]);
      sum.energy += std::max(0.0, least);
      here[at] = least > 0.0 ? 1 : 0;
      if (here[at] == 0) continue;
      const std::size_t row = at % static_cast<std::size_t>(cells);
      sum.positive += 1;
      sum.runs[0] += row > 0 && here[at - 1] != 0 ? 0 : 1;
      sum.runs[1] += at >= static_cast<std::size_t>(cells) && here[at - static_cast<std::size_t>(cells)] != 0 ? 0 : 1;
      sum.runs[2] += below[at] != 0 ? 0 : 1;
    }
    below.swap(here);
  }
  sum.energy *= cell.prod();
  return sum;
}

/// Whether a body's `feature_size` holds for all of it: that of a mesh may leave out a small part of its surface.
bool says_how_thin(const ContactBody& body) { return body.field.as_field() != nullptr || body.field.convex(); }

bool is_thicker(const ContactBody& a, const ContactBody& b, const Vec3& cell) {
  return std::min(a.field.feature_size(), b.field.feature_size()) > cell.maxCoeff();
}

/// Extent of a box along a direction, by its support.
double reach_of(const Box& box, const Vec3& d) {
  double sum = 0.0;
  for (Eigen::Index k = 0; k < 3; ++k) {
    if (d[k] != 0.0) sum += d[k] > 0.0 ? d[k] * box.upper[k] : d[k] * box.lower[k];
  }
  return sum;
}

/// Contact energies with A, which is bounded, moved along a direction until it is through B.
class WayThrough {
 public:
  WayThrough(const ContactBody& a, const ContactBody& b, const Vec3& direction, int cells)
      : a_(a), b_(b), direction_(direction), cells_(cells), certain_(says_how_thin(a) && says_how_thin(b)) {
    const Box of_a = a.field.surface_box(), of_b = b.field.surface_box();
    const double front = reach_of(of_a, direction), back = -reach_of(of_a, -direction);
    const double near = -reach_of(of_b, -direction), far = reach_of(of_b, direction);
    // From where A's front meets the near side of B to where its back has left it.
    first_ = std::isfinite(near) ? near - front : 0.0;
    bounded_ = std::isfinite(far);
    last_ = bounded_ ? far - back : first_ + front - back;
  }

  /// Energy halfway through B, or as deep in an unbounded one as A is long: near the largest of bodies of simple shape.
  [[nodiscard]] double probe() const { return energy_at(bounded_ ? 0.5 * (first_ + last_) : last_); }

  /// Finds the end of the way, and the steps of the scan.
  void measure() {
    if (!bounded_) last_ = end_of_growth(last_ - first_);
    constexpr int kScan = 12, kMostScan = 48;
    const double thin = a_.field.feature_size() + b_.field.feature_size(), wanted = std::ceil(2.0 * (last_ - first_) / thin);
    const int scan = certain_ || !(wanted > kScan) ? kScan : static_cast<int>(std::min<double>(wanted, kMostScan));
    steps_ = scan;
    step_ = (last_ - first_) / scan;
  }

  /// Whether both bodies tell how thin they are.
  [[nodiscard]] bool certain() const { return certain_; }

  /// The shift with the largest energy of a regular scan; around where the bodies are, of a finer one if they may be thin there.
  [[nodiscard]] double scan() const {
    double best = 0.0, at = first_;
    const auto look = [&](double shift) {
      const double energy = energy_at(shift);
      if (!(energy > best)) return;
      best = energy;
      at = shift;
    };
    for (int i = 0; i <= steps_; ++i) look(first_ + i * step_);
    constexpr int kHalvings = 6;
    for (int k = 1; k <= kHalvings && !certain_; ++k) look(std::ldexp(step_, -k));
    return at;
  }

  /// Golden section between the neighbours of a shift. @return the shift with the larger energy of the last two
  [[nodiscard]] double narrow(double at) const {
    double low = std::max(first_, at - step_), high = std::min(last_, at + step_);
    constexpr double kGolden = 0.3819660112501051;
    double left = low + kGolden * (high - low), right = high - kGolden * (high - low);
    double at_left = energy_at(left), at_right = energy_at(right);
    constexpr int kNarrowings = 10;
    for (int i = 0; i < kNarrowings; ++i) {
      if (at_left > at_right) {
        high = right;
        right = left;
        at_right = at_left;
        left = low + kGolden * (high - low);
        at_left = energy_at(left);
      } else {
        low = left;
        left = right;
        at_left = at_right;
        right = high - kGolden * (high - low);
        at_right = energy_at(right);
      }
    }
    return at_left > at_right ? left : right;
  }

 private:
  [[nodiscard]] double energy_at(double shift) const { return shifted_energy(a_, b_, shift * direction_, direction_, cells_); }

  /// An unbounded B presses the harder the deeper A is: until all of A's pressure is gone. @param way  first depth
  [[nodiscard]] double end_of_growth(double way) const {
    constexpr int kDoublings = 20;
    constexpr double kGrows = 1.01;
    double energy = energy_at(first_ + way);
    for (int i = 0; i < kDoublings; ++i) {
      const double deeper = energy_at(first_ + 2.0 * way);
      if (!(deeper > kGrows * energy)) break;
      energy = deeper;
      way *= 2.0;
    }
    return first_ + 2.0 * way;
  }

  const ContactBody &a_, &b_;
  Vec3 direction_;
  int cells_;
  bool certain_, bounded_ = true;
  double first_ = 0.0, last_ = 0.0, step_ = 0.0;
  int steps_ = 0;
};

}  // namespace

Approach measure_approach(std::span<const ContactBody> bodies, const ContactSurface::Summary& summary) {
  Approach approach;
  approach.point = summary.centre_of_pressure;
  approach.normal = -summary.force.normalized();
  thread_local Handle a, b;
  a.take(bodies[summary.bodies.a], approach.point, approach.normal);
  b.take(bodies[summary.bodies.b], approach.point, approach.normal);
  approach.speed = a.speed(nullptr) - b.speed(nullptr);
  return approach;
}

double approach_inverse_mass(std::span<const ContactBody> bodies, std::span<const PartMobility> mobility,
                             const ContactSurface::Summary& summary) {
  const Vec3 normal = -summary.force.normalized();
  double sum = 0.0;
  thread_local Handle handle;
  for (const std::uint32_t body : {summary.bodies.a, summary.bodies.b}) {
    handle.take(bodies[body], summary.centre_of_pressure, normal, &mobility[body]);
    sum += handle.inverse_mass();
  }
  return sum;
}

double shifted_energy(const ContactBody& a, const ContactBody& b, const Vec3& shift, const Vec3& along, int cells) {
  SUPPLE_EXPECTS(cells > 0);
  const Box box = overlap_of(a, b, shift);
  if (box.empty() || !is_finite(box) || !(box.extent().prod() > 0.0)) return 0.0;
  const CellSum sum = energy_of_cells(a, b, shift, box, cells);
  const bool certain = says_how_thin(a) && says_how_thin(b);
  if (sum.positive > 0 ? sum.resolved(cells) : certain && is_thicker(a, b, box.extent() / cells)) return sum.energy;
  const int most = cells * cells;
  return column_energy({.a = &a, .b = &b, .shift = shift, .box = box}, along, most);
}

double contact_capacity(const ContactBody& a, const ContactBody& b, const Vec3& direction, int cells, double enough) {
  if (!is_finite(a.field.surface_box())) {
    SUPPLE_EXPECTS(is_finite(b.field.surface_box()));
    return contact_capacity(b, a, -direction, cells, enough);
  }
  WayThrough way(a, b, direction, std::max(8, cells / 2));
  if (std::isfinite(enough)) {
    const double on_the_way = way.probe();
    if (on_the_way > enough) return on_the_way;
  }
  way.measure();
  const double at = way.scan();
  const double middle = way.narrow(at);
  const double most = std::max(shifted_energy(a, b, middle * direction, direction, cells), shifted_energy(a, b, at * direction, direction, cells));
  return way.certain() ? most : std::max(most, shifted_energy(a, b, Vec3::Zero(), direction, cells));
}

double core_pressure(const ContactBody& a, const ContactBody& b) {
  return kCoreShare * std::min(a.material.modulus * a.core_value, b.material.modulus * b.core_value);
}

CoreImpulses hold_cores(std::span<const ContactBody> bodies, std::span<const PartMobility> mobility,
                        const ContactSurface& surface, std::span<PartLoads> impulses) {
  SUPPLE_EXPECTS(mobility.size() == bodies.size() && impulses.size() == bodies.size());
  struct Pair {
    BodyPair bodies;
    Handle a, b;
    double inverse_mass;
    bool pushed = false;
  };
  CoreImpulses report;
  std::vector<Pair> pairs;
  for (const ContactSurface::Summary& s : surface.summary) {
    const ContactBody &a = bodies[s.bodies.a], &b = bodies[s.bodies.b];
    if (!(s.largest_pressure > core_pressure(a, b)) || !(s.force.norm() > 0.0)) continue;
    const Vec3 normal = -s.force.normalized();
    Pair pair{.bodies = s.bodies, .a = {}, .b = {}, .inverse_mass = 0.0};
    pair.a.take(a, s.centre_of_pressure, normal, &mobility[s.bodies.a]);
    pair.b.take(b, s.centre_of_pressure, normal, &mobility[s.bodies.b]);
    pair.inverse_mass = pair.a.inverse_mass() + pair.b.inverse_mass();
    if (pair.inverse_mass > 0.0) pairs.push_back(std::move(pair));
  }
  constexpr int kElasticSweeps = 100, kSweeps = 200;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    bool any = false;
    for (Pair& p : pairs) {
      PartLoads &on_a = impulses[p.bodies.a], &on_b = impulses[p.bodies.b];
      const double speed = p.a.speed(&on_a) - p.b.speed(&on_b);
      // What an inelastic sweep leaves is round-off of the speeds.
      if (!(speed > 1e-12 * (std::abs(p.a.speed(&on_a)) + std::abs(p.b.speed(&on_b))))) continue;
      any = true;
      p.pushed = true;
      const double impulse = (sweep < kElasticSweeps ? 2.0 : 1.0) * speed / p.inverse_mass;
      p.a.push(-impulse, on_a);
      p.b.push(impulse, on_b);
    }
    if (!any) break;
    report.settled = sweep + 1 < kSweeps;
  }
  for (const Pair& p : pairs) report.turned += p.pushed ? 1 : 0;
  return report;
}

}  // namespace supple::collision
