/// Stars: panels in angle and radius about a point that sees the rim of a patch, cut where third bodies press harder.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "../../collision/src/surface/panels/plane_chart.h"
#include "benchmarks/contact_shapes.h"
#include "collision/bodies.h"

namespace supple::collision {
namespace {

/// A star that reaches 1 + 0.3 cos 2t + 0.1 sin 3t over half axes of 2 and 0.5.
PlaneChart star() {
  std::vector<double> reach;
  for (int k = 0; k < 64; ++k) {
    const double t = 2.0 * std::numbers::pi * k / 64.0;
    reach.push_back(1.0 + 0.3 * std::cos(2.0 * t) + 0.1 * std::sin(3.0 * t));
  }
  return {{2.0, 0.5}, PlaneChart::waves_of(reach)};
}

TEST(PlaneChart, HasTheDerivativesOfItsPlacesAndFindsThemAgain) {
  const PlaneChart chart = star();
  constexpr double kStep = 1e-6;
  for (const double angle : {0.1, 1.3, 2.9, 4.0, 6.1}) {
    for (const double share : {0.05, 0.5, 0.95}) {
      const PlaneChart::Place place{angle, share}, at = chart.at(place), back = chart.place_of(at);
      EXPECT_NEAR(back[0], angle, 1e-12);
      EXPECT_NEAR(back[1], share, 1e-12);
      // Rows of the Jacobian are what the slopes (1, 0) and (0, 1) over the plane become.
      const PlaneChart::Place u = chart.slopes(place, {1.0, 0.0}), v = chart.slopes(place, {0.0, 1.0});
      for (const std::size_t k : {0u, 1u}) {
        PlaneChart::Place more = place, less = place;
        more[k] += kStep;
        less[k] -= kStep;
        const PlaneChart::Place to = chart.at(more), from = chart.at(less);
        EXPECT_NEAR(u[k], (to[0] - from[0]) / (2.0 * kStep), 1e-8);
        EXPECT_NEAR(v[k], (to[1] - from[1]) / (2.0 * kStep), 1e-8);
      }
      EXPECT_NEAR(chart.stretch(place), std::abs(u[0] * v[1] - u[1] * v[0]), 1e-12);
    }
  }
}

TEST(PlaneChart, OfAStarReachesEverywhere) {
  // A spike eight times as long as the rest: the sum of waves stays positive.
  std::vector<double> reach(64, 1.0);
  reach[10] = 8.0;
  const PlaneChart chart{{1.0, 1.0}, PlaneChart::waves_of(reach)};
  for (int k = 0; k < 200; ++k) EXPECT_GT(chart.stretch({2.0 * std::numbers::pi * k / 200.0, 1.0}), 0.0) << k;
}

std::vector<ContactSurface::Summary> query(std::span<const ContactBody> bodies, double error) {
  const Executor executor(1);
  ContactCandidates candidates;
  ContactSurface surface;
  find_contacts(bodies, broad_phase(bodies, {}, executor), executor, candidates);
  solve_contact_surface(bodies, candidates, {.error = error}, executor, surface);
  return surface.summary;
}

/// The force on each body by the volumes that it loses: the integral of the slope of its pressure where another one is larger (Gauss), and the sum of its
/// size; and the energy, of all pressures but the largest. Midpoints of cells.
struct Volumes {
  std::array<Vec3, 3> force{Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};
  std::array<double, 3> load{};
  double energy = 0.0;
};
Volumes volumes_of(std::span<const ContactBody> bodies, int cells) {
  Box box;
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      const Box common = bodies[a].field.surface_box().intersection(bodies[b].field.surface_box());
      if (!common.empty()) box = box.united(common);
    }
  }
  const Vec3 cell = box.extent() / cells;
  Volumes sum;
  std::vector<Vec3> row(static_cast<std::size_t>(cells));
  std::array<std::vector<double>, 3> value;
  std::array<std::vector<Vec3>, 3> slope;
  for (int k = 0; k < cells; ++k) {
    for (int j = 0; j < cells; ++j) {
      for (int i = 0; i < cells; ++i) row[static_cast<std::size_t>(i)] = box.lower + cell.cwiseProduct(Vec3(i + 0.5, j + 0.5, k + 0.5));
      for (std::size_t b = 0; b < 3; ++b) {
        value[b].resize(row.size());
        slope[b].resize(row.size());
        bodies[b].field.evaluate(row, value[b], slope[b]);
      }
      for (std::size_t i = 0; i < row.size(); ++i) {
        std::array<double, 3> p{};
        for (std::size_t b = 0; b < 3; ++b) p[b] = bodies[b].material.modulus * value[b][i];
        const double largest = *std::max_element(p.begin(), p.end());
        for (std::size_t b = 0; b < 3; ++b) {
          if (!(p[b] > 0.0) || !(p[b] < largest)) continue;
          const Vec3 push = (bodies[b].material.modulus * cell.prod()) * slope[b][i];
          sum.force[b] += push;
          sum.load[b] += push.norm();
          sum.energy += p[b] * cell.prod();
        }
      }
    }
  }
  return sum;
}

TEST(Star, OfRandomTriplesHasTheForcesAndTheEnergyOfTheVolumesThatTheyLose) {
  constexpr int kTriples = 14, kCells = 96;
  constexpr double kOfCells = 6e-3;  // of the loads: about n^-1.5 at the borders of the volumes, times a few
  std::mt19937 draw(20240611);
  const auto part = [&draw] { return std::ldexp(static_cast<double>(draw()), -32); };
  int cut = 0;
  for (int n = 0; n < kTriples; ++n) {
    std::vector<benchmarks::Rigid> rigid;
    rigid.reserve(3);
    std::vector<ContactBody> bodies;
    for (int b = 0; b < 3; ++b) {
      const double support = 0.3 + 0.3 * part();
      const Vec3 half(b == 1 ? 0.1 + 0.2 * part() : 0.0, 0.0, 0.0);
      rigid.emplace_back(benchmarks::wyvill_shape(b == 1 ? implicit::ShapeKind::Segment : implicit::ShapeKind::Point, half, support), 1.0 + 3.0 * part(), 0.05);
      const Vec3 axis(part() - 0.5, part() - 0.5, part() - 0.5);
      const Vec3 at = 0.4 * Vec3(part() - 0.5, part() - 0.5, part() - 0.5);
      rigid.back().put({at, Quat(Eigen::AngleAxisd(2.0 * part(), axis.normalized()))});
    }
    for (const benchmarks::Rigid& body : rigid) bodies.push_back(body.body());
    const Volumes exact = volumes_of(bodies, kCells), rough = volumes_of(bodies, kCells / 2);
    for (const double error : {1e-2, 1e-3}) {
      std::array<Vec3, 3> force{Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};
      std::array<double, 3> off{};
      double energy = 0.0;
      const std::vector<ContactSurface::Summary> pairs = query(bodies, error);
      for (const ContactSurface::Summary& s : pairs) {
        EXPECT_LE(s.error_estimate, 1.01 * error) << n;
        force[s.bodies.a] += s.force;
        force[s.bodies.b] -= s.force;
        for (const std::uint32_t b : {s.bodies.a, s.bodies.b}) off[b] += s.error_estimate * std::max(s.force.norm(), 1e-3 * s.load);
        energy += s.energy;
      }
      cut += pairs.size() == 3 ? 1 : 0;
      for (std::size_t b = 0; b < 3; ++b) {
        EXPECT_LE((force[b] - exact.force[b]).norm(), off[b] + kOfCells * exact.load[b] + (exact.force[b] - rough.force[b]).norm()) << n << ' ' << b << ' ' << error;
      }
      EXPECT_NEAR(energy, exact.energy, (error + kOfCells) * exact.energy) << n << ' ' << error;
    }
  }
  EXPECT_GE(cut, kTriples);
}

}  // namespace
}  // namespace supple::collision
