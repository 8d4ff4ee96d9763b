#include "march_rule.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace supple::collision {
namespace {

MarchVertex between(const MarchVertex& p, const MarchVertex& q, double fp, double fq) {
  const double t = fp / (fp - fq);
  return {p.x + t * (q.x - p.x), p.a + t * (q.a - p.a), p.b + t * (q.b - p.b), p.third + t * (q.third - p.third)};
}

/// Keeps the part of a convex polygon where f >= 0 (Sutherland & Hodgman). @return vertices left
template <class Polygon, class F>
int clip_polygon(Polygon& polygon, int count, const F& f) {
  Polygon out;
  int kept = 0;
  for (int i = 0; i < count; ++i) {
    const MarchVertex& p = polygon[static_cast<std::size_t>(i)];
    const MarchVertex& q = polygon[static_cast<std::size_t>((i + 1) % count)];
    const double fp = f(p), fq = f(q);
    if (fp >= 0.0) out[static_cast<std::size_t>(kept++)] = p;
    if ((fp >= 0.0) != (fq >= 0.0)) out[static_cast<std::size_t>(kept++)] = between(p, q, fp, fq);
  }
  polygon = out;
  return kept;
}

/// Appends the part of a tetrahedron where f >= 0 to `out`, as at most three tetrahedra.
template <class Tetrahedron, class F>
void clip_tetrahedron(const Tetrahedron& tetrahedron, const F& f, std::vector<Tetrahedron>& out) {
  std::array<MarchVertex, 4> in, gone;
  std::size_t kept = 0, lost = 0;
  for (const MarchVertex& v : tetrahedron) {
    if (f(v) >= 0.0) {
      in[kept++] = v;
    } else {
      gone[lost++] = v;
    }
  }
  const auto cut = [&](const MarchVertex& p, const MarchVertex& q) { return between(p, q, f(p), f(q)); };
  // A prism with triangles (p0, p1, p2) and (q0, q1, q2), edges p_i q_i.
  const auto prism = [&](const MarchVertex& p0, const MarchVertex& p1, const MarchVertex& p2, const MarchVertex& q0,
                         const MarchVertex& q1, const MarchVertex& q2) {
    out.push_back({p0, p1, p2, q0});
    out.push_back({p1, p2, q0, q1});
    out.push_back({p2, q0, q1, q2});
  };
  switch (kept) {
    case 4:
      out.push_back(tetrahedron);
      break;
    case 3:
      prism(in[0], in[1], in[2], cut(in[0], gone[0]), cut(in[1], gone[0]), cut(in[2], gone[0]));
      break;
    case 2:
      prism(in[0], cut(in[0], gone[0]), cut(in[0], gone[1]), in[1], cut(in[1], gone[0]), cut(in[1], gone[1]));
      break;
    case 1:
      out.push_back({in[0], cut(in[0], gone[0]), cut(in[0], gone[1]), cut(in[0], gone[2])});
      break;
    default:
      break;
  }
}

/// Corners at which A presses at least as hard as B.
int count_above(const std::array<MarchVertex, 4>& corner) {
  return static_cast<int>(std::count_if(corner.begin(), corner.end(), [](const MarchVertex& v) { return v.a - v.b >= 0.0; }));
}

}  // namespace

void MarchRuleSolver::add_facet(Polygon& polygon, int count) {
  count = clip_polygon(polygon, count, [](const MarchVertex& v) { return 0.5 * (v.a + v.b); });
  if (count < 3) return;
  count = clip_polygon(polygon, count, [](const MarchVertex& v) { return 0.5 * (v.a + v.b) - v.third; });
  if (count < 3) return;
  Vec3 doubled = Vec3::Zero(), first = Vec3::Zero();
  double total = 0.0;
  for (int i = 1; i + 1 < count; ++i) {
    const Vec3 &p = polygon[0].x, &q = polygon[static_cast<std::size_t>(i)].x;
    const Vec3& r = polygon[static_cast<std::size_t>(i + 1)].x;
    const Vec3 n = (q - p).cross(r - p);
    const double twice = n.norm();
    doubled += n;
    total += twice;
    first += twice / 3.0 * (p + q + r);
  }
  const double norm = doubled.norm();
  if (!(norm > 0.0) || !(total > 0.0)) return;
  facet_.point.push_back(first / total);
  facet_normal_.push_back(doubled / norm);
  facet_area_.push_back(0.5 * norm);
}

void MarchRuleSolver::add_squeezed(const Tetrahedron& corner, int side) {
  const auto own = [side](const MarchVertex& v) { return side == 0 ? v.a : v.b; };
  const auto other = [side](const MarchVertex& v) { return side == 0 ? v.b : v.a; };
  const auto run = [&](const auto& f) {
    kept_.clear();
    for (const Tetrahedron& piece : pieces_) clip_tetrahedron(piece, f, kept_);
    pieces_.swap(kept_);
  };
  pieces_.assign(1, corner);
  run(own);
  run([&](const MarchVertex& v) { return other(v) - own(v); });
  run([&](const MarchVertex& v) { return own(v) - v.third; });
  double volume = 0.0;
  Vec3 first = Vec3::Zero();
  for (const Tetrahedron& t : pieces_) {
    const double v = std::abs((t[1].x - t[0].x).cross(t[2].x - t[0].x).dot(t[3].x - t[0].x)) / 6.0;
    volume += v;
    first += 0.25 * v * (t[0].x + t[1].x + t[2].x + t[3].x);
  }
  if (!(volume > 0.0)) return;
  volume_point_.push_back(first / volume);
  volume_weight_.push_back(volume);
  volume_side_.push_back(static_cast<std::uint8_t>(side));
}

void MarchRuleSolver::cut_tetrahedron(const Tetrahedron& corner) {
  const int above = count_above(corner);
  if (above > 0 && above < 4) {
    std::array<const MarchVertex*, 4> up{}, down{};
    std::size_t ups = 0, downs = 0;
    for (const MarchVertex& v : corner) {
      if (v.a - v.b >= 0.0) {
        up[ups++] = &v;
      } else {
        down[downs++] = &v;
      }
    }
    const auto cut = [](const MarchVertex& p, const MarchVertex& q) { return between(p, q, p.a - p.b, q.a - q.b); };
    Polygon polygon;
    int count = 3;
    if (ups == 2) {
      polygon[0] = cut(*up[0], *down[0]);
      polygon[1] = cut(*up[0], *down[1]);
      polygon[2] = cut(*up[1], *down[1]);
      polygon[3] = cut(*up[1], *down[0]);
      count = 4;
    } else {
      const MarchVertex& lone = ups == 1 ? *up[0] : *down[0];
      const auto& others = ups == 1 ? down : up;
      for (std::size_t i = 0; i < 3; ++i) polygon[i] = cut(lone, *others[i]);
    }
    add_facet(polygon, count);
  }
}

template <class Visit>
Box MarchRuleSolver::for_tetrahedra(const Visit& visit) {
  const auto& n = cells_;
  const auto index = [&](std::size_t i, std::size_t j, std::size_t k) { return (k * (n[1] + 1) + j) * (n[0] + 1) + i; };
  Box held;
  // Six tetrahedra around the main diagonal of a cell: one for each order of the axes.
  constexpr std::array<std::array<std::size_t, 2>, 6> kPaths{{{1, 3}, {1, 5}, {2, 3}, {2, 6}, {4, 5}, {4, 6}}};
  for (std::size_t k = 0; k < n[2]; ++k) {
    for (std::size_t j = 0; j < n[1]; ++j) {
      for (std::size_t i = 0; i < n[0]; ++i) {
        std::array<std::size_t, 8> at;
        bool a_somewhere = false, b_somewhere = false;
        for (std::size_t c = 0; c < 8; ++c) {
          at[c] = index(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
          a_somewhere = a_somewhere || node_.a[at[c]] > 0.0;
          b_somewhere = b_somewhere || node_.b[at[c]] > 0.0;
        }
        if (!a_somewhere || !b_somewhere) continue;
        held.include(node_.point[at[0]]);
        held.include(node_.point[at[7]]);
        const auto vertex = [&](std::size_t c) { return MarchVertex{node_.point[at[c]], node_.a[at[c]], node_.b[at[c]], third_[at[c]]}; };
        for (const auto& path : kPaths) {
          const Tetrahedron corner{vertex(0), vertex(path[0]), vertex(path[1]), vertex(7)};
          const bool a = std::any_of(corner.begin(), corner.end(), [](const MarchVertex& v) { return v.a > 0.0; });
          const bool b = std::any_of(corner.begin(), corner.end(), [](const MarchVertex& v) { return v.b > 0.0; });
          if (a && b) visit(corner);
        }
      }
    }
  }
  return held;
}

void MarchRuleSolver::squeeze() {
  volume_point_.clear();
  volume_weight_.clear();
  volume_side_.clear();
  (void)for_tetrahedra([this](const Tetrahedron& corner) {
    const int above = count_above(corner);
    if (above < 4) add_squeezed(corner, 0);
    if (above > 0) add_squeezed(corner, 1);
  });
}

Box MarchRuleSolver::march(PairPressure& pressure, std::span<const ContactBody* const> third, const Box& box,
                           int cells) {
  const Vec3 extent = box.extent();
  const double cell = extent.maxCoeff() / cells;
  auto& n = cells_;
  for (std::size_t k = 0; k < 3; ++k) {
    n[k] = static_cast<std::size_t>(std::max(2.0, std::ceil(extent[static_cast<Eigen::Index>(k)] / cell - 1e-9)));
  }
  const Vec3 step(extent[0] / static_cast<double>(n[0]), extent[1] / static_cast<double>(n[1]),
                  extent[2] / static_cast<double>(n[2]));
  const auto index = [&](std::size_t i, std::size_t j, std::size_t k) {
    return (k * (n[1] + 1) + j) * (n[0] + 1) + i;
  };
  node_.resize((n[0] + 1) * (n[1] + 1) * (n[2] + 1));
  for (std::size_t k = 0; k <= n[2]; ++k) {
    for (std::size_t j = 0; j <= n[1]; ++j) {
      for (std::size_t i = 0; i <= n[0]; ++i) {
        node_.point[index(i, j, k)] =
            box.lower + Vec3(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)).cwiseProduct(step);
      }
    }
  }
  pressure.evaluate_values(node_);
  third_.assign(node_.size(), third.empty() ? -std::numeric_limits<double>::max() : -std::numeric_limits<double>::infinity());
  value_.resize(node_.size());
  for (const ContactBody* body : third) {
    body->field.evaluate(node_.point, value_);
    for (std::size_t i = 0; i < node_.size(); ++i) {
      third_[i] = std::max(third_[i], body->material.modulus * value_[i]);
    }
  }

  facet_.point.clear();
  facet_normal_.clear();
  facet_area_.clear();
  return for_tetrahedra([this](const Tetrahedron& corner) { cut_tetrahedron(corner); });
}

/// Moves the centroids of the facets onto Sigma along the facets' normals and sums up.
void MarchRuleSolver::place_on_sigma(PairPressure& pressure, double cell, const Vec3& reference,
                                     PatchPoints& points) {
  points.clear();
  sums_ = {};
  thickness_ = 0.0;
  const std::size_t n = facet_.point.size();
  facet_.resize(n);
  const double enough = 1e-12 * pressure.largest_modulus();
  constexpr int kSteps = 8;
  for (int iteration = 0; iteration < kSteps; ++iteration) {
    pressure.evaluate(facet_);
    bool moved = false;
    for (std::size_t i = 0; i < n && iteration + 1 < kSteps; ++i) {
      const double gap = facet_.a[i] - facet_.b[i];
      if (std::abs(gap) <= enough) continue;
      const double rate = (facet_.slope_b[i] - facet_.slope_a[i]).dot(facet_normal_[i]);
      if (rate == 0.0) continue;
      facet_.point[i] += std::clamp(gap / rate, -cell, cell) * facet_normal_[i];
      moved = true;
    }
    if (!moved) break;
  }
  double largest = 0.0;
  PeakLine peak;
  for (std::size_t i = 0; i < n; ++i) {
    const double p = 0.5 * (facet_.a[i] + facet_.b[i]);
    const Vec3 across = facet_.slope_b[i] - facet_.slope_a[i];
    const double steepness = across.norm();
    const double gap = std::abs(facet_.a[i] - facet_.b[i]);
    if (!(p > 0.0) || !(steepness > 0.0) || gap > 1e-10 * pressure.largest_modulus()) continue;
    const Vec3 normal = across / steepness;
    // A facet that is seen at a slant stands for more of Sigma; a crumpled one keeps its own area.
    const double cosine = std::abs(normal.dot(facet_normal_[i]));
    const double weight = facet_area_[i] / (cosine > 0.5 ? cosine : 1.0);
    sums_.add(facet_.point[i] - reference, normal, weight, p);
    points.point.push_back(facet_.point[i]);
    points.normal.push_back(normal);
    points.area.push_back(weight);
    points.pressure.push_back(p);
    points.residual = std::max(points.residual, gap);
    if (p > largest) {
      largest = p;
      peak = {facet_.point[i], normal};
    }
  }
  if (largest > 0.0) thickness_ = depth(pressure, 0, peak, cell) + depth(pressure, 1, peak, cell);
}

/// Distance along the normal from the peak to where the pressure of one body vanishes; steps are at most a cell.
double MarchRuleSolver::depth(PairPressure& pressure, int side, const PeakLine& peak, double cell) {
  const double sign = side == 0 ? 1.0 : -1.0;
  double t = 0.0;
  constexpr int kSteps = 200;
  for (int i = 0; i < kSteps; ++i) {
    const Vec3 x = peak.point + (sign * t) * peak.normal;
    double p;
    Vec3 slope;
    pressure.evaluate(side, {&x, 1}, {&p, 1}, {&slope, 1});
    const double fall = -sign * slope.dot(peak.normal);
    const double step = fall > 0.0 ? std::clamp(p / fall, -cell, cell) : std::copysign(cell, p);
    t += step;
    if (std::abs(step) < 1e-6 * cell) break;
  }
  return t;
}

bool MarchRuleSolver::solve(PairPressure& pressure, std::span<const ContactBody* const> third, const Box& overlap,
                            double error, int refinements, const Vec3& reference, PatchPoints& points) {
  estimate_ = 1.0;
  points.clear();
  if (overlap.empty() || !overlap.lower.allFinite() || !overlap.upper.allFinite()) return false;
  Box box = overlap.inflated(1e-6 * overlap.extent().maxCoeff());
  // The first grid only finds the box of the overlap.
  const Box held = march(pressure, third, box, kFirstCells);
  if (held.empty()) return false;
  box = held.intersection(box);
  PatchSums coarse;
  bool known = false;
  for (int level = 0, cells = kFirstCells; level <= refinements && cells <= kFinestCells; ++level, cells *= 2) {
    march(pressure, third, box, cells);
    place_on_sigma(pressure, box.extent().maxCoeff() / cells, reference, points);
    if (!(sums_.load > 0.0)) continue;
    if (known) {
      estimate_ = relative_difference(sums_, coarse);
      if (estimate_ <= error) break;
    }
    coarse = sums_;
    known = true;
  }
  if (!known) return false;

  squeeze();
  for (const int side : {0, 1}) {
    facet_.point.clear();
    const std::size_t begin = points.volume_point.size();
    for (std::size_t i = 0; i < volume_point_.size(); ++i) {
      if (volume_side_[i] != side) continue;
      points.volume_point.push_back(volume_point_[i]);
      points.volume_weight.push_back(volume_weight_[i]);
      points.volume_side.push_back(static_cast<std::uint8_t>(side));
      points.displaced[side] += volume_weight_[i];
    }
    value_.resize(points.volume_point.size() - begin);
    pressure.evaluate(side, std::span(points.volume_point).subspan(begin), value_);
    for (std::size_t i = 0; i < value_.size(); ++i) {
      points.energy += points.volume_weight[begin + i] * std::max(value_[i], 0.0);
    }
  }
  return true;
}

}  // namespace supple::collision
