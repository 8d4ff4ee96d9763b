/// Polar quadrature of a patch that kinks of a field cross. Along a ray from the peak the pressures are smooth between
/// kinks: Gauss-Legendre on each piece. The integral along a ray is smooth in the angle but where a kink meets the rim or another
/// one, or touches the ray: Gauss-Kronrod on panels between the former, parted where rays begin to meet other kinks, or halved,
/// while the two rules of a panel differ.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "numbers.h"
#include "supple/core/math.h"
#include "surface/accuracy.h"
#include "surface/polar/polar_rule.h"

namespace supple::collision {
namespace {

constexpr double kWidest = 2.2;          // panel at the beginning [rad]
constexpr double kWidestCoarse = 2.4;    // the same by the coarser rule of angles
constexpr double kWidestOfStar = 0.8;    // where no kink parts the patch: its outline is uneven
constexpr int kMostRadial = 16;
constexpr double kShort = 0.03;          // share of a ray on which two points are always enough
constexpr double kUnseen = 1e-3;         // of the error asked for: slivers beyond a kink between two rays
constexpr double kUnseenBesideThirds = 0.02;  // the pressure itself ends at their borders, which rays cross to within a hundredth of it
constexpr std::size_t kMostPanels = 48, kMostBesideThirds = 192;  // that the estimate may ask for
constexpr double kLeastAlong = 0.5;      // cosine between the rim and the line to its next point
constexpr double kMostChange = 2.0;      // of the radius, over what its slopes say

/// Points of the Gauss rule on a piece of a ray, of which there are `radial` on a whole one.
int nodes_on(int radial, double share) {
  const int least = share < kShort ? 2 : 3;
  return std::clamp(static_cast<int>(std::ceil(radial * (0.35 + 0.65 * share))), least, kMostRadial);
}

/// Points that n are compared with.
int check_of(int n) { return n - 1; }

/// Kinks so near to another, to the peak or to the rim are left out: the error is of the square; on a face, to whose edge the pressure is the same,
/// of the length itself.
double shortest_piece(double error, bool on_face) { return on_face ? 1e-3 * error : 3e-3 * std::sqrt(error); }

void weigh(PatchSums& sums, const Vec3& x, const Vec3& normal, double weight, double pressure) {
  if (weight != 0.0) sums.add(x, normal, weight, pressure);
}

/// Of force, area and first moment, over those of `all`.
double share_of_difference(const PatchSums& a, const PatchSums& b, const PatchSums& all) {
  const double force = (a.force - b.force).norm() / force_scale(all.force, all.load);
  const double area = std::abs(a.area - b.area) / all.area;
  const Vec3 first = (a.first - b.first) - (a.load - b.load) * all.centre();
  return std::max({force, area, first.norm() / (all.load * std::sqrt(all.area))});
}

}  // namespace

/// Rays of the panels from `first` on, as far as the rim. @return false where it is not found, or leads from a ray to what no ray sees
bool PolarRuleSolver::find_rays(PairPressure& pressure, const KronrodRule& rule, double error, std::size_t first) {
  const std::size_t per_panel = rule.node.size();
  const std::size_t count = (panels_.size() - first) * per_panel;
  for (std::vector<double>* column : {&rays_.cosine, &rays_.sine, &rays_.radius, &rays_.height, &turn_, &heights_.linear, &heights_.square, &heights_.rest}) {
    column->resize(count);
  }
  if (about_middle_) {
    place_rays(rule, first);
  } else {
    for (std::size_t i = 0; i < count; ++i) {
      const Panel& panel = panels_[first + i / per_panel];
      const double node = rule.node[i % per_panel], half = 0.5 * (panel.end - panel.begin);
      const auto [angle, rate] = panel.touches() ? panel.bend(node) : std::array{0.5 * (panel.begin + panel.end) + half * node, half};
      turn_[i] = rate;
      const auto [s, c] = math::sin_cos(angle);
      rays_.cosine[i] = c;
      rays_.sine[i] = s;
      const auto [radius, height] = about_star_ ? star_.outline_at(c, s) : waves_.at(c, s);
      rays_.radius[i] = radius;
      rays_.height[i] = height;
      if (!(radius > 0.0)) return false;
    }
  }
  const double rim_error = rim_error_;
  if (!solve_rim(pressure, rays_, error) && !(about_middle_ && follow_rays(pressure) && solve_rim(pressure, rays_, error))) return false;
  rim_error_ = std::max(rim_error_, rim_error);
  for (std::size_t p = first; p < panels_.size(); ++p) {
    Panel& panel = panels_[p];
    panel.rim = kept_rim_.size();
    for (std::size_t i = (p - first) * per_panel; i < (p - first + 1) * per_panel; ++i) {
      kept_rim_.push_back({rays_.radius[i] * Vec2(rays_.cosine[i], rays_.sine[i]), rays_.height[i], rays_.outward[i]});
    }
    panel.rim_end = kept_rim_.size();
    if (!about_middle_ && !rim_joins(panel.rim, panel.rim_end, false)) return false;
  }
  return true;
}

/// That the number of points of a ray's piece goes by. Only every second ray is checked: those between have no fewer than either neighbour.
/// @param width  of the piece
double PolarRuleSolver::piece_share(const KronrodRule& rule, std::size_t ray, std::size_t piece, double width) const {
  const std::size_t per_panel = rule.node.size(), k = ray % per_panel, pieces = first_crossing_[ray + 1] - first_crossing_[ray];
  if (rule.gauss_weight[k] > 0.0) return width;
  double most = width;
  for (const std::size_t beside : {ray - (k > 0 ? 1 : 0), ray + (k + 1 < per_panel ? 1 : 0)}) {
    if (beside == ray) continue;
    const std::size_t begin = first_crossing_[beside], end = first_crossing_[beside + 1];
    if (end - begin != pieces) return width;
    const double left = piece > 0 ? crossings_[begin + piece - 1].radius : 0.0, right = piece < pieces ? crossings_[begin + piece].radius : 1.0;
    most = std::max(most, right - left);
  }
  return most;
}

/// Gauss points on the pieces of a ray between kinks, from the heights of the model, which is moved to where the kinks are met.
/// @param nodes  on a ray without kinks   @param check  those of the rule to compare with   @param shortest  piece
void PolarRuleSolver::lay_nodes(const KronrodRule& rule, std::size_t ray, int nodes, bool check, double shortest) {
  const std::size_t k = ray % rule.node.size(), begin = first_crossing_[ray], end = first_crossing_[ray + 1];
  const double rim = rays_.radius[ray], angle = check ? rule.gauss_weight[k] : rule.weight[k];
  const Vec3 e = direction(rays_.cosine[ray], rays_.sine[ray]);
  double left = 0.0, lift_left = 0.0;
  for (std::size_t c = begin; c <= end; ++c) {
    const double right = c < end ? crossings_[c].radius : 1.0;
    const double lift_right = c < end ? crossings_[c].height - heights_.at(ray, right) : 0.0;
    if (c < end && (right - left < shortest || 1.0 - right < shortest)) continue;
    // On faces it is the short last piece on which the pressure falls.
    const int all = about_middle_ ? nodes : nodes_on(nodes, piece_share(rule, ray, c - begin, right - left));
    const GaussRule& gauss = gauss_rule(check ? check_of(all) : all);
    for (std::size_t j = 0; j < gauss.node.size(); ++j) {
      const double along = gauss.node[j], r = left + (right - left) * along;
      foot_.push_back(frame_.origin + (r * rim) * e);
      height_.push_back(heights_.at(ray, r) + lift_left + along * (lift_right - lift_left));
      weight_.push_back(angle * turn_[ray] * gauss.weight[j] * (right - left) * rim * rim * r * jacobian_);
    }
    left = right;
    lift_left = lift_right;
  }
}

/// Sums of the panels from `first` on, whose rays are known.
bool PolarRuleSolver::solve_panels(PairPressure& pressure, const KronrodRule& rule, double error, std::size_t first) {
  const std::size_t per_panel = rule.node.size(), count = rays_.size();
  for (std::size_t i = 0; i < count; ++i) {
    const double c = rays_.cosine[i], s = rays_.sine[i], rim = rays_.radius[i];
    heights_.linear[i] = rim * rise_.dot(direction(c, s));
    // Faces are flat about the middle.
    heights_.square[i] = about_middle_ ? 0.0
                               : 0.5 * rim * rim * (frame_.height_uu * c * c + 2.0 * frame_.height_uv * c * s + frame_.height_vv * s * s);
    heights_.rest[i] = rays_.height[i] - heights_.linear[i] - heights_.square[i];
  }
  heights_.star = about_star_;
  crossings_.swap(ray_crossings_.find({pressure, frame_, levels_, rays_, heights_, finder_, about_middle_}, error));
  find_changes(pressure, rule, first);
  const double shortest = shortest_piece(error, about_middle_);
  std::erase_if(crossings_, [&](const Crossing& x) { return x.radius < shortest || x.radius > 1.0 - shortest; });
  first_crossing_.assign(count + 1, 0);
  for (const Crossing& x : crossings_) ++first_crossing_[x.ray + 1];
  std::partial_sum(first_crossing_.begin(), first_crossing_.end(), first_crossing_.begin());
  foot_.clear();
  height_.clear();
  weight_.clear();
  ray_nodes_.clear();
  ray_check_.clear();
  for (std::size_t i = 0; i < count; ++i) {
    const int nodes = panels_[first + i / per_panel].nodes;
    ray_nodes_.push_back(foot_.size());
    lay_nodes(rule, i, nodes, false, shortest);
    ray_check_.push_back(foot_.size());
    if (rule.gauss_weight[i % per_panel] > 0.0) lay_nodes(rule, i, nodes, true, shortest);
  }
  ray_nodes_.push_back(foot_.size());
  node_.resize(foot_.size());
  const double residual = residual_, lift = lift_, below = below_;
  if (!solve_heights(pressure, error)) return false;
  if (!integrate()) return false;
  residual_ = std::max(residual_, residual);
  lift_ = std::max(lift_, lift);
  below_ += below;
  for (std::size_t p = first; p < panels_.size(); ++p) keep_panel(panels_[p], rule, (p - first) * per_panel);
  return true;
}

/// Whether points of the rim are neighbours: the rim leads from one to the next, and its radius changes as its slope says. Where a
/// ray grazes the rim the radius jumps, and what lies beyond is not seen.
bool PolarRuleSolver::rim_joins(std::size_t first, std::size_t last, bool closed) const {
  const double least = about_star_ ? 0.0 : kLeastSight;
  for (std::size_t i = first; i + (closed ? 0 : 1) < last; ++i) {
    const RimPoint &p = kept_rim_[i], &q = kept_rim_[i + 1 < last ? i + 1 : first];
    const Vec2 chord = q.at - p.at;
    double steepest = 0.0;  // of the logarithm of the radius over the angle
    for (const RimPoint* x : {&p, &q}) {
      const Vec2 tangent(-x->outward.y(), x->outward.x());
      const double sight = x->outward.dot(x->at);
      if (!(sight > least * x->outward.norm() * x->at.norm())) return false;
      if (!(tangent.dot(chord) >= kLeastAlong * tangent.norm() * chord.norm())) return false;
      steepest = std::max(steepest, std::abs(tangent.dot(x->at)) / sight);
    }
    const double square_p = p.at.squaredNorm(), square_q = q.at.squaredNorm();
    const double change = std::abs(square_q - square_p) / (square_p + square_q);
    const double angle = std::abs(p.at.x() * q.at.y() - p.at.y() * q.at.x()) / std::sqrt(square_p * square_q);
    if (!(change <= kMostChange * angle * (1.0 + steepest))) return false;
  }
  return true;
}

/// Adds up a panel's rays from `ray` on and keeps its nodes.
void PolarRuleSolver::keep_panel(Panel& panel, const KronrodRule& rule, std::size_t ray) {
  panel.fine = panel.angular = panel.radial = {};
  panel.first = kept_.point.size();
  for (std::size_t k = 0; k < rule.node.size(); ++k) {
    PatchSums along;
    for (std::size_t i = ray_nodes_[ray + k]; i < ray_check_[ray + k]; ++i) {
      const Vec3 x = node_.point[i] - frame_.origin;
      weigh(panel.fine, x, normal_[i], area_[i], pressure_[i]);
      weigh(along, x, normal_[i], area_[i], pressure_[i]);
    }
    panel.angular.add(along, rule.gauss_weight[k] / rule.weight[k]);
    for_columns([&](auto& kept, const auto& node) {
      kept.insert(kept.end(), node.begin() + static_cast<std::ptrdiff_t>(ray_nodes_[ray + k]),
                  node.begin() + static_cast<std::ptrdiff_t>(ray_check_[ray + k]));
    });
    for (std::size_t i = ray_check_[ray + k]; i < ray_nodes_[ray + k + 1]; ++i) {
      weigh(panel.radial, node_.point[i] - frame_.origin, normal_[i], area_[i], pressure_[i]);
    }
  }
  panel.rays = rule.node.size();
  panel.last = kept_.point.size();
}

/// What the sums of a panel are off by at most, over those of `all`. Where rays meet other kinks from some angle on, a derivative jumps there, and two orders
/// say little; as little on faces, and where kinks are not all known or parted at.
void PolarRuleSolver::doubt(Panel& panel, const PatchSums& all) const {
  panel.by_angle = share_of_difference(panel.fine, panel.angular, all);
  panel.by_radius = share_of_difference(panel.angular, panel.radial, all);
  const bool regular = levels_.all_kinks && !about_middle_ && std::all_of(levels_.kink.begin(), levels_.kink.end(), [this](const implicit::Kink& kink) { return parts_at(kink); });
  if (regular) panel.by_radius = error_of_finer(panel.by_radius);
  if (regular && panel.even()) panel.by_angle = error_of_finer(panel.by_angle);
  if (panel.lost) {
    panel.by_angle *= kTwoOrders;
    panel.by_radius *= kTwoOrders;
  }
}

/// Angles at which panels end, as there the integral along a ray is not smooth: where kinks meet the rim, and where rays touch kinks or imprints. The first
/// one comes again at the end, a whole turn later.
std::vector<PolarRuleSolver::Turn> PolarRuleSolver::find_turns(PairPressure& pressure) {
  std::vector<Corner> corners;
  CornerFinder(pressure, frame_, levels_, extent_).find(fine_rim_, 0, corners);
  std::vector<Turn> turns;
  const auto add = [&turns](const Vec2& way, bool touch) {
    const double turn = math::atan2(way.y(), way.x());
    turns.push_back({turn < 0.0 ? turn + kTurn : turn, touch});
  };
  for (const Corner& corner : corners) add(frame_.parts_of(corner.at - frame_.origin), false);
  for (const Imprint& imprint : levels_.imprint) {
    for (const Vec2& way : imprint.touches) add(way, true);
  }
  if (turns.empty()) turns.push_back({0.0, false});
  std::sort(turns.begin(), turns.end(), [](const Turn& a, const Turn& b) { return a.angle < b.angle; });
  // Of those that are the same one stays, so that panels leave nothing out between them.
  std::size_t last = 0;
  for (const Turn& turn : turns) {
    if (turn.angle - turns[last].angle >= kSameTurn) {
      turns[++last] = turn;
    } else {
      turns[last].touch |= turn.touch;
    }
  }
  if (last > 0 && turns.front().angle + kTurn - turns[last].angle < kSameTurn) turns.front().touch |= turns[last--].touch;
  turns.resize(last + 1);
  turns.push_back({turns.front().angle + kTurn, turns.front().touch});
  return turns;
}

bool PolarRuleSolver::solve_split(PairPressure& pressure, const ContactSettings& settings) {
  const double error = settings.error;
  cut_ = !levels_.crossing.empty() && levels_.crossing.back() >= levels_.kink.size();
  const bool fine = error < 1e-4;
  const KronrodRule& rule = kronrod_rule(fine ? 7 : 3);
  const int radial = error >= 1e-3 ? 4 : !fine ? 4 : error >= 1e-6 ? 5 : error >= 1e-8 ? 7 : 10;
  const double widest = about_star_ && levels_.crossing.empty() ? kWidestOfStar : fine ? kWidest : kWidestCoarse;
  about_middle_ = false;
  for (;;) {
    const std::vector<Turn> turns = find_turns(pressure);
    panels_.clear();
    for (std::size_t t = 0; t + 1 < turns.size(); ++t) {
      const double width = turns[t + 1].angle - turns[t].angle;
      const int parts = static_cast<int>(std::ceil(width / widest));
      for (int i = 0; i < parts; ++i) {
        Panel panel;
        panel.begin = turns[t].angle + width * i / parts;
        panel.end = turns[t].angle + width * (i + 1) / parts;
        panel.touch_begin = turns[t].touch && i == 0;
        panel.touch_end = turns[t + 1].touch && i + 1 == parts;
        panel.nodes = radial;
        panels_.push_back(panel);
      }
    }
    const std::size_t crossing = levels_.crossing.size();
    if (!solve_all_panels(pressure, settings, rule, nullptr)) return false;
    if (levels_.crossing.size() == crossing) return true;
  }
}

/// Kinks that only the points of the rim on all rays show to cross the patch; these points are kept. @return whether there are any
bool PolarRuleSolver::add_missed_kinks() {
  const std::size_t crossing = levels_.crossing.size();
  std::vector<double> sides(kept_rim_.size()), places;
  fine_rim_.clear();
  for (const RimPoint& p : kept_rim_) fine_rim_.push_back(frame_.place(p.at, p.height));
  for (std::size_t k = 0; k < levels_.kink.size(); ++k) {
    if (!parts_at(levels_.kink[k]) || std::find(levels_.crossing.begin(), levels_.crossing.end(), k) != levels_.crossing.end()) continue;
    for (std::size_t i = 0; i < sides.size(); ++i) sides[i] = levels_.kink[k].value(fine_rim_[i]);
    places.clear();
    follow_signs(sides, places);
    if (!places.empty()) levels_.crossing.push_back(k);
  }
  if (levels_.crossing.size() == crossing) return false;
  std::sort(levels_.crossing.begin(), levels_.crossing.end());
  return true;
}

/// Forgets the nodes of panels, and what they were off by.
void PolarRuleSolver::start_panels() {
  kept_.resize(0);
  kept_weight_.clear();
  kept_area_.clear();
  kept_pressure_.clear();
  kept_normal_.clear();
  kept_rim_.clear();
  changes_.clear();
  residual_ = lift_ = below_ = rim_error_ = 0.0;
  columns_.forget();
}

/// The estimate, of the whole and of each panel. @return false where nothing presses
bool PolarRuleSolver::doubt_all() {
  PatchSums all;
  for (const Panel& panel : panels_) all.add(panel.fine);
  if (!(all.load > 0.0) || !(all.area > 0.0)) return false;
  estimate_ = below_ / all.load;
  for (Panel& panel : panels_) {
    doubt(panel, all);
    estimate_ += panel.by_angle + panel.by_radius;
  }
  return true;
}

/// Whether rules may agree by chance, as the panel does not begin at the rim's corners.
bool PolarRuleSolver::leaves_unseen(const Panel& panel) const { return panel.leaves && !panel.halved && panel.rays > kronrod_rule(3).node.size() && !(about_middle_ && cut_); }

/// Appends to `finer` what takes the place of a panel: with more points on its rays, and parted where these change, or halved.
/// @param halve  whether it is halved where nothing changes
void PolarRuleSolver::refine_panel(const Panel& panel, const Finer& how, bool halve, std::vector<Panel>& finer) {
  Panel next;
  next.nodes = how.more ? std::min(panel.nodes + 4, kMostRadial) : panel.nodes;
  next.begin = panel.begin;
  const auto end_at = [&](double place) {
    if (!(place - next.begin > kSameTurn) || !(panel.end - place > kSameTurn)) return;
    next.end = place;
    finer.push_back(next);
    next.begin = next.end;
    next.touch_begin = false;
  };
  next.touch_begin = panel.touch_begin;
  next.halved = panel.halved || (how.part && (halve || leaves_unseen(panel)));
  if (parts_at_changes(panel, how)) {
    for (std::size_t c = panel.change; c < panel.change_end; ++c) end_at(changes_[c]);
  } else if (how.part && halve) {
    end_at(panel.touches() ? panel.bend(0.0)[0] : 0.5 * (panel.begin + panel.end));
  }
  next.end = panel.end;
  next.touch_end = panel.touch_end;
  finer.push_back(next);
}

/// Puts the kept nodes, sums and points of the rim of all panels in their order.
void PolarRuleSolver::gather_panels() {
  std::sort(panels_.begin(), panels_.end(), [](const Panel& a, const Panel& b) { return a.begin < b.begin; });
  node_.resize(0);
  weight_.clear();
  area_.clear();
  pressure_.clear();
  normal_.clear();
  fine_ = {};
  for (const Panel& panel : panels_) {
    for_columns([&panel](const auto& kept, auto& node) {
      node.insert(node.end(), kept.begin() + static_cast<std::ptrdiff_t>(panel.first), kept.begin() + static_cast<std::ptrdiff_t>(panel.last));
    });
    fine_.add(panel.fine);
  }
  sorted_rim_.clear();
  for (const Panel& panel : panels_) {
    sorted_rim_.insert(sorted_rim_.end(), kept_rim_.begin() + static_cast<std::ptrdiff_t>(panel.rim),
                       kept_rim_.begin() + static_cast<std::ptrdiff_t>(panel.rim_end));
  }
  kept_rim_.swap(sorted_rim_);
}

/// Halves panels until the estimate is low enough; then nodes and sums of all are in place, unless `levels_.crossing` grew by kinks that the rim shows.
/// @param larger  rule that panels get before they are halved, or null
bool PolarRuleSolver::solve_all_panels(PairPressure& pressure, const ContactSettings& settings, const KronrodRule& first, const KronrodRule* larger) {
  const KronrodRule* rule = &first;
  const double error = settings.error;
  start_panels();
  std::size_t begin = 0, solved = panels_.size();
  const std::size_t most = about_middle_ && cut_ ? kMostBesideThirds : kMostPanels;
  for (;;) {
    if (begin < panels_.size()) {
      if (!find_rays(pressure, *rule, error, begin)) return false;
      if (begin == 0 && add_missed_kinks()) return true;
      if (!solve_panels(pressure, *rule, error, begin)) return false;
    }
    if (!doubt_all()) return false;
    const auto unseen = [this](const Panel& panel) { return leaves_unseen(panel); };
    const bool enough = estimate_ <= kOfParts * error;
    if ((enough && std::none_of(panels_.begin(), panels_.end(), unseen)) || solved >= most) break;
    // New ones go to the end; the angles are put in order when all is done.
    const double share = kOfKept * error / static_cast<double>(panels_.size());
    std::vector<Panel> finer;
    bool by_angle = false;
    std::erase_if(panels_, [&](const Panel& panel) {
      const Finer how{!enough && panel.by_radius > share && panel.nodes < kMostRadial, (!enough && panel.by_angle > share) || unseen(panel)};
      if (!how.more && !how.part) return false;
      by_angle = by_angle || (how.part && !parts_at_changes(panel, how));
      refine_panel(panel, how, larger == nullptr, finer);
      return true;
    });
    if (finer.empty()) break;
    if (larger != nullptr && by_angle) rule = std::exchange(larger, nullptr);
    begin = panels_.size();
    solved += finer.size();
    panels_.insert(panels_.end(), finer.begin(), finer.end());
  }
  gather_panels();
  if (add_missed_kinks()) return true;
  if (!about_middle_) {
    if (!rim_joins(0, kept_rim_.size(), true)) return false;
    polygon_ = kept_rim_;
  }
  node_.resize(node_.point.size());
  estimate_ += (cut_ ? kUnseenBesideThirds : kUnseen) * error + algebraic_error();
  return true;
}

}  // namespace supple::collision
