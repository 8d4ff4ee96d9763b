/// Quadrature of a patch about its middle, for faces that lie on faces: their pressure is flat or has its peak at a corner,
/// about which rings say nothing. Rays are followed from kink to kink to the rim; the patch is parted into sectors between the
/// corners of its outline, where kinks meet the rim. A sector's rays go through a parabola near its piece of the rim, so that a
/// straight piece is a triangle, on which Gauss's rule is exact for polynomials. The rest is that of patches that kinks cross.
#include <algorithm>
#include <cmath>

#include "numbers.h"
#include "supple/core/math.h"
#include "surface/accuracy.h"
#include "surface/polar/polar_rule.h"

namespace supple::collision {
namespace {

/// Where the tangents at two points of the rim meet; nothing where that is not between the rays through them.
std::optional<Vec2> between_tangents(const Vec2& a, const Vec2& out_a, const Vec2& b, const Vec2& out_b) {
  const double turn = cross(out_a, out_b);
  if (!(turn > 1e-6 * out_a.norm() * out_b.norm())) return std::nullopt;
  const double at_a = out_a.dot(a), at_b = out_b.dot(b);
  const Vec2 x = meeting_of(out_a, at_a, out_b, at_b);
  if (!(cross(a, x) > 0.0) || !(cross(x, b) > 0.0)) return std::nullopt;
  return x;
}

}  // namespace

/// Rays that Newton's method loses, as the face on which they begin tells nothing of its edge.
bool PolarRuleSolver::follow_rays(PairPressure& pressure) {
  std::vector<Vec2> ways;
  std::vector<RimPoint> found;
  for (std::size_t i = 0; i < rays_.size(); ++i) ways.emplace_back(rays_.cosine[i], rays_.sine[i]);
  OutlineWalks walks(pressure, frame_, levels_.kink, extent_);
  if (!walks.follow(ways, kOutlineStep, found)) return false;
  for (std::size_t i = 0; i < found.size(); ++i) {
    rays_.radius[i] = walks.length(i);
    rays_.height[i] = found[i].height;
  }
  return true;
}

/// Which kinks have points of the outline on the other side than the middle; third bodies may all cross.
void PolarRuleSolver::cross_outline() {
  levels_.crossing.clear();
  for (std::size_t k = 0; k < levels_.kink.size(); ++k) {
    const bool side = levels_.kink[k].value(frame_.origin) > 0.0;
    const auto other = [&](const RimPoint& p) {
      return (levels_.kink[k].value(frame_.place(p.at, p.height)) > 0.0) != side;
    };
    if (std::any_of(outline_.begin(), outline_.end(), other)) levels_.crossing.push_back(k);
  }
  for (std::size_t t = 0; t < levels_.third.size(); ++t) levels_.crossing.push_back(levels_.kink.size() + t);
}

/// The outline with the places where its tangents meet, which lie outside the patch, so that no kink hides between points of it.
void PolarRuleSolver::follow_tangents() {
  const std::size_t n = outline_.size();
  fine_rim_.clear();
  for (std::size_t i = 0; i < n; ++i) {
    const RimPoint &a = outline_[i], &b = outline_[(i + 1) % n];
    fine_rim_.push_back(frame_.place(a.at, a.height));
    if (const std::optional<Vec2> corner = between_tangents(a.at, a.outward, b.at, b.outward)) {
      fine_rim_.push_back(frame_.place(*corner, 0.5 * (a.height + b.height)));
    }
  }
}

/// A panel for each sector. @param nodes  on a ray
void PolarRuleSolver::start_sectors(int nodes) {
  panels_.clear();
  for (std::size_t k = 0; k < sectors_.size(); ++k) {
    Panel panel;
    panel.begin = static_cast<double>(k);
    panel.end = static_cast<double>(k + 1);
    panel.touch_begin = sectors_[k].touch_begin;
    panel.touch_end = sectors_[k].touch_end;
    panel.nodes = nodes;
    panels_.push_back(panel);
  }
}

void PolarRuleSolver::place_rays(const KronrodRule& rule, std::size_t first) {
  const std::size_t per_panel = rule.node.size();
  for (std::size_t i = 0; i < rays_.size(); ++i) {
    const Panel& panel = panels_[first + i / per_panel];
    const double node = rule.node[i % per_panel], half = 0.5 * (panel.end - panel.begin);
    const auto [at, rate_at] = panel.touches() ? panel.bend(node) : std::array{panel.begin + half * (1.0 + node), half};
    const double whole = std::floor(panel.begin), x = at - whole;
    const Sector& sector = sectors_[static_cast<std::size_t>(whole)];
    const std::array<double, 3> share{(1.0 - x) * (1.0 - 2.0 * x), 4.0 * x * (1.0 - x), x * (2.0 * x - 1.0)};
    const std::array<double, 3> rate{4.0 * x - 3.0, 4.0 - 8.0 * x, 4.0 * x - 1.0};
    Vec2 way = Vec2::Zero(), moves = Vec2::Zero();
    double height = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      way += share[k] * sector.at[k];
      moves += rate[k] * sector.at[k];
      height += share[k] * sector.height[k];
    }
    rays_.cosine[i] = way.x();
    rays_.sine[i] = way.y();
    rays_.radius[i] = 1.0;
    rays_.height[i] = height;
    turn_[i] = rate_at * cross(way, moves);
  }
}

/// @param frame  of any place of the patch   @return false where no kink crosses, or this does not fit
bool PolarRuleSolver::solve_about_middle(const PolarJob& job, const PeakFrame& frame, PatchPoints& points) {
  return part_about_middle(job.pressure, frame, job.settings) && finish_parted(job, points);
}

bool PolarRuleSolver::part_about_middle(PairPressure& pressure, const PeakFrame& frame, const ContactSettings& settings) {
  levels_.kink.clear();
  // All of both bodies: which of them a box holds depends on how it lies.
  levels_.all_kinks = pressure.kinks({Vec3::Constant(-kInfinity), Vec3::Constant(kInfinity)}, levels_.kink);
  if (levels_.kink.empty()) return false;
  std::optional<Middle> middle = find_middle(pressure, frame, levels_.kink, extent_);
  if (!middle) return false;
  frame_ = middle->frame;
  outline_ = std::move(middle->outline);
  jacobian_ = frame_.u.norm() * frame_.v.norm();
  cross_outline();
  find_imprints(pressure);
  cut_ = !levels_.third.empty();
  if (cut_) follow_tangents();  // corners of third bodies are begun there
  about_middle_ = true;
  rise_.setZero();
  const double error = settings.error;
  const bool fine = error < 1e-4 || cut_, fewest = error >= 1e-3 && !cut_, third = fine && error >= 1e-6 && !cut_;
  for (;;) {
    std::vector<RimPoint> corners;
    CornerFinder(pressure, frame_, levels_, extent_).find_on_outline(outline_, fine_rim_, corners);
    if (levels_.crossing.empty()) return false;
    if (!make_sectors({outline_, corners, levels_.imprint}, sectors_, polygon_)) return false;
    start_sectors(error >= 1e-4 ? 3 : error >= 1e-6 ? 5 : error >= 1e-8 ? 7 : 8);
    const KronrodRule& first = kronrod_rule(fewest ? 2 : !fine || third ? 3 : 7);
    const std::size_t crossing = levels_.crossing.size();
    if (!solve_all_panels(pressure, settings, first, third ? &kronrod_rule(7) : nullptr)) return false;
    if (levels_.crossing.size() == crossing) return true;
    outline_ = kept_rim_;  // they show kinks that the outline did not
    std::sort(outline_.begin(), outline_.end(), [](const RimPoint& a, const RimPoint& b) { return before(a.at, b.at); });
  }
}

}  // namespace supple::collision
