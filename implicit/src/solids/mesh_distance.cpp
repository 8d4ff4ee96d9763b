#include "solids/mesh_distance.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

#include "supple/core/interrupt.h"

namespace supple::implicit {
namespace {

constexpr double kCellsAlong = 128.0;  // the longest side
constexpr double kMargin = 8.0;       // cells around the mesh: the band and the stencil of the spline
constexpr double kPoor = 0.75;        // cells that the spline may be off near the surface
constexpr double kNear = 2.0;         // cells from the surface
constexpr double kThin = 1.5;         // cells: of plates and gaps below it little is left
constexpr double kMostPlaces = 1e6;   // that are tested on the surface
constexpr std::size_t kBlock = 8;     // nodes along each side that one distance may prove to be far from the surface
constexpr std::size_t kSmallest = 2;  // of such blocks
constexpr float kUnknown = std::numeric_limits<float>::lowest();  // not yet asked for

/// Weights of the uniform cubic B-spline at t in [0, 1] for the nodes -1 .. 2, and their slopes.
struct Weights {
  std::array<double, 4> value, slope;
  explicit Weights(double t) {
    const double s = 1.0 - t;
    value = {s * s * s / 6.0, (3.0 * t * t * (t - 2.0) + 4.0) / 6.0, (3.0 * s * s * (s - 2.0) + 4.0) / 6.0, t * t * t / 6.0};
    slope = {-0.5 * s * s, 0.5 * t * (3.0 * t - 4.0), -0.5 * s * (3.0 * s - 4.0), 0.5 * t * t};
  }
};

}  // namespace

/// A cell of the lattice and where in it a point lies; of those outside the nearest one.
struct MeshDistance::Place {
  std::array<std::size_t, 3> cell{};
  std::array<double, 3> t{};
  std::array<bool, 3> beyond{};
};

MeshDistance::MeshDistance(ClosedSurface surface) : exact_(std::move(surface)) {
  cell_ = exact_.box().extent().maxCoeff() / kCellsAlong;
  lay_lattice();
  find_poor_cells();
  double area = 0.0;
  const ClosedSurface& faces = exact_.surface();
  for (const auto& t : faces.triangle) {
    area += 0.5 * (faces.position[t[1]] - faces.position[t[0]]).cross(faces.position[t[2]] - faces.position[t[0]]).norm();
  }
  const auto places = static_cast<std::size_t>(std::min(std::ceil(area / (cell_ * cell_)), kMostPlaces));
  find_thin_cells(places);
  sort_cells();
  const auto look = [&](const Vec3& x) { deviation_ = std::max(deviation_, std::abs(at(x, nullptr))); };
  exact_.each_place(places, [&](const Vec3& x, const Vec3&) { look(x); });
  for (const Vec3& x : faces.position) look(x);
}

Vec3 MeshDistance::place_of(std::size_t i, std::size_t j, std::size_t k) const {
  return corner_ + cell_ * Vec3(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k));
}

void MeshDistance::lay_lattice() {
  corner_ = exact_.box().lower - Vec3::Constant(kMargin * cell_);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    size_[axis] = static_cast<std::size_t>(std::ceil(exact_.box().extent()[static_cast<Eigen::Index>(axis)] / cell_) + 2.0 * kMargin + 1.0);
  }
  unit_ = std::ldexp(1.0, std::ilogb(cell_));
  distance_.assign(size_[0] * size_[1] * size_[2], kUnknown);
  weight_.assign(distance_.size(), 0);
  part_.assign(distance_.size(), Part::Spline);
  known_.assign(distance_.size(), 0);
  for (std::size_t k = 0; k < size_[2]; k += kBlock) {
    for (std::size_t j = 0; j < size_[1]; j += kBlock) {
      heed_scope();
      for (std::size_t i = 0; i < size_[0]; i += kBlock) search(i, j, k, kBlock);
    }
  }
}

/// Finds the nodes of a block that are near the surface, and those beyond the band. @param side  in nodes
void MeshDistance::search(std::size_t i, std::size_t j, std::size_t k, std::size_t side) {
  if (i >= size_[0] || j >= size_[1] || k >= size_[2]) return;
  const double half = 0.5 * static_cast<double>(side - 1);
  const double middle = exact_.at(place_of(i, j, k) + Vec3::Constant(half * cell_), nullptr) / cell_, reach = std::sqrt(3.0) * half;
  const bool beyond = middle > kBand + reach;
  if (!beyond && std::abs(middle) > kNear + reach) return;
  if (!beyond && side > kSmallest) {
    const std::size_t part = side / 2;
    for (std::size_t n = 0; n < 8; ++n) search(i + (n & 1) * part, j + (n >> 1 & 1) * part, k + (n >> 2) * part, part);
    return;
  }
  for (std::size_t c = k; c < std::min(k + side, size_[2]); ++c) {
    for (std::size_t b = j; b < std::min(j + side, size_[1]); ++b) {
      for (std::size_t a = i; a < std::min(i + side, size_[0]); ++a) {
        if (beyond) distance_[node(a, b, c)] = static_cast<float>(kBand * cell_ / unit_);
        else find(a, b, c);
      }
    }
  }
}

/// The distance at a node, unless it is known. Threads may find it at the same time: one of them keeps it, and nothing writes there any more.
void MeshDistance::find(std::size_t i, std::size_t j, std::size_t k) const {
  const std::atomic_ref<float> kept(distance_[node(i, j, k)]);
  float before = kept.load(std::memory_order_acquire);
  if (before != kUnknown) return;
  kept.compare_exchange_strong(before, static_cast<float>(std::min(exact_.at(place_of(i, j, k), nullptr), kBand * cell_) / unit_), std::memory_order_acq_rel);
}

/// The distances that the spline in a cell takes.
void MeshDistance::find_around(const Place& place) const {
  const std::atomic_ref<std::uint8_t> known(known_[node(place.cell[0], place.cell[1], place.cell[2])]);
  if (known.load(std::memory_order_acquire) != 0) return;
  for (std::size_t c = 0; c < 4; ++c) {
    for (std::size_t b = 0; b < 4; ++b) {
      for (std::size_t a = 0; a < 4; ++a) find(place.cell[0] + a - 1, place.cell[1] + b - 1, place.cell[2] + c - 1);
    }
  }
  known.store(1, std::memory_order_release);
}

MeshDistance::Place MeshDistance::cell_at(const Vec3& x) const {
  Place place;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double last = static_cast<double>(size_[axis]) - 3.0;
    const double u = (x[static_cast<Eigen::Index>(axis)] - corner_[static_cast<Eigen::Index>(axis)]) / cell_;
    const double inside = std::clamp(u, 1.0, last);
    place.beyond[axis] = inside != u;
    const double cell = std::min(std::floor(inside), last - 1.0);
    place.cell[axis] = static_cast<std::size_t>(cell);
    place.t[axis] = inside - cell;
  }
  return place;
}

template <class Number>
double MeshDistance::spline(const std::vector<Number>& coefficient, const Place& place, Vec3* slope) const {
  const Weights x(place.t[0]), y(place.t[1]), z(place.t[2]);
  const double unit = std::is_same_v<Number, float> ? unit_ : 1.0;  // of distances
  double value = 0.0;
  Vec3 sum = Vec3::Zero();
  for (std::size_t c = 0; c < 4; ++c) {
    for (std::size_t b = 0; b < 4; ++b) {
      const Number* row = &coefficient[node(place.cell[0] - 1, place.cell[1] + b - 1, place.cell[2] + c - 1)];
      double line = 0.0, along = 0.0;
      for (std::size_t a = 0; a < 4; ++a) {
        line += x.value[a] * static_cast<double>(row[a]);
        along += x.slope[a] * static_cast<double>(row[a]);
      }
      const double weight = y.value[b] * z.value[c];
      value += weight * line;
      sum += Vec3(weight * along, y.slope[b] * z.value[c] * line, y.value[b] * z.slope[c] * line);
    }
  }
  if (slope != nullptr) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (place.beyond[axis]) sum[static_cast<Eigen::Index>(axis)] = 0.0;
    }
    *slope = sum / (cell_ / unit);
  }
  return value * unit;
}

double MeshDistance::smoothed(const Place& place, Vec3* slope) const {
  find_around(place);
  return spline(distance_, place, slope);
}

double MeshDistance::at(const Vec3& x, Vec3* slope) const {
  const Place place = cell_at(x);
  const Part part = part_[node(place.cell[0], place.cell[1], place.cell[2])];
  if (part == Part::Exact) return exact_.at(x, slope);
  const double smooth = smoothed(place, slope);
  if (part == Part::Spline) return smooth;
  Vec3 exact_slope, rise;
  const double exact = exact_.at(x, slope != nullptr ? &exact_slope : nullptr), weight = spline(weight_, place, slope != nullptr ? &rise : nullptr);
  if (slope != nullptr) *slope = (1.0 - weight) * *slope + weight * exact_slope + (exact - smooth) * rise;
  return (1.0 - weight) * smooth + weight * exact;
}

/// Neighbouring nodes differ by at most a cell, so each partial derivative of the spline is at most 1, and that of the weight 1 over a cell. Spline and exact
/// distance differ by a cell at most: as weights of the nodes have that mean square distance from the point.
double MeshDistance::steepest(const Box& box) const {
  const bool both = !exact_box_.empty() && box.overlaps(exact_box_);
  return (both ? 2.0 : 1.0) * std::sqrt(3.0) * (1.0 + 1e-4);
}

/// Where the spline is off near the surface: at nodes, in the middles of cells, and at the vertices of the mesh.
void MeshDistance::find_poor_cells() {
  for (const Vec3& x : exact_.surface().position) {
    if (std::abs(smoothed(cell_at(x), nullptr)) > kPoor * cell_) keep_exact(x, 0);
  }
  for (std::size_t k = 1; k + 2 < size_[2]; ++k) {
    for (std::size_t j = 1; j + 2 < size_[1]; ++j) {
      heed_scope();
      for (std::size_t i = 1; i + 2 < size_[0]; ++i) {
        const double here = static_cast<double>(distance_[node(i, j, k)]) * unit_;
        if (std::abs(here) > kNear * cell_) continue;  // also where it is not known
        const Vec3 at = place_of(i, j, k), middle = at + Vec3::Constant(0.5 * cell_);
        if (std::abs(smoothed(cell_at(at), nullptr) - here) > kPoor * cell_) keep_exact(at, 1);
        if (may_be_poor(cell_at(middle)) && std::abs(smoothed(cell_at(middle), nullptr) - exact_.at(middle, nullptr)) > kPoor * cell_) keep_exact(middle, 0);
      }
    }
  }
}

/// Whether the spline in the middle of a cell may be off: the exact distance there differs from that of each corner by half a diagonal at most.
bool MeshDistance::may_be_poor(const Place& middle) const {
  constexpr double kSure = 1.0 - 1e-4;  // more than single precision loses
  const double value = smoothed(middle, nullptr), half = 0.5 * std::sqrt(3.0) * cell_;
  double least = kBand * cell_, most = -std::numeric_limits<double>::infinity();
  for (std::size_t n = 0; n < 8; ++n) {
    const double corner = unit_ * static_cast<double>(distance_[node(middle.cell[0] + (n & 1), middle.cell[1] + (n >> 1 & 1), middle.cell[2] + (n >> 2))]);
    least = std::min(least, corner);
    most = std::max(most, corner);
  }
  return std::max(least + half - value, value - most + half) > kPoor * kSure * cell_;
}

/// Where the solid or a gap is thin, and where the spline is off on the surface.
void MeshDistance::find_thin_cells(std::size_t places) {
  exact_.each_place(places, [&](const Vec3& x, const Vec3& normal) {
    const double largest = 0.5 * kThin * cell_;
    if (std::abs(smoothed(cell_at(x), nullptr)) > kPoor * cell_) keep_exact(x, 0);
    if (std::min(exact_.opposite_ball(x, normal, largest), exact_.opposite_ball(x, -normal, largest)) < largest) keep_exact(x, 1);
  });
}

/// The exact distance counts alone in the cell of x, and in those around it. @param beyond  how many cells around
void MeshDistance::keep_exact(const Vec3& x, int beyond) {
  const Place place = cell_at(x);
  const auto more = static_cast<std::size_t>(beyond);
  const auto low = [&](std::size_t axis) { return place.cell[axis] - std::min(place.cell[axis], 1 + more); };
  const auto high = [&](std::size_t axis) { return std::min(place.cell[axis] + 2 + more, size_[axis] - 1); };
  for (std::size_t c = low(2); c <= high(2); ++c) {
    for (std::size_t b = low(1); b <= high(1); ++b) {
      std::fill_n(weight_.begin() + static_cast<std::ptrdiff_t>(node(low(0), b, c)), high(0) - low(0) + 1, std::uint8_t{1});
    }
  }
}

void MeshDistance::sort_cells() {
  for (std::size_t k = 1; k + 2 < size_[2]; ++k) {
    for (std::size_t j = 1; j + 2 < size_[1]; ++j) {
      for (std::size_t i = 1; i + 2 < size_[0]; ++i) {
        int sum = 0;
        for (std::size_t c = k - 1; c <= k + 2; ++c) {
          for (std::size_t b = j - 1; b <= j + 2; ++b) {
            for (std::size_t a = i - 1; a <= i + 2; ++a) sum += weight_[node(a, b, c)];
          }
        }
        if (sum == 0) continue;
        part_[node(i, j, k)] = sum == 64 ? Part::Exact : Part::Both;
        exact_box_.include(place_of(i, j, k));
        exact_box_.include(place_of(i + 1, j + 1, k + 1));
      }
    }
  }
}

}  // namespace supple::implicit
