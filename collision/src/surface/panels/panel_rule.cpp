#include "surface/panels/panel_rule.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "numbers.h"
#include "supple/core/math.h"
#include "surface/accuracy.h"

namespace supple::collision {
namespace {

/// Share of what two orders of a flux differ by: the finer one is off by less, and energies have estimates of their own.
constexpr double kOfFlux = 0.25;

constexpr std::size_t kMostPanels = 4096, kMostOfStar = 512;
constexpr int kMostDepth = 24;

/// What panels are held to: force, area, and first moment of the load about its centre.
struct Errors {
  Vec3 force = Vec3::Zero(), first = Vec3::Zero();
  double energy = 0.0, energy_square = 0.0, area = 0.0, force_square = 0.0, first_square = 0.0, area_square = 0.0, missed_load = 0.0, missed_area = 0.0;
};

double least_cosine(std::span<const Vec3> normals, const Vec3& axis) {
  double least = 1.0;
  for (const Vec3& n : normals) least = std::min(least, n.dot(axis));
  return least;
}

/// The axis from which all normals are seen best: their mean, or, where some lie far from it, near the axis of the narrowest cone around them, by steps
/// towards the farthest one that become shorter (Badoiu and Clarkson 2003).
Vec3 best_axis(std::span<const Vec3> normals, const Vec3& sum) {
  constexpr double kSeenWell = 0.7;
  constexpr int kSteps = 64;
  Vec3 axis = sum.norm() > 0.0 ? Vec3(sum.normalized()) : normals.front();
  Vec3 best = axis;
  double seen = least_cosine(normals, axis);
  for (int step = 1; step <= kSteps && seen < kSeenWell; ++step) {
    const Vec3& farthest = *std::min_element(normals.begin(), normals.end(), [&](const Vec3& p, const Vec3& q) { return p.dot(axis) < q.dot(axis); });
    const Vec3 moved = axis + (farthest - axis) / (step + 1.0);
    if (!(moved.norm() > 0.0)) break;
    axis = moved.normalized();
    const double cosine = least_cosine(normals, axis);
    if (cosine <= seen) continue;
    seen = cosine;
    best = axis;
  }
  return best;
}

class PanelSolver {
 public:
  PanelSolver(const PanelJob& job, PanelRoom& room)
      : job_(job), r_(room), setting_{{job.pressure, {}, 0.5 * std::min(job.pressure.feature_size(), job.overlap.extent().norm())}, {job.third, {}}, {}, {}, order_of(job.error), 0.0, 0.1 * std::sqrt(job.error), job.reference} {}

  bool solve(PatchPoints& points, PanelOutcome& out);

 private:
  /// Gauss points of a line: two more digits of the error ask for one more.
  static int order_of(double error) { return std::clamp(static_cast<int>(std::lround(2.0 - 0.5 * std::log10(error))), 3, 8); }

  bool find_frame();
  bool frame_from(const PressureBatch& batch);
  void move_to_sigma(PressureBatch& batch) const;
  bool set_star(double margin);
  void set_enough(double depth);
  void start();
  void start_star();
  bool begin();
  void add_cell(const std::array<double, 3>& low, const std::array<double, 3>& high, bool walls, const Panel* parent);
  void choose_axes(std::size_t first);
  [[nodiscard]] Box box_of(const Panel& panel) const;
  void set_levels(Panel& panel);
  [[nodiscard]] Vec3 middle_of(const Panel& panel) const;
  [[nodiscard]] bool crosses(const implicit::Kink& kink, const Panel& panel) const;
  void measure(std::size_t first);
  void look_for_starts(Panel& panel);
  [[nodiscard]] double most_of_starts(const Panel& panel) const;
  void settle_starts();
  [[nodiscard]] bool has_third(const Panel& panel) const;
  bool look_across_sides();
  void look_for_imprints(Panel& panel) const;
  void look_for_free_places(Panel& panel) const;
  [[nodiscard]] double estimate();
  [[nodiscard]] double error_of(const Panel& panel) const;
  [[nodiscard]] double energy_scale() const;
  bool choose(double estimated);
  void refine();
  void split(const Panel& panel, std::size_t axis, double place, bool walls);
  [[nodiscard]] bool try_to_cut(Panel& panel);
  [[nodiscard]] bool has_one_sheet();
  [[nodiscard]] bool ends_first(int side);
  void hand_over(PatchPoints& points, PanelOutcome& out);

  const PanelJob& job_;
  PanelRoom& r_;
  PanelSetting setting_;
  bool graph_ = true;
  bool kinks_known_ = false;
  bool starts_settled_ = false;
  PatchSums all_;
  double energy_ = 1.0;  // that errors of fluxes are measured against [J]
};

/// Newton's method to p_A = p_B, a few steps: normals beside Sigma say little of it where one body is pressed in deeply.
void PanelSolver::move_to_sigma(PressureBatch& batch) const {
  constexpr int kSteps = 3;
  for (int step = 0; step < kSteps; ++step) {
    step_to_sigma(batch, setting_.view.reach);
    job_.pressure.evaluate(batch);
  }
}

/// A frame from the starts as they are, or, where Sigma is no graph by these, from where they are on Sigma.
bool PanelSolver::find_frame() {
  PressureBatch& batch = r_.batch;
  const auto place_starts = [&] {
    batch.resize(job_.starts.size());
    std::copy(job_.starts.begin(), job_.starts.end(), batch.point.begin());
    job_.pressure.evaluate(batch);
  };
  place_starts();
  if (!frame_from(batch)) return false;
  if (graph_) return true;
  move_to_sigma(batch);
  if (frame_from(batch)) return true;
  place_starts();
  return frame_from(batch);
}

/// The frame whose last axis is the mean normal where the bodies press, and whether Sigma seems to be a graph over it.
bool PanelSolver::frame_from(const PressureBatch& batch) {
  Vec3 place = Vec3::Zero(), normal = Vec3::Zero();
  std::vector<Vec3>& normals = r_.normal;
  normals.clear();
  double all = 0.0, depth = 0.0;
  const auto weight = [&](std::size_t i) { return std::max(batch.a[i] / job_.pressure.modulus(0), 0.0) + std::max(batch.b[i] / job_.pressure.modulus(1), 0.0); };
  const auto across = [&](std::size_t i) { return Vec3((batch.slope_b[i] - batch.slope_a[i]).normalized()); };
  const auto presses = [&](std::size_t i) {
    return batch.a[i] > -kOnSurface * job_.pressure.modulus(0) && batch.b[i] > -kOnSurface * job_.pressure.modulus(1) && weight(i) > 0.0;
  };
  r_.start.clear();
  r_.start_pressure.clear();
  for (std::size_t i = 0; i < batch.size(); ++i) {
    if (!presses(i)) continue;
    const double w = weight(i);
    normals.push_back(across(i));
    normal += w * normals.back();
    place += w * batch.point[i];
    all += w;
    depth = std::max(depth, std::max(batch.a[i], 0.0) / batch.slope_a[i].norm() + std::max(batch.b[i], 0.0) / batch.slope_b[i].norm());
    r_.start.push_back(batch.point[i]);
    const double fall_a = batch.slope_a[i].norm(), fall_b = batch.slope_b[i].norm();
    r_.start_pressure.push_back((std::max(batch.a[i], 0.0) * fall_b + std::max(batch.b[i], 0.0) * fall_a) / (fall_a + fall_b));
  }
  if (!(all > 0.0)) return false;
  place /= all;
  const Vec3 axis = best_axis(normals, normal);
  graph_ = least_cosine(normals, axis) > kRayCosine;
  const Vec3 first = job_.pressure.tangent(place, axis).value_or(axis.unitOrthogonal());
  const Vec3 u = (first - first.dot(axis) * axis).normalized();
  setting_.view.frame = {place, {u, axis.cross(u), axis}};
  for (Vec3& x : r_.start) x = setting_.view.frame.local(x);
  set_enough(depth);
  return true;
}

/// @param depth  of the overlap [m]
void PanelSolver::set_enough(double depth) {
  constexpr double kEnough = 0.03, kLeastDepth = 1e-9;
  const double feature = 2.0 * setting_.view.reach;
  setting_.enough = kEnough * std::sqrt(job_.error * std::clamp(depth, kLeastDepth * feature, feature) * feature);
}

/// The frame and the reach of a star that holds a patch. @param margin  beyond the rim as it is known, over its distance
bool PanelSolver::set_star(double margin) {
  constexpr std::size_t kAngles = 64;
  const PolarCover& cover = *job_.star;
  const PeakFrame& frame = cover.frame;
  setting_.view.frame = {frame.origin, {frame.u.normalized(), frame.v.normalized(), frame.axis}};
  setting_.chart.axis = {frame.u.norm(), frame.v.norm()};
  std::array<double, kAngles> reach{};
  for (std::size_t k = 0; k < kAngles; ++k) {
    const auto [sine, cosine] = math::sin_cos(kTurn * static_cast<double>(k) / kAngles);
    const double far = cover.reach({cosine, sine}).far;
    if (!(far > 0.0)) return false;
    reach[k] = margin / far;
  }
  setting_.chart.wave = PlaneChart::waves_of(reach);
  set_enough(std::max(cover.thickness, frame.thickness));
  r_.start.clear();
  r_.start_pressure.clear();
  r_.free.clear();
  r_.free_pressure.clear();
  for (const FreePlace& free : job_.free) {
    if (!(free.normal.dot(frame.axis) > 0.0)) continue;
    const Vec3 y = setting_.view.frame.local(free.at);
    const PlaneChart::Place place = setting_.chart.place_of({y[0], y[1]});
    r_.free.emplace_back(place[0], place[1], y[2]);
    r_.free_pressure.push_back(free.pressure);
  }
  return true;
}

/// Four sectors, from the heights of the rim.
void PanelSolver::start_star() {
  constexpr int kSectors = 4;
  const PolarCover& cover = *job_.star;
  double low = 0.0, high = 0.0;
  const auto add = [&](const Vec3& x) {
    const Vec3 y = setting_.view.frame.local(x);
    SigmaRay ray;
    ray.at = {y[0], y[1]};
    ray.height = y[2];
    ray.found = true;
    r_.arena.node.push_back(ray);
    low = std::min(low, y[2]);
    high = std::max(high, y[2]);
  };
  add(cover.frame.origin);
  for (const Vec3& x : cover.rim) add(x);
  const double beside = (high - low) + std::max(cover.thickness, cover.frame.thickness);
  for (int k = 0; k < kSectors; ++k) {
    constexpr double kWidth = kTurn / kSectors;
    Panel panel;
    panel.low = {k * kWidth, 0.0, low - beside};
    panel.high = {(k + 1) * kWidth, 1.0, high + beside};
    panel.guess = {0, static_cast<std::uint32_t>(r_.arena.node.size())};
    r_.panel.push_back(panel);
  }
}

Box PanelSolver::box_of(const Panel& panel) const {
  const RayFrame& frame = setting_.view.frame;
  Vec3 centre, half;
  for (std::size_t k = 0; k < 3; ++k) {
    centre[static_cast<Eigen::Index>(k)] = 0.5 * (panel.low[k] + panel.high[k]);
    half[static_cast<Eigen::Index>(k)] = 0.5 * (panel.high[k] - panel.low[k]);
  }
  if (setting_.chart.star()) {
    // Places of the panel are no farther from its middle than those on its outer arc and its corners; between these the star reaches as far as straight
    // lines have it.
    constexpr int kPlaces = 8;
    const PlaneChart::Place middle = setting_.chart.at({centre[0], centre[1]});
    double far = 0.0;
    for (int i = 0; i <= kPlaces; ++i) {
      for (const double share : {panel.low[1], panel.high[1]}) {
        const PlaneChart::Place at = setting_.chart.at({panel.low[0] + (panel.high[0] - panel.low[0]) * i / kPlaces, share});
        far = std::max(far, std::hypot(at[0] - middle[0], at[1] - middle[1]));
      }
    }
    constexpr double kBetween = 1.1;  // places of the arc
    centre[0] = middle[0];
    centre[1] = middle[1];
    half[0] = half[1] = kBetween * far;
  }
  const Vec3 middle = frame.world(centre), reach = frame.axis[0].cwiseAbs() * half[0] + frame.axis[1].cwiseAbs() * half[1] + frame.axis[2].cwiseAbs() * half[2];
  return {middle - reach, middle + reach};
}

/// The overlap in cells no wider than the bodies' features, or half of them where what lies between nodes may matter.
void PanelSolver::start() {
  const RayFrame& frame = setting_.view.frame;
  std::array<double, 3> low, high, count;
  low.fill(kInfinity);
  high.fill(-kInfinity);
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 pick((corner & 1) != 0 ? 1.0 : 0.0, (corner & 2) != 0 ? 1.0 : 0.0, (corner & 4) != 0 ? 1.0 : 0.0);
    const Vec3 y = frame.local(job_.overlap.lower + pick.cwiseProduct(job_.overlap.extent()));
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], y[static_cast<Eigen::Index>(k)]);
      high[k] = std::max(high[k], y[static_cast<Eigen::Index>(k)]);
    }
  }
  constexpr double kFewest = 2.0, kMost = 16.0;
  constexpr double kCoarse = 1e-3;
  const double size = job_.pressure.feature_size() * (graph_ && job_.error >= kCoarse ? 1.0 : 0.5);
  for (std::size_t k = 0; k < 3; ++k) count[k] = k == 2 && graph_ ? 1.0 : std::clamp(std::ceil((high[k] - low[k]) / size), kFewest, kMost);
  for (double i = 0.0; i < count[0]; ++i) {
    for (double j = 0.0; j < count[1]; ++j) {
      for (double l = 0.0; l < count[2]; ++l) {
        std::array<double, 3> from{}, to{};
        for (std::size_t k = 0; k < 3; ++k) {
          const double width = (high[k] - low[k]) / count[k], at = k == 0 ? i : k == 1 ? j : l;
          from[k] = low[k] + at * width;
          to[k] = from[k] + width;
        }
        add_cell(from, to, !graph_, nullptr);
      }
    }
  }
}

void PanelSolver::add_cell(const std::array<double, 3>& low, const std::array<double, 3>& high, bool walls, const Panel* parent) {
  Panel panel;
  panel.low = low;
  panel.high = high;
  panel.walls = walls;
  if (parent != nullptr) {
    panel.along = parent->along;
    panel.reverse = parent->reverse;
    panel.cut = parent->cut;
    panel.depth = static_cast<std::uint8_t>(parent->depth + 1);
    panel.guess = parent->nodes;
  }
  if ((parent == nullptr || walls) && !job_.pressure.may_meet(box_of(panel))) return;
  r_.panel.push_back(panel);
}

/// Rays of cells with walls run along the axis nearest to the normal in the middle.
void PanelSolver::choose_axes(std::size_t first) {
  PressureBatch& batch = r_.batch;
  batch.resize(r_.panel.size() - first);
  for (std::size_t i = first; i < r_.panel.size(); ++i) batch.point[i - first] = box_of(r_.panel[i]).centre();
  job_.pressure.evaluate(batch);
  for (std::size_t i = first; i < r_.panel.size(); ++i) {
    Panel& panel = r_.panel[i];
    const Vec3 normal = batch.slope_b[i - first] - batch.slope_a[i - first];
    Vec3 part;
    for (std::size_t k = 0; k < 3; ++k) part[static_cast<Eigen::Index>(k)] = normal.dot(setting_.view.frame.axis[k]);
    Eigen::Index along = 0;
    part.cwiseAbs().maxCoeff(&along);
    panel.along = static_cast<std::uint8_t>(along);
    panel.reverse = part[along] < 0.0;
  }
}

/// About where Sigma is above the middle of a panel, from the nearest node that is known.
Vec3 PanelSolver::middle_of(const Panel& panel) const {
  const auto half = [&](int k) { return 0.5 * (panel.low[static_cast<std::size_t>(k)] + panel.high[static_cast<std::size_t>(k)]); };
  SigmaRay ray;
  ray.along = panel.along;
  ray.at = setting_.chart.at({half(first_across(panel.along)), half(second_across(panel.along))});
  ray.height = half(panel.along);
  const Slice known = panel.nodes.size() > 0 ? panel.nodes : panel.guess;
  double least = kInfinity;
  for (const SigmaRay& node : std::span(r_.arena.node).subspan(known.begin, known.size())) {
    const double u = ray.at[0] - node.at[0], v = ray.at[1] - node.at[1];
    if (!node.found || node.along != panel.along || std::hypot(u, v) >= least) continue;
    least = std::hypot(u, v);
    ray.height = node.height + u * node.rise[0] + v * node.rise[1];
  }
  return setting_.view.frame.world(ray.local(ray.height));
}

bool PanelSolver::crosses(const implicit::Kink& kink, const Panel& panel) const {
  if (is_mild(kink, job_.error)) return false;
  // Around the middle, as far as the panel reaches across.
  const Box box = box_of(panel);
  double square = 0.0;
  for (const int k : {first_across(panel.along), second_across(panel.along)}) {
    const double reach = box.extent().dot(setting_.view.frame.axis[static_cast<std::size_t>(k)].cwiseAbs());
    square += reach * reach;
  }
  const double radius = 0.5 * std::sqrt(square) / kRayCosine;
  const Vec3 x = middle_of(panel);
  return std::abs(kink.value(x)) <= kink.change(x, radius);
}

void PanelSolver::set_levels(Panel& panel) {
  std::vector<std::uint16_t>& level = r_.arena.level;
  panel.levels.begin = static_cast<std::uint32_t>(level.size());
  level.push_back(Levels::kRim);
  if (panel.walls) level.insert(level.end(), {Levels::kLowWall, Levels::kHighWall});
  const Box box = job_.third.empty() ? Box{} : box_of(panel);
  for (std::size_t t = 0; t < job_.third.size(); ++t) {
    if (job_.third[t].body->field.bound(box).upper > 0.0) level.push_back(static_cast<std::uint16_t>(Levels::kFirstThird + t));
  }
  for (std::size_t k = 0; k < r_.kink.size() && panel.cut; ++k) {
    if (crosses(r_.kink[k], panel)) level.push_back(static_cast<std::uint16_t>(setting_.levels.first_kink() + k));
  }
  panel.levels.end = static_cast<std::uint32_t>(level.size());
}

/// Panels from the given one on, whose levels are set.
void PanelSolver::measure(std::size_t first) {
  r_.which.resize(r_.panel.size() - first);
  std::iota(r_.which.begin(), r_.which.end(), static_cast<std::uint32_t>(first));
  for (const std::uint32_t i : r_.which) set_levels(r_.panel[i]);
  measure_panels(setting_, r_.panel, r_.which, r_.arena);
  for (const std::uint32_t i : r_.which) {
    Panel& panel = r_.panel[i];
    if (panel.points.size() == 0) look_for_starts(panel);
    if (panel.points.size() == 0 && job_.star != nullptr) look_for_free_places(panel);
    if (panel.points.size() > 0) look_for_imprints(panel);
    if (!panel.steep) continue;
    panel.off = panel.sums;
    panel.missed_load = std::max(panel.missed_load, panel.sums.load);
  }
}

bool PanelSolver::has_third(const Panel& panel) const {
  const auto levels = std::span(r_.arena.level).subspan(panel.levels.begin, panel.levels.size());
  return std::any_of(levels.begin(), levels.end(), [this](std::uint16_t level) { return setting_.levels.is_third(level); });
}

/// How hard the bodies press on Sigma at most near the starts that a panel holds [Pa].
double PanelSolver::most_of_starts(const Panel& panel) const {
  double most = 0.0;
  for (std::size_t i = 0; i < r_.start.size(); ++i) {
    bool within = true;
    for (std::size_t k = 0; k < 3; ++k) {
      const double at = r_.start[i][static_cast<Eigen::Index>(k)];
      within = within && ((k == panel.along && !panel.walls) || (at >= panel.low[k] && at <= panel.high[k]));
    }
    if (within) most = std::max(most, r_.start_pressure[i]);
  }
  return most;
}

/// Moves starts to Sigma by Newton's method, and leaves out those that end where, to first order, the bodies do not press on it: a part of a body deep in the
/// other one may have Sigma beside it only, or none.
void PanelSolver::settle_starts() {
  starts_settled_ = true;
  PressureBatch& batch = r_.batch;
  batch.resize(r_.start.size());
  for (std::size_t i = 0; i < r_.start.size(); ++i) batch.point[i] = setting_.view.frame.world(r_.start[i]);
  job_.pressure.evaluate(batch);
  move_to_sigma(batch);
  r_.start.clear();
  r_.start_pressure.clear();
  for (std::size_t i = 0; i < batch.size(); ++i) {
    const double off = std::abs(batch.a[i] - batch.b[i]) / (batch.slope_b[i] - batch.slope_a[i]).norm();
    const double most = std::min(batch.a[i] + off * batch.slope_a[i].norm(), batch.b[i] + off * batch.slope_b[i].norm());
    if (most < 0.0) continue;
    r_.start.push_back(setting_.view.frame.local(batch.point[i]));
    r_.start_pressure.push_back(most);
  }
}

/// Panels by the places of the plane that they may hold, in coarse cells.
class PanelMap {
 public:
  PanelMap(std::span<const Panel> panels, std::span<const std::uint32_t> which) {
    for (const std::uint32_t i : which) {
      for (const std::size_t k : {0u, 1u}) {
        low_[k] = std::min(low_[k], panels[i].low[k]);
        high_[k] = std::max(high_[k], panels[i].high[k]);
      }
    }
    for (const std::uint32_t i : which) {
      const std::size_t end = cell(1, panels[i].high[1]);
      const std::uint64_t columns = (~std::uint64_t{0} >> (kCells - 1 - cell(0, panels[i].high[0]))) & (~std::uint64_t{0} << cell(0, panels[i].low[0]));
      for (std::size_t row = cell(1, panels[i].low[1]); row <= end; ++row) row_[row] |= columns;
    }
  }
  [[nodiscard]] bool may_hold(const PlaneChart::Place& place) const {
    const auto beyond = [&](std::size_t k) { return place[k] < low_[k] || place[k] > high_[k]; };
    return !beyond(0) && !beyond(1) && ((row_[cell(1, place[1])] >> cell(0, place[0])) & 1) != 0;
  }

 private:
  static constexpr std::size_t kCells = 64;
  [[nodiscard]] std::size_t cell(std::size_t k, double at) const {
    return static_cast<std::size_t>(std::clamp((at - low_[k]) / (high_[k] - low_[k]) * kCells, 0.0, kCells - 1.0));
  }
  PlaneChart::Place low_{kInfinity, kInfinity}, high_{-kInfinity, -kInfinity};
  std::array<std::uint64_t, kCells> row_{};
};

/// Whether a panel without points lies beside one whose patch goes on across their common side, which a ray there confirms. What the panel misses is a triangle, as
/// far as the pressure falls evenly.
bool PanelSolver::look_across_sides() {
  std::vector<std::uint32_t>& empty = r_.which;
  empty.clear();
  for (std::uint32_t i = 0; i < r_.panel.size(); ++i) {
    const Panel& panel = r_.panel[i];
    if (panel.points.size() == 0 && !(panel.missed_load > 0.0) && !panel.walls && !has_third(panel)) empty.push_back(i);
  }
  const PanelMap map(r_.panel, empty);
  std::vector<SigmaRay>& rays = r_.arena.cut_ray;
  std::vector<std::pair<Panel*, const PanelArena::Crossing*>> pairs;
  rays.clear();
  for (const PanelArena::Crossing& crossing : r_.arena.crossing) {
    if (!map.may_hold(crossing.place)) continue;
    for (const std::uint32_t i : empty) {
      Panel& panel = r_.panel[i];
      const auto within = [&](std::size_t k) { return crossing.place[k] >= panel.low[k] && crossing.place[k] <= panel.high[k]; };
      if (!within(0) || !within(1)) continue;
      rays.push_back(start_ray(setting_.chart, panel, crossing.place, std::span(r_.arena.node).subspan(crossing.near.begin, crossing.near.size())));
      pairs.emplace_back(&panel, &crossing);
    }
  }
  if (rays.empty()) return false;
  r_.order.resize(rays.size());
  std::iota(r_.order.begin(), r_.order.end(), 0U);
  probe(setting_.view, rays, r_.order, r_.arena.rays);
  bool any = false;
  for (std::size_t k = 0; k < rays.size(); ++k) {
    const SigmaRay& ray = rays[k];
    if (!std::isfinite(ray.step) || !(ray.pressure > 0.0)) continue;
    const auto& [panel, crossing] = pairs[k];
    const double fall = (crossing->upper ? -1.0 : 1.0) * ray.slope[crossing->across], most = panel->high[crossing->across] - panel->low[crossing->across];
    const double area = 0.5 * crossing->width * (fall > 0.0 ? std::min(ray.pressure / fall, most) : most);
    panel->missed_area += area;
    panel->missed_load += area * ray.pressure / 3.0;
    part_longer(setting_.chart, *panel);
    any = true;
  }
  return any;
}

/// A panel without points that holds a place where the bodies press misses something, unless a third body may have it.
void PanelSolver::look_for_starts(Panel& panel) {
  if (has_third(panel)) return;
  double most = most_of_starts(panel);
  if (!(most > 0.0)) return;
  if (!starts_settled_) {
    settle_starts();
    most = most_of_starts(panel);
  }
  if (!(most > 0.0)) return;
  const double across = panel.high[static_cast<std::size_t>(first_across(panel.along))] - panel.low[static_cast<std::size_t>(first_across(panel.along))];
  const double along = panel.high[static_cast<std::size_t>(second_across(panel.along))] - panel.low[static_cast<std::size_t>(second_across(panel.along))];
  const double area = across * along / (setting_.order * setting_.order);  // what a node stands for
  panel.missed_area = std::max(panel.missed_area, area);
  panel.missed_load = std::max(panel.missed_load, most * area / 3.0);
  part_longer(setting_.chart, panel);
}

/// A panel of a star without points that holds a place where the pair presses harder than third bodies misses something. Where none of its rays leads to such a place, these
/// have met another sheet of Sigma.
void PanelSolver::look_for_free_places(Panel& panel) const {
  constexpr double kEnds = 10.0;  // of steps that are enough: how far off heights may be
  const std::span<const SigmaRay> nodes = std::span(r_.arena.node).subspan(panel.nodes.begin, panel.nodes.size());
  for (std::size_t i = 0; i < r_.free.size(); ++i) {
    const Vec3& free = r_.free[i];
    const auto within = [&](std::size_t k) { return free[static_cast<Eigen::Index>(k)] >= panel.low[k] && free[static_cast<Eigen::Index>(k)] <= panel.high[k]; };
    if (!within(0) || !within(1) || !within(2)) continue;
    const PlaneChart::Place at = setting_.chart.at({free[0], free[1]});
    const auto leads_there = [&](const SigmaRay& ray) {
      const double off = std::hypot(ray.at[0] - at[0], ray.at[1] - at[1]);
      return ray.found && std::abs(ray.height - free[2]) <= off / kRayCosine + kEnds * setting_.enough;
    };
    panel.steep = panel.steep || std::none_of(nodes.begin(), nodes.end(), leads_there);
    const double area = (panel.high[0] - panel.low[0]) * (panel.high[1] - panel.low[1]) * setting_.chart.stretch({free[0], free[1]}) / (setting_.order * setting_.order);  // what a node stands for
    panel.missed_area = std::max(panel.missed_area, area);
    panel.missed_load = std::max(panel.missed_load, area * r_.free_pressure[i]);
  }
}

/// A panel that holds a place where a third body presses harder, which none of its lines tells, has too much by what lies between nodes.
void PanelSolver::look_for_imprints(Panel& panel) const {
  for (const ImprintPlace& imprint : job_.imprint) {
    if ((panel.thirds & third_bit(imprint.third)) != 0) continue;
    const Vec3 y = setting_.view.frame.local(imprint.at);
    const PlaneChart::Place place = setting_.chart.place_of({y[0], y[1]});
    if (!(place[0] >= panel.low[0] && place[0] <= panel.high[0] && place[1] >= panel.low[1] && place[1] <= panel.high[1])) continue;
    constexpr double kBetween = 2.0;  // what lies between four nodes, over what one stands for
    const double share = kBetween / (setting_.order * setting_.order);
    panel.missed_area += share * panel.sums.area;
    panel.missed_load += share * panel.sums.load;
  }
}

/// That errors of fluxes are measured against: those of one sign, as others may cancel.
double PanelSolver::energy_scale() const {
  double sum = 0.0;
  for (const Panel& panel : r_.panel) sum += std::abs(panel.sums.flux[0]) + std::abs(panel.sums.flux[1]);
  return std::max(sum, std::numeric_limits<double>::min());
}

double PanelSolver::error_of(const Panel& panel) const {
  if (!(all_.load > 0.0) || !(all_.area > 0.0)) return panel.missed_load > 0.0 ? 1.0 : 0.0;
  const Vec3 first = panel.off.first - panel.off.load * all_.centre();
  return std::max({(panel.off.force.norm() + panel.missed_load) / force_scale(all_.force, all_.load), (std::abs(panel.off.area) + panel.missed_area) / all_.area,
                   first.norm() / (all_.load * std::sqrt(all_.area)), kOfFlux * std::abs(panel.off.flux[0] + panel.off.flux[1]) / energy_});
}

/// What two orders differ by over all panels, and what is left where their differences cancel by chance: the root of the sum of squares.
double PanelSolver::estimate() {
  all_ = {};
  for (const Panel& panel : r_.panel) all_.add(panel.sums);
  energy_ = energy_scale();
  const auto missed = [](const Panel& panel) { return panel.missed_load > 0.0; };
  if (job_.star != nullptr && r_.panel.size() > 0 && !(all_.load > 0.0) && std::none_of(r_.panel.begin(), r_.panel.end(), missed)) return 0.0;
  if (!(all_.load > 0.0) || !(all_.area > 0.0)) return 1.0;
  Errors e;
  const Vec3 centre = all_.centre();
  for (const Panel& panel : r_.panel) {
    const Vec3 first = panel.off.first - panel.off.load * centre;
    e.force += panel.off.force;
    e.first += first;
    e.area += panel.off.area;
    e.force_square += panel.off.force.squaredNorm();
    e.first_square += first.squaredNorm();
    e.area_square += panel.off.area * panel.off.area;
    e.missed_load += panel.missed_load;
    e.missed_area += panel.missed_area;
    const double flux = panel.off.flux[0] + panel.off.flux[1];
    e.energy += flux;
    e.energy_square += flux * flux;
  }
  const double force = (e.force.norm() + std::sqrt(e.force_square) + e.missed_load) / force_scale(all_.force, all_.load);
  const double area = (std::abs(e.area) + std::sqrt(e.area_square) + e.missed_area) / all_.area;
  const double first = (e.first.norm() + std::sqrt(e.first_square)) / (all_.load * std::sqrt(all_.area));
  const double energy = kOfFlux * (std::abs(e.energy) + std::sqrt(e.energy_square)) / energy_;
  return kTwoOrders * std::max({force, area, first, energy});
}

/// Moves the panels that err most to `chosen`. What the others err by is a share of what is asked, and less than now by as much as the estimate is to become
/// smaller, so that the last panels are not refined one by one. @return false where there are none, or those that are split no more err by too much
bool PanelSolver::choose(double estimated) {
  constexpr double kOfUnmet = 0.9;  // beyond what would meet the error just so
  std::vector<std::uint32_t>& order = r_.order;
  order.clear();
  r_.value.resize(r_.panel.size());
  double square = 0.0, sum = 0.0, all = 0.0, left_as_they_are = 0.0;
  // Errors of one sign add up, others cancel: between the two.
  const auto add = [&](double e) {
    square += e * e;
    sum += e;
    return std::sqrt(std::sqrt(square) * sum);
  };
  for (std::size_t i = 0; i < r_.panel.size(); ++i) {
    r_.value[i] = error_of(r_.panel[i]);
    if (!(r_.value[i] > 0.0)) continue;
    if (r_.panel[i].depth >= kMostDepth) {
      left_as_they_are = std::hypot(left_as_they_are, r_.value[i]);
      continue;
    }
    order.push_back(static_cast<std::uint32_t>(i));
    all = add(r_.value[i]);
  }
  if (kTwoOrders * left_as_they_are > job_.error) return false;
  const double most = std::min(kOfKept / kTwoOrders * job_.error, kOfUnmet * all * job_.error / estimated);
  std::sort(order.begin(), order.end(), [&](std::uint32_t p, std::uint32_t q) { return r_.value[p] != r_.value[q] ? r_.value[p] < r_.value[q] : p < q; });
  square = sum = 0.0;
  std::size_t kept = 0;
  while (kept < order.size() && !(add(r_.value[order[kept]]) > most)) ++kept;
  if (kept == order.size()) {
    if (order.empty()) return false;
    --kept;
  }
  order.erase(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(kept));
  std::sort(order.begin(), order.end());
  r_.chosen.clear();
  std::size_t next = 0, left = 0;
  for (std::size_t i = 0; i < r_.panel.size(); ++i) {
    if (next < order.size() && order[next] == i) {
      r_.chosen.push_back(r_.panel[i]);
      ++next;
    } else {
      r_.panel[left++] = r_.panel[i];
    }
  }
  r_.panel.resize(left);
  return true;
}

/// Whether kinks that a panel is not cut at yet cross it.
bool PanelSolver::try_to_cut(Panel& panel) {
  if (panel.cut) return false;
  if (!kinks_known_) {
    kinks_known_ = true;
    (void)job_.pressure.kinks(job_.overlap, r_.kink);
    setting_.levels.kink = r_.kink;
  }
  panel.cut = true;
  return std::any_of(r_.kink.begin(), r_.kink.end(), [&](const implicit::Kink& kink) { return crosses(kink, panel); });
}

void PanelSolver::split(const Panel& panel, std::size_t axis, double place, bool walls) {
  for (const bool upper : {false, true}) {
    std::array<double, 3> low = panel.low, high = panel.high;
    (upper ? low : high)[axis] = place;
    add_cell(low, high, walls, &panel);
  }
}

void PanelSolver::refine() {
  const std::size_t first = r_.panel.size();
  std::size_t steep = 0;
  for (std::size_t i = 0; i < r_.chosen.size(); ++i) {
    const Panel& panel = r_.chosen[i];
    if (!panel.steep) continue;
    std::size_t longest = 0;
    for (const std::size_t k : {1u, 2u}) longest = panel.high[k] - panel.low[k] > panel.high[longest] - panel.low[longest] ? k : longest;
    split(panel, longest, 0.5 * (panel.low[longest] + panel.high[longest]), true);
    ++steep;
  }
  if (steep > 0) choose_axes(first);
  for (Panel& panel : r_.chosen) {
    if (panel.steep) continue;
    if (try_to_cut(panel)) {
      panel.guess = panel.nodes;
      r_.panel.push_back(panel);
      continue;
    }
    split(panel, static_cast<std::size_t>(panel.parting == 0 ? first_across(panel.along) : second_across(panel.along)), panel.parting_place, panel.walls);
  }
  measure(first);
}

void PanelSolver::hand_over(PatchPoints& points, PanelOutcome& out) {
  out.sums = all_;
  const double most = job_.overlap.extent().dot(setting_.view.frame.axis[2].cwiseAbs());
  const auto thickness = [&](const PanelPoint& p, std::size_t side) { return p.fall[side] > 0.0 ? std::min(p.pressure / p.fall[side], most) : most; };
  for (const Panel& panel : r_.panel) {
    for (std::uint32_t i = panel.points.begin; i < panel.points.end; ++i) {
      const PanelPoint& p = r_.arena.point[i];
      points.point.push_back(p.at);
      points.normal.push_back(p.normal);
      points.area.push_back(p.area);
      points.pressure.push_back(p.pressure);
      points.residual = std::max(points.residual, p.mismatch);
      if (p.pressure <= out.largest) continue;
      out.largest = p.pressure;
      out.thickness = std::min(thickness(p, 0) + thickness(p, 1), most);
    }
  }
}

/// Whether both bodies reach as far beyond Sigma as the other one's pressure: where one is thinner, it may have another sheet of Sigma on its far side.
bool PanelSolver::has_one_sheet() {
  constexpr double kOfLargest = 0.05;  // near the rim both end where Sigma does
  double largest = 0.0;
  for (const Panel& panel : r_.panel) {
    for (std::uint32_t i = panel.points.begin; i < panel.points.end; ++i) largest = std::max(largest, r_.arena.point[i].pressure);
  }
  for (const std::size_t side : {0u, 1u}) {
    r_.way.clear();
    for (const Panel& panel : r_.panel) {
      for (std::uint32_t i = panel.points.begin; i < panel.points.end; ++i) {
        const PanelPoint& p = r_.arena.point[i];
        if (p.pressure < kOfLargest * largest) continue;
        r_.way.push_back({p.at, p.fall[side] > 0.0 ? p.pressure / p.fall[side] : setting_.view.reach, 0.0, kInfinity});
      }
    }
    if (!ends_first(static_cast<int>(side))) return false;
  }
  return true;
}

/// Whether along the ways out of a body there is a place beyond the body, and still in the other one. To first order that is where the pressure falls to zero;
/// where it falls faster farther out, nearer.
bool PanelSolver::ends_first(int side) {
  constexpr int kMostSteps = 12;
  const Vec3 out = (side == 0 ? 1.0 : -1.0) * setting_.view.frame.axis[2];
  std::vector<double>& own = r_.value;
  for (int step = 0; step < kMostSteps && !r_.way.empty(); ++step) {
    r_.far.clear();
    for (const PanelRoom::Way& way : r_.way) r_.far.push_back(way.from + way.length * out);
    own.resize(r_.far.size());
    r_.other.resize(r_.far.size());
    job_.pressure.evaluate(1 - side, r_.far, r_.other);
    job_.pressure.evaluate(side, r_.far, own);
    std::size_t left = 0;
    for (std::size_t i = 0; i < r_.way.size(); ++i) {
      PanelRoom::Way way = r_.way[i];
      const bool inside = own[i] > 0.0, within_other = r_.other[i] > 0.0;
      if (!inside && within_other) continue;
      if (inside && !within_other) return false;
      (inside ? way.low : way.high) = way.length;
      way.length = std::isfinite(way.high) ? 0.5 * (way.low + way.high) : 2.0 * way.length;
      r_.way[left++] = way;
    }
    r_.way.resize(left);
  }
  return r_.way.empty();
}

/// The first panels. @return false where they do not fit
bool PanelSolver::begin() {
  constexpr double kMargin = 1.1, kWider = 1.4, kWidest = 4.0;  // of a star, beyond the rim as it is known
  if (job_.star == nullptr) {
    if (!find_frame() || (job_.graph_only && !graph_)) return false;
    start();
    if (!graph_) choose_axes(0);
    measure(0);
    return true;
  }
  setting_.apex = job_.apex;
  for (const int side : {0, 1}) setting_.longest[static_cast<std::size_t>(side)] = job_.pressure.field(side).surface_box().extent().norm();
  for (double margin = kMargin; margin <= kWidest; margin *= kWider) {
    r_.arena.clear();
    r_.panel.clear();
    if (!set_star(margin)) return false;
    start_star();
    measure(0);
    if (std::none_of(r_.panel.begin(), r_.panel.end(), [](const Panel& panel) { return panel.open; })) return true;
  }
  return false;
}

bool PanelSolver::solve(PatchPoints& points, PanelOutcome& out) {
  r_.arena.clear();
  r_.panel.clear();
  r_.kink.clear();
  if (!begin()) return false;
  const bool star = job_.star != nullptr;
  const auto fits = [&] { return !star || std::none_of(r_.panel.begin(), r_.panel.end(), [](const Panel& panel) { return panel.open || panel.steep; }); };
  const std::size_t most = star ? kMostOfStar : kMostPanels;
  do {
    for (out.estimate = estimate(); fits() && out.estimate > job_.error && r_.panel.size() < most && choose(out.estimate); out.estimate = estimate()) refine();
  } while (fits() && out.estimate <= job_.error && look_across_sides());
  if (!fits()) return false;
  const bool taken = star && out.estimate == 0.0 && !(all_.load > 0.0);
  if (!taken && (!(all_.load > 0.0) || (job_.graph_only && !has_one_sheet()))) return false;
  hand_over(points, out);
  return true;
}

}  // namespace

bool solve_by_panels(const PanelJob& job, PanelRoom& room, PatchPoints& points, PanelOutcome& out) {
  return PanelSolver(job, room).solve(points, out);
}

}  // namespace supple::collision
