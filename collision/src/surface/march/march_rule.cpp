#include "surface/march/march_rule.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "numbers.h"
#include "pairs/boxes.h"
#include "supple/core/interrupt.h"
#include "surface/accuracy.h"
#include "surface/march/flat_cells.h"
#include "surface/quadrature.h"
#include "surface/region/column_kinks.h"
#include "surface/region/squeezed_region.h"

namespace supple::collision {
namespace {

/// Of a cell: a last step as long as this leaves its square, and normals as good as it.
constexpr double kOnSigma = 1e-9, kOnSigmaAtBest = 1e-12;
constexpr double kEndOfColumn = 0.03;  // of a cell and the root of the error: a last step, which leaves its square
constexpr int kMostHalvings = 4;       // of the cells of a mesh at which something presses
constexpr int kRoughHalvings = 1;      // the same, where an error of kRough or more is asked for
constexpr double kRough = 5e-2;
constexpr double kBeside = 2.0;        // from where it presses, in triangles: others need not be smooth
constexpr double kBesideEnd = 0.7;     // the same at the end of both supports; not beyond the cells that are there in every view
constexpr double kSmallest = 1.0 / 512.0;  // cell, over the features, for small patches
constexpr double kNoLess = 0.9;        // of Sigma: long cells see as much of it as cubes do
constexpr double kShortest = 1e-9;     // piece of a ray
constexpr int kFewNodes = 3;           // through a squeezed region
constexpr double kWidest = 20.0;       // ends of columns, over where they begin
constexpr std::size_t kBatch = 256;    // pieces that are integrated at once

int order_for(double error) { return error >= kCoarseError ? 3 : error >= 5e-5 ? 4 : error >= 1e-6 ? 5 : error >= 1e-8 ? 6 : 8; }

}  // namespace

/// Where on the rays the rim lies, or a kink: Newton's method on Sigma, held between places on both sides of it.
void MarchRuleSolver::find_zeros(PairPressure& pressure, Thirds third, std::vector<Ray>& rays) {
  constexpr double kNear = 1e-5;  // near enough to tell on which side of the rim
  constexpr double kMet = 1e-11, kAtZero = 1e-7;
  // The square of this is left of the way to a kink, and sums miss a higher power of it.
  constexpr double kMetKink = 1e-4;
  const std::size_t n = rays.size();
  feet_.clear();
  for (const Ray& ray : rays) feet_.add(leaves_[ray.leaf].piece.triangle, ray.from + ray.at * ray.way, ray.height);
  feet_.make_room();
  open_.clear();
  for (std::size_t i = 0; i < n; ++i) {
    if (rays[i].rim != Rim::None) open_.push_back(i);
  }
  for (int step = 0; step < kBracketSteps && !open_.empty(); ++step) {
    measure(pressure, third, feet_, open_);
    std::size_t left = 0;
    for (const std::size_t i : open_) {
      Ray& ray = rays[i];
      const double move = to_sigma(feet_, i);
      if (!std::isfinite(move)) continue;
      feet_.height[i] += std::clamp(move, -0.5 * cell_, 0.5 * cell_);
      if (std::abs(feet_.height[i]) > cell_) continue;
      open_[left++] = i;
      if (std::abs(move) > kFarOff * cell_) continue;
      find_tangents(feet_, i);
      lift(feet_, i, move);
      const Foot here = foot(feet_, i);
      const bool rim = ray.kink == kPressure;
      double value = here.pressure, rate = here.slope.dot(ray.way);
      if (!rim) {
        Vec3 slope;
        value = kinks_[ray.kink].value(feet_.batch.point[i], slope);
        rate = slope.dot(ray.way.x() * feet_.along_s[i] + ray.way.y() * feet_.along_t[i]);
      }
      if (std::abs(move) < kNear * cell_) ((value > 0.0) == (ray.rim == Rim::Rises) ? ray.high : ray.low) = ray.at;
      const double newton = -value / rate;
      double next = ray.at + newton;
      if (!(next >= ray.low && next <= ray.high)) next = 0.5 * (ray.low + ray.high);
      const double step_along = next - ray.at;
      ray.at = next;
      if (std::abs(step_along) < (rim ? kMet : kMetKink) && std::abs(move) < (rim ? on_sigma_ : kMetKink) * cell_) {
        ray.found = !rim || std::abs(newton) < kAtZero;
        --left;
        continue;
      }
      feet_.at[i] += step_along * ray.way;
      feet_.height[i] += step_along * here.climb.dot(ray.way);
    }
    open_.resize(left);
  }
}

/// Where the rim crosses the first edge of each leaf, from the lone corner to the next but one.
void MarchRuleSolver::find_ends(PairPressure& pressure, Thirds third, std::size_t first, std::size_t end) {
  rays_.clear();
  for (std::size_t l = first; l < end; ++l) {
    Leaf& leaf = leaves_[l];
    leaf.ends = 1.0;
    if (leaf.shape.part != Part::Corner && leaf.shape.part != Part::AllButCorner) continue;
    const auto& c = leaf.piece.corner;
    const auto [i, j, k] = leaf.shape.order;
    Ray ray;
    ray.leaf = l;
    ray.from = c[i].at;
    ray.way = c[k].at - c[i].at;
    ray.rim = leaf.shape.part == Part::Corner ? Rim::Falls : Rim::Rises;
    guess(ray);
    rays_.push_back(ray);
  }
  find_zeros(pressure, third, rays_);
  for (const Ray& ray : rays_) {
    leaves_[ray.leaf].ends = ray.at;
    if (!ray.found) leaves_[ray.leaf].add_doubt(area_of(leaves_[ray.leaf].piece));
  }
}

/// By the straight line between the pressures at the ends of a ray.
void MarchRuleSolver::guess(Ray& ray) const {
  const Piece& piece = leaves_[ray.leaf].piece;
  const auto pressure = [](const Foot& f) { return f.pressure; };
  const double p = quadratic(piece, ray.from, pressure), q = quadratic(piece, ray.from + ray.high * ray.way, pressure), share = p / (p - q);
  ray.at = ray.high * (share > 0.0 && share < 1.0 ? share : 0.5);
  ray.height = height_at(piece, ray.from + ray.at * ray.way);
}

/// Rays through the leaves [first, end), all parallel to one edge of their leaf: by Gauss's rule of this order, then of one less,
/// between two breaks each.
void MarchRuleSolver::send_rays(std::size_t first, std::size_t end, int order) {
  rays_.clear();
  for (std::size_t l = first; l < end; ++l) {
    const Leaf& leaf = leaves_[l];
    if (leaf.shape.part == Part::None) continue;
    const auto& c = leaf.piece.corner;
    const std::size_t i = leaf.shape.order[0], j = leaf.shape.order[1], k = leaf.shape.order[2];
    const auto send = [&](int nodes, std::size_t part, Rim rim, double across, double weight) {
      Ray ray;
      ray.leaf = l;
      ray.nodes = nodes;
      ray.fine = nodes == order && weight > 0.0;
      ray.part = part;
      ray.from = c[i].at + across * (c[k].at - c[i].at);
      ray.way = c[j].at - c[i].at;
      ray.high = ray.exit = 1.0 - across;
      ray.rim = rim;
      ray.weight = weight;
      guess(ray);
      rays_.push_back(ray);
    };
    for (const int nodes : {order, order - 1}) {
      for (std::size_t part = 0; part + 1 < leaf.breaks; ++part) {
        const bool beyond = breaks_[leaf.first_break + part] >= leaf.ends;
        if (beyond && leaf.shape.part == Part::Corner) break;
        const bool rim = leaf.shape.part != Part::All && !beyond;
        const Rim goes = !rim ? Rim::None : leaf.shape.part == Part::Corner ? Rim::Falls : Rim::Rises;
        const double begin = breaks_[leaf.first_break + part], width = breaks_[leaf.first_break + part + 1] - begin;
        const GaussRule& gauss = gauss_rule(nodes);
        // The edge shows kinks that leave before the first ray.
        if (leaf.crossings > 0 && part == 0 && nodes == order) send(nodes, part, goes, 0.0, 0.0);
        for (std::size_t n = 0; n < gauss.node.size(); ++n) {
          send(nodes, part, goes, begin + width * gauss.node[n], width * gauss.weight[n] * twice_parameters(leaf.piece));
        }
      }
    }
  }
}

/// Gauss points on the parts of the rays that press, with their shares of the triangles' parameters.
void MarchRuleSolver::lay_points() {
  feet_.clear();
  share_.clear();
  for (Ray& ray : rays_) {
    Leaf& leaf = leaves_[ray.leaf];
    if (ray.rim != Rim::None && !ray.found) leaf.add_doubt(ray.weight * area_of(leaf.piece) / twice_parameters(leaf.piece));
    const GaussRule& gauss = gauss_rule(ray.nodes);
    const std::size_t first = feet_.size();
    double low = ray.begins();
    for (std::size_t k = 0; k <= ray.cuts; ++k) {
      const double high = k < ray.cuts ? cuts_[ray.first_cut + k].at : ray.ends();
      if (k < ray.cuts && high - low < kShortest) continue;
      for (std::size_t j = 0; j < gauss.node.size(); ++j) {
        const Vec2 at = ray.from + (low + (high - low) * gauss.node[j]) * ray.way;
        feet_.add(leaf.piece.triangle, at, height_at(leaf.piece, at));
        share_.push_back(ray.weight * gauss.weight[j] * (high - low));
      }
      low = high;
    }
    ray.feet = feet_.size() - first;
  }
}

double MarchRuleSolver::twice_parameters(const Piece& piece) {
  return std::abs(cross(piece.corner[1].at - piece.corner[0].at, piece.corner[2].at - piece.corner[0].at));
}

MarchRuleSolver::Node MarchRuleSolver::node_at(std::size_t i) const {
  const auto& c = mesh_.triangle[feet_.triangle[i]].corner;
  const Vec3 across = feet_.batch.slope_b[i] - feet_.batch.slope_a[i], turn_s = mesh_.normal[c[1]] - mesh_.normal[c[0]],
             turn_t = mesh_.normal[c[2]] - mesh_.normal[c[0]];
  const Vec3 &s = feet_.along_s[i], &t = feet_.along_t[i];
  Node node;
  node.point = feet_.batch.point[i];
  node.normal = across.normalized();
  node.along = feet_.way[i];
  node.weight = share_[i] * s.cross(t).dot(node.normal);
  node.residual = std::abs(feet_.batch.a[i] - feet_.batch.b[i]);
  node.swept = {share_[i] * s.cross(t).dot(node.along), share_[i] * (s.cross(turn_t) + turn_s.cross(t)).dot(node.along),
                share_[i] * turn_s.cross(turn_t).dot(node.along)};
  return node;
}

/// Sums of the leaves from `first` on by rules of this order and of one less.
void MarchRuleSolver::integrate(PairPressure& pressure, Thirds third, const Vec3& reference, double error, std::size_t first) {
  const int order = order_for(error);
  for (; first < leaves_.size(); first += kBatch) {
    const std::size_t end = std::min(leaves_.size(), first + kBatch);
    find_crossings(pressure, first, end, error);
    find_breaks(pressure, third, first, end);
    send_rays(first, end, order);
    find_zeros(pressure, third, rays_);
    find_cuts(pressure, third);
    lay_points();
    place(pressure, third, feet_);
    std::size_t foot_index = 0, ray = 0;
    for (std::size_t l = first; l < end; ++l) {
      Leaf& leaf = leaves_[l];
      leaf.begin = nodes_.size();
      PatchSums coarse;
      const std::size_t first_ray = ray, first_foot = foot_index;
      for (; ray < rays_.size() && rays_[ray].leaf == l; ++ray) {
        for (std::size_t n = 0; n < rays_[ray].feet; ++n, ++foot_index) {
          const Foot here = foot(feet_, foot_index);
          if (!here.good || !(here.pressure > 0.0)) {
            leaf.add_doubt(2.0 * share_[foot_index] * area_of(leaf.piece) / twice_parameters(leaf.piece));
            continue;
          }
          Node node = node_at(foot_index);
          // Where third bodies press, the pressure of the pair is more than what is left of it.
          node.pressure = here.pressure + std::max(feet_.third[foot_index], 0.0);
          (rays_[ray].fine ? leaf.sums : coarse).add(node.point - reference, node.normal, node.weight, node.pressure);
          if (rays_[ray].fine) nodes_.push_back(node);
        }
      }
      if (leaf.crossings > 0 && !sides_agree(leaf, first_ray, ray, first_foot)) leaf.trust = Trust::Lost;
      leaf.off = leaf.sums;
      leaf.off.add(coarse, -1.0);
      leaf.end = nodes_.size();
    }
  }
}

/// What the finer rule of a leaf may be off by, of what it differs from the coarser one by. Where sums converge like a power of the order,
/// as Gauss's do on smooth pieces, that falls with the difference.
double MarchRuleSolver::share_of(const Leaf& leaf, int order) {
  constexpr double kFall = 30.0, kKinked = 4.0, kLost = 10.0;
  if (leaf.trust == Trust::Lost) return kLost;
  if (leaf.trust == Trust::Kinked) return kKinked;
  if (!leaf.shape.certain || !(leaf.sums.load > 0.0) || !(leaf.sums.area > 0.0)) return kTwoOrders;
  const double off = std::max(leaf.off.force.norm() / leaf.sums.load, std::abs(leaf.off.area) / leaf.sums.area);
  double root = std::sqrt(off);  // of degree order - 1 at least
  for (int degree = 2; degree < order - 1; degree *= 2) root = std::sqrt(root);
  return std::min(kTwoOrders, kFall * root);
}

/// The sums over all leaves, and what each may be off by, relative to them.
void MarchRuleSolver::weigh(int order) {
  // Of a leaf as large as a triangle of the mesh: what two rules may both miss of a kink.
  constexpr double kUnseen = 1e-4;
  sums_ = {};
  for (const Leaf& leaf : leaves_) sums_.add(leaf.sums);
  estimate_ = 1.0;
  unmet_ = kInfinity;
  if (!(sums_.load > 0.0)) return;
  const double across = std::sqrt(sums_.area), force = force_scale(sums_.force, sums_.load);
  const Vec3 centre = sums_.centre();
  std::array<double, 3> sum{};
  for (Leaf& leaf : leaves_) {
    const double lever = leaf.sums.load > 0.0 ? (leaf.sums.centre() - centre).norm() : across, share = share_of(leaf, order);
    const double square = twice_parameters(leaf.piece), size = leaf.mild ? square : std::sqrt(square);
    const double unseen = leaf.trust == Trust::Lost ? kUnseen * size : 0.0;
    const double left_out = unseen + (!rough_.empty() && rough_[leaf.piece.triangle] != 0 ? 1.0 : 0.0);  // Sigma may turn between its corners
    const double doubt = leaf.doubt + left_out * leaf.sums.area, doubt_load = leaf.doubt_load + left_out * leaf.sums.load;
    const std::array<double, 3> off{(share * std::abs(leaf.off.area) + doubt) / sums_.area, (share * leaf.off.force.norm() + doubt_load) / force,
                                    (share * (leaf.off.first - leaf.off.load * centre).norm() + doubt_load * lever) / (sums_.load * across)};
    for (std::size_t k = 0; k < 3; ++k) sum[k] += off[k];
    leaf.error = *std::max_element(off.begin(), off.end());
  }
  unmet_ = *std::max_element(sum.begin(), sum.end());
  estimate_ = std::min(1.0, unmet_);
}

/// Splits the leaves that err most until the rest is as good as asked. @return whether Sigma was met
bool MarchRuleSolver::refine(PairPressure& pressure, Thirds third, const Limits& limits, const Vec3& reference) {
  const int order = order_for(limits.error);
  leaves_.clear();
  nodes_.clear();
  settle(pressure, third, limits.error, pieces_);
  integrate(pressure, third, reference, limits.error, 0);
  weigh(order);
  for (int round = 0; round < limits.refinements && estimate_ > limits.error && !leaves_.empty(); ++round) {
    order_.resize(leaves_.size());
    std::iota(order_.begin(), order_.end(), 0u);
    std::sort(order_.begin(), order_.end(), [this](std::uint32_t i, std::uint32_t j) {
      return leaves_[i].error < leaves_[j].error || (leaves_[i].error == leaves_[j].error && i < j);
    });
    double kept = 0.0;
    std::size_t keeps = 0;
    while (keeps < order_.size() && kept + leaves_[order_[keeps]].error <= kOfKept * limits.error) kept += leaves_[order_[keeps++]].error;
    // All pieces that mirror one another, whose errors differ by round-off, are split, or none.
    constexpr double kAlike = 1.0 - 1e-6;
    while (keeps > 0 && keeps < order_.size() && leaves_[order_[keeps - 1]].error >= kAlike * leaves_[order_[keeps]].error) --keeps;
    const std::size_t splits = order_.size() - keeps;
    if (keeps + 4 * splits > kMostPieces) break;
    std::sort(order_.begin() + static_cast<std::ptrdiff_t>(keeps), order_.end());
    halves_.clear();
    for (std::size_t k = keeps; k < order_.size(); ++k) halves_.push_back(leaves_[order_[k]].piece);
    for (std::size_t k = keeps; k < order_.size(); ++k) leaves_[order_[k]].error = -1.0;
    std::erase_if(leaves_, [](const Leaf& leaf) { return leaf.error < 0.0; });
    pieces_.clear();
    split(pressure, third, halves_, false, pieces_);
    const std::size_t first = leaves_.size();
    settle(pressure, third, limits.error, pieces_);
    integrate(pressure, third, reference, limits.error, first);
    weigh(order);
  }
  return sums_.load > 0.0;
}

/// Ways through what one body loses: out of its apex, or along the interpolated normals, which fill the space beside Sigma without gaps as far as
/// they do not meet.
void MarchRuleSolver::start_columns(PairPressure& pressure, int side, const Node& peak) {
  const double sign = side == 0 ? 1.0 : -1.0;
  apex_ = find_apex(pressure, side, peak.point, sign * peak.normal);
  columns_.assign(nodes_.size(), {});
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const Node& node = nodes_[i];
    Column& c = columns_[i];
    if (apex_) {
      c.way = apex_->way(node.point);
      const double flux = sign * node.weight * node.normal.dot(c.way), bend = 1.0 / apex_->distance(node.point);
      c.swept = swept_out_of_apex(flux, bend);
    } else {
      c.way = sign * node.along;
      c.swept = {{node.swept[0], sign * node.swept[1], node.swept[2]}};
    }
  }
}

/// Whether the body's pressure falls along the columns from where they begin, by its slopes there.
bool MarchRuleSolver::lead_out() const {
  const double least = apex_ ? 0.0 : kLeastFall;
  for (std::size_t i = 0; i < slope_.size(); ++i) {
    if (!(-slope_[i].dot(columns_[i].way) > least * slope_[i].norm())) return false;
  }
  return true;
}

/// Whether columns do not widen too much for their points, and end within the other body, which ways out of an apex may leave. Where they meet, and from
/// there on count as less than nothing, they hold what they enclose all the same.
bool MarchRuleSolver::hold(PairPressure& pressure, int side) {
  place_.clear();
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    const Column& c = columns_[i];
    if (!(std::abs(c.swept.width(c.at)) < kWidest * std::abs(c.swept.width(0.0)))) return false;
    place_.push_back(nodes_[i].point + c.at * c.way);
  }
  if (apex_) return true;
  value_.resize(place_.size());
  pressure.evaluate(1 - side, place_, value_);
  return std::all_of(value_.begin(), value_.end(), [](double p) { return p >= 0.0; });
}

/// Gauss points in what one body loses, unless columns do not hold it.
void MarchRuleSolver::add_columns(PairPressure& pressure, int side, double error, const Node& peak, PatchPoints& points) {
  start_columns(pressure, side, peak);
  const std::size_t n = nodes_.size();
  const double enough = kEndOfColumn * std::sqrt(error) * cell_;
  open_.resize(n);
  std::iota(open_.begin(), open_.end(), std::size_t{0});
  for (int step = 0; step < kBracketSteps && !open_.empty(); ++step) {
    heed_scope();
    place_.clear();
    for (const std::size_t i : open_) place_.push_back(nodes_[i].point + columns_[i].at * columns_[i].way);
    value_.resize(open_.size());
    slope_.resize(open_.size());
    pressure.evaluate(side, place_, value_, slope_);
    if (step == 0) points.unsure[side] = !lead_out();
    std::size_t left = 0;
    for (std::size_t k = 0; k < value_.size(); ++k) {
      const std::size_t i = open_[k];
      Column& c = columns_[i];
      (value_[k] > 0.0 ? c.low : c.high) = c.at;
      const double fall = -slope_[k].dot(c.way), longest = apex_ ? std::max(cell_, c.at) : cell_;
      double next = fall > 0.0 ? c.at + std::clamp(value_[k] / fall, -longest, longest) : c.at + longest;
      if (!(next >= c.low && next <= c.high)) next = std::isfinite(c.high) ? 0.5 * (c.low + c.high) : c.low + longest;
      const bool moves = std::abs(next - c.at) > enough;
      c.at = next;
      if (moves) open_[left++] = i;
    }
    open_.resize(left);
  }
  points.unsure[side] = points.unsure[side] || !hold(pressure, side);
  if (points.unsure[side]) return;
  const int order = std::max(order_for(error) - 1, kFewNodes) + (apex_ ? kMoreAcross : 0);
  ColumnKinks kinks(pressure, side, error);
  const std::size_t begin = points.volume_point.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Column& c = columns_[i];
    const std::span<const double> part = kinks.parts(nodes_[i].point, c.way, c.at);
    const GaussRule& gauss = gauss_rule(order_of_parts(order, part));
    for (std::size_t k = 0; k + 1 < part.size(); ++k) {
      const double length = part[k + 1] - part[k];
      for (std::size_t j = 0; j < gauss.node.size(); ++j) {
        const double t = part[k] + length * gauss.node[j];
        points.volume_point.push_back(nodes_[i].point + t * c.way);
        points.volume_weight.push_back(c.swept.width(t) * length * gauss.weight[j]);
      }
    }
  }
  if (apex_ && apex_->lost) fill_body(pressure, side, apex_->at, error, points.volume_point, points.volume_weight);
  add_to_region(pressure, side, begin, value_, points);
}

/// The coarsest mesh, among halved cells, whose triangles are smooth wherever the bodies may press. @return whether there were not too many cells
bool MarchRuleSolver::lay_mesh(PairPressure& pressure, Thirds third, const Box& overlap,
                               const std::optional<CommonAxis>& axis, const std::optional<FlatCells>& flat, double error) {
  const int most_halvings = error < kRough ? kMostHalvings : kRoughHalvings;
  const auto mesh = [&] {
    heed_scope();
    return mesher_.mesh(pressure, overlap, cell_, axis, flat, mesh_) && mesh_.triangle.size() <= kMostPieces / 2;
  };
  // Halves of the features until something is seen to press, as how long the box of an overlap is depends on how it lies.
  const double size = pressure.feature_size();
  cell_ = size;
  bool coarse = false;
  for (; !mesh(); cell_ *= 2.0) coarse = true;
  begin(pressure, third, pieces_);
  const auto halve = [&] {
    cell_ *= 0.5;
    if (!mesh()) {
      cell_ *= 2.0;
      mesh();
      coarse = true;
    }
    begin(pressure, third, pieces_);
  };
  // By what is known at the feet, as bounds of the fields in boxes depend on how these lie.
  const auto presses_within = [](const Piece& p, double reach) {
    const auto positive = [reach](const Foot& f) { return f.good && f.pressure + reach * f.slope.norm() > 0.0; };
    return std::any_of(p.corner.begin(), p.corner.end(), positive) || std::any_of(p.middle.begin(), p.middle.end(), positive);
  };
  while (!coarse && cell_ > kSmallest * size && std::none_of(pieces_.begin(), pieces_.end(), [&](const Piece& p) { return presses_within(p, 0.0); })) halve();
  // Where supports end round-off says whether a piece is smooth.
  const auto at_end = [this](const Piece& p) {
    const auto& c = mesh_.triangle[p.triangle].corner;
    return std::any_of(c.begin(), c.end(), [this](std::uint32_t v) { return mesh_.at_end[v] != 0; });
  };
  const auto fits = [&](const Piece& p) { return at_end(p) ? !presses_within(p, kBesideEnd) : smooth(p, error) || !presses_within(p, kBeside); };
  for (int halvings = 0; halvings < most_halvings && !coarse; ++halvings) {
    if (std::all_of(pieces_.begin(), pieces_.end(), fits)) break;
    halve();
  }
  rough_.assign(flat || coarse ? pieces_.size() : 0, 0);
  for (std::size_t i = 0; i < rough_.size(); ++i) rough_[i] = fits(pieces_[i]) ? 0 : 1;
  return !coarse;
}

/// Depth first through halves of the overlap: mostly the first small box says it.
bool MarchRuleSolver::may_meet(const PairPressure& pressure, const Box& overlap) {
  constexpr double kLeast = 0.1;  // of what the softer body presses at most
  const double smallest = kSmallest * pressure.feature_size();
  const auto most = [&](int side) { return pressure.modulus(side) * pressure.field(side).bound(overlap).upper; };
  const double least = kLeast * std::min(most(0), most(1));
  std::vector<Box> open{overlap};
  for (std::size_t looked = 0; !open.empty(); ++looked) {
    const Box box = open.back();
    open.pop_back();
    if (!pressure.may_meet(box, least)) continue;
    Eigen::Index longest = 0;
    if (box.extent().maxCoeff(&longest) <= smallest || looked == SigmaMesher::kMostCells) return true;
    Box lower = box, upper = box;
    lower.upper[longest] = upper.lower[longest] = box.centre()[longest];
    open.push_back(lower);
    open.push_back(upper);
  }
  return false;
}

bool MarchRuleSolver::solve(const Job& job, PatchPoints& points) {
  PairPressure& pressure = job.pressure;
  const Thirds third = job.third;
  const Box& overlap = job.overlap;
  const Limits& limits = job.limits;
  estimate_ = 1.0;
  thickness_ = 0.0;
  points.clear();
  if (overlap.empty() || !is_finite(overlap) || !(overlap.extent().maxCoeff() > 0.0)) return false;
  const double coordinates = std::max(overlap.lower.cwiseAbs().maxCoeff(), overlap.upper.cwiseAbs().maxCoeff());
  kinks_.clear();
  all_kinks_ = pressure.kinks(overlap, kinks_);
  bool fine = false;
  const auto solve_on = [&](const std::optional<FlatCells>& cells) {
    on_sigma_ = kOnSigma;
    fine = lay_mesh(pressure, third, overlap, job.axis, cells, limits.error);
    on_sigma_ = std::max(std::clamp(1e-2 * limits.error, kOnSigmaAtBest, kOnSigma), 64.0 * kEpsilon * coordinates / cell_);
    return refine(pressure, third, limits, job.reference);
  };
  bool met = solve_on({});
  if (!met || (!fine && estimate_ > limits.error)) {
    const double unmet = unmet_, area = met ? sums_.area : 0.0;
    const std::optional<FlatCells> flat = flat_cells(pressure, overlap);
    if (flat) {
      const bool better = solve_on(flat) && (!met || (unmet_ < unmet && sums_.area >= kNoLess * area));
      met = better || solve_on({});
    }
  }
  if (!met) return false;

  std::size_t peak = 0;
  kept_.clear();
  for (const Leaf& leaf : leaves_) kept_.insert(kept_.end(), nodes_.begin() + static_cast<std::ptrdiff_t>(leaf.begin), nodes_.begin() + static_cast<std::ptrdiff_t>(leaf.end));
  nodes_.swap(kept_);
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const Node& node = nodes_[i];
    points.point.push_back(node.point);
    points.normal.push_back(node.normal);
    points.area.push_back(node.weight);
    points.pressure.push_back(node.pressure);
    points.residual = std::max(points.residual, node.residual);
    if (node.pressure > nodes_[peak].pressure) peak = i;
  }
  for (const int side : {0, 1}) {
    const Node& top = nodes_[peak];
    if (job.regions[static_cast<std::size_t>(side)] != Region::None) add_columns(pressure, side, limits.error, top, points);
    thickness_ += pressure.overlap_out_of(side, top.point, (side == 0 ? 1.0 : -1.0) * top.normal, cell_);
  }
  if (thickness_ > 0.0) estimate_ = std::min(1.0, estimate_ + 2.0 * rounding_error(coordinates, thickness_));
  return true;
}

}  // namespace supple::collision
