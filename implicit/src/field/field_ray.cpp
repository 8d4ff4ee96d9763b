// Along a ray the squared distance q(t) of a convex shape is convex, and that of any shape, a minimum of parabolas, becomes
// concave when one parabola is taken off. So its values and slopes at the ends of an interval bound it in between to second
// order, and F and F' follow. An interval is dropped when F keeps its sign, finished by Newton when F' keeps its, else
// halved; what remains of a ray that touches the surface shrinks like the square root of the rounding.
#include "field/field_ray.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "field/field_index.h"
#include "supple/implicit/project.h"

namespace supple::implicit {
namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();

enum class Convexity : std::uint8_t { Convex, MinimumOfParabolas, Neither };

Convexity convexity_of(const ShapeView& view) noexcept {
  switch (view.kind) {
    case ShapeKind::Segment: return view.taper == 1.0 ? Convexity::Convex : Convexity::MinimumOfParabolas;
    case ShapeKind::Ring:
    case ShapeKind::Arc:
    case ShapeKind::Curve: return Convexity::MinimumOfParabolas;
    case ShapeKind::Directed: return Convexity::Neither;
    default: return Convexity::Convex;
  }
}

/// A primitive along the ray: y(t) = start + t along, in the frame of its shape.
struct Seen {
  const PackedShape* shape;
  Vec3 start, along;
  double enter, leave;  ///< t between which the ray is in the box of its support
  double bend;          ///< second derivative of the parabolas at most
  Convexity convexity;
};

struct EndValue {
  double q, slope;  ///< q and dq/dt
};

EndValue end_value(const Seen& seen, double t) noexcept {
  const FootSample sample = foot(seen.shape->view, seen.start + t * seen.along);
  return {sample.q, 2.0 * sample.half_gradient.dot(seen.along)};
}

/// Bounds of q and dq/dt over an interval of width h.
struct SquareRange {
  Interval q, slope;
};

SquareRange square_range(const Seen& seen, const EndValue& a, const EndValue& b, double h) noexcept {
  const double least = std::min(a.q, b.q), most = std::max(a.q, b.q);
  if (seen.convexity == Convexity::Convex) {
    double low = least;
    if (a.slope < 0.0 && b.slope > 0.0) {  // the minimum lies between, above where the tangents meet
      const double t = (b.slope * h - (b.q - a.q)) / (b.slope - a.slope);
      low = std::min(least, std::max(a.q + a.slope * std::clamp(t, 0.0, h), 0.0));
    }
    return {{low, most}, {std::min(a.slope, b.slope), std::max(a.slope, b.slope)}};
  }
  if (seen.convexity == Convexity::MinimumOfParabolas) {
    const double c = 0.5 * seen.bend;  // q - c t^2 is concave
    // Concave parts lie above their chord: q >= chord - c s (h - s), and below their tangents.
    const double low = std::max(least - 0.25 * c * h * h, 0.0);
    double high = most;
    const double left = a.slope, right = -b.slope;  // rises from either end inwards
    if (left > 0.0 || right > 0.0 || c > 0.0) {
      high = std::max(most, std::min(std::max(a.q, a.q + left * h + c * h * h), std::max(b.q, b.q + right * h + c * h * h)));
    }
    return {{low, high}, {b.slope - seen.bend * h, a.slope + seen.bend * h}};
  }
  const double steep = seen.shape->distance_scale;  // |dd/dt|; the ray's direction is a unit vector
  const double low = std::max(0.5 * (std::sqrt(a.q) + std::sqrt(b.q) - steep * h), 0.0);
  const double high = 0.5 * (std::sqrt(a.q) + std::sqrt(b.q) + steep * h);
  return {{low * low, high * high}, {-2.0 * high * steep, 2.0 * high * steep}};
}

/// Range of df/dq for q in a range; df/dq rises with q for kernels convex in q.
Interval slope_range(const Kernel& k, const Interval& q) noexcept {
  const double R2 = k.radius * k.radius;
  if (q.lower >= R2) return {0.0, 0.0};
  if (k.kind == KernelKind::Gascuel) {
    const double near = std::sqrt(q.lower), far = std::min(std::sqrt(q.upper), k.radius);
    const double steepest = lipschitz(k, near, far);
    if (!(near > 0.0)) return {-std::numeric_limits<double>::infinity(), 0.0};
    // df/dd is -slope up to the thickness, then a parabola that is monotone or has its vertex between: its least size is
    // at an end.
    const auto size = [&](double d) { return std::abs(2.0 * d * evaluate(k, d * d).slope); };
    const double flattest = std::min(size(near), q.upper >= R2 ? 0.0 : size(far));
    return {-steepest / (2.0 * near), -flattest / (2.0 * far)};
  }
  const double low = evaluate(k, q.lower).slope, high = evaluate(k, q.upper).slope;
  Interval range{std::min(low, high), std::max(low, high)};
  if (k.kind == KernelKind::BlancSchlick && q.lower < 0.25 * R2 && q.upper > 0.25 * R2) {
    range.lower = evaluate(k, 0.25 * R2).slope;
  }
  return range;
}

Interval product(const Interval& a, const Interval& b) noexcept {
  const auto times = [](double x, double y) { return x == 0.0 || y == 0.0 ? 0.0 : x * y; };
  const double p[4] = {times(a.lower, b.lower), times(a.lower, b.upper), times(a.upper, b.lower), times(a.upper, b.upper)};
  return {*std::min_element(p, p + 4), *std::max_element(p, p + 4)};
}

class Ray {
 public:
  Ray(const Field& field, const Vec3& origin, const Vec3& direction, double t_max)
      : field_(field), index_(field.index()), origin_(origin), direction_(direction), t_max_(t_max) {
    collect();
  }

  std::optional<double> first() {
    if (t_max_ == 0.0) return field_value(0.0) == 0.0 ? std::optional<double>(0.0) : std::nullopt;
    std::vector<Piece> stack;
    // Between the ends of supports the same primitives act; the first cuts are there.
    for (std::size_t i = cuts_.size(); i-- > 1;) stack.push_back({cuts_[i - 1], cuts_[i]});
    while (!stack.empty()) {
      const Piece piece = stack.back();
      stack.pop_back();
      const Verdict verdict = look(piece);
      if (verdict.root) return verdict.root;
      if (!verdict.split) continue;
      const double middle = 0.5 * (piece.from + piece.to);
      stack.push_back({middle, piece.to});
      stack.push_back({piece.from, middle});
    }
    return std::nullopt;
  }

 private:
  struct Piece {
    double from, to;
  };
  struct Verdict {
    std::optional<double> root = {};
    bool split = false;
  };

  [[nodiscard]] Vec3 at(double t) const { return origin_ + t * direction_; }
  [[nodiscard]] double field_value(double t) const { return FieldView(field_).value(at(t)); }

  void collect() {
    cuts_ = {0.0, t_max_};
    Box all;
    all.include(at(0.0));
    all.include(at(t_max_));
    for (const std::uint32_t id : candidates_of(index_, all)) {
      const Box& box = index_.support[id];
      double enter = 0.0, leave = t_max_;
      for (int k = 0; k < 3; ++k) {
        if (direction_[k] == 0.0) {
          if (origin_[k] < box.lower[k] || origin_[k] > box.upper[k]) leave = -1.0;
          continue;
        }
        const double a = (box.lower[k] - origin_[k]) / direction_[k], b = (box.upper[k] - origin_[k]) / direction_[k];
        enter = std::max(enter, std::min(a, b));
        leave = std::min(leave, std::max(a, b));
      }
      // A little wider: what rounding puts outside contributes zero all the same.
      const double slack = 8.0 * kEps * (origin_.cwiseAbs().maxCoeff() + std::abs(leave));
      if (enter > leave + 2.0 * slack) continue;
      const PackedPrimitive& p = index_.primitive[id];
      const PackedShape& shape = index_.shape[id];
      using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
      const Eigen::Map<const RowMajor> A(shape.to_local.data());
      Seen seen{.shape = &shape,
                .start = A * (origin_ - Vec3(p.position[0], p.position[1], p.position[2])),
                .along = A * direction_,
                .enter = std::max(enter - slack, 0.0),
                .leave = std::min(leave + slack, t_max_),
                .bend = 0.0,
                .convexity = convexity_of(shape.view)};
      const double width = std::min(1.0, shape.view.taper);
      seen.bend = 2.0 * seen.along.squaredNorm() / (width * width);
      seen_.push_back(seen);
      cuts_.push_back(seen.enter);
      cuts_.push_back(seen.leave);
    }
    std::sort(cuts_.begin(), cuts_.end());
    cuts_.erase(std::unique(cuts_.begin(), cuts_.end()), cuts_.end());
  }

  Verdict look(const Piece& piece) {
    const double h = piece.to - piece.from;
    Interval value{0.0, 0.0}, slope{0.0, 0.0};
    double f_from = 0.0, f_to = 0.0, scale = index_.iso;
    double terms = 0.0;
    for (const Seen& seen : seen_) {
      if (seen.leave < piece.from || seen.enter > piece.to) continue;
      const EndValue a = end_value(seen, piece.from), b = end_value(seen, piece.to);
      SquareRange range = square_range(seen, a, b, h);
      // Rounding of q, above all of curves.
      const double q_error = 1e-13 * (seen.start.squaredNorm() + piece.to * piece.to * seen.along.squaredNorm());
      const bool curved = seen.shape->foot == PackedFoot::Scalar;
      const double margin = curved ? q_error : 16.0 * kEps * (range.q.upper + q_error);
      range.q = {std::max(range.q.lower - margin, 0.0), range.q.upper + margin};
      const Kernel& k = seen.shape->kernel;
      value.lower += evaluate(k, range.q.upper).value;
      value.upper += evaluate(k, range.q.lower).value;
      const Interval part = product(slope_range(k, range.q), range.slope);
      slope.lower += part.lower;
      slope.upper += part.upper;
      f_from += evaluate(k, a.q).value;
      f_to += evaluate(k, b.q).value;
      scale += seen.shape->peak;
      terms += 1.0;
    }
    const double round_off = (16.0 + terms) * kEps * scale;
    const double from = f_from - index_.iso, to = f_to - index_.iso;
    value = {value.lower - index_.iso, value.upper - index_.iso};
    // The mean value form from either end.
    value.lower = std::max({value.lower, from + std::min(slope.lower, 0.0) * h, to - std::max(slope.upper, 0.0) * h});
    value.upper = std::min({value.upper, from + std::max(slope.upper, 0.0) * h, to - std::min(slope.lower, 0.0) * h});
    if (value.lower > round_off || value.upper < -round_off) return {};
    if (from == 0.0) return {.root = piece.from};
    const bool monotone = slope.lower > 0.0 || slope.upper < 0.0;
    const bool crosses = (from > 0.0) != (to > 0.0) || to == 0.0;
    if (crosses && monotone) {
      const Vec3 a = at(piece.from), b = at(piece.to);
      const double v_a = field_value(piece.from), v_b = field_value(piece.to);
      if (v_a * v_b > 0.0) return {.root = std::abs(v_a) < std::abs(v_b) ? piece.from : piece.to};  // by rounding alone
      const Vec3 root = root_on_segment(field_, a, b);
      return {.root = std::clamp((root - origin_).dot(direction_), piece.from, piece.to)};
    }
    const double finest = 4.0 * kEps * (piece.to + origin_.cwiseAbs().maxCoeff());
    if (h <= finest || (value.upper - value.lower <= 2.0 * round_off && std::min(std::abs(from), std::abs(to)) <= 4.0 * round_off)) {
      if (crosses || std::min(std::abs(from), std::abs(to)) <= 4.0 * round_off) {
        return {.root = std::abs(from) <= std::abs(to) ? piece.from : piece.to};  // touches
      }
      return {};
    }
    // Monotone and the ends on one side by more than their rounding: no root between.
    if (monotone && std::min(std::abs(from), std::abs(to)) > round_off) return {};
    return {.split = true};
  }

  const Field& field_;
  const Field::Index& index_;
  Vec3 origin_, direction_;
  double t_max_;
  std::vector<Seen> seen_;
  std::vector<double> cuts_;
};

}  // namespace

std::optional<double> intersect_primitives(const Field& field, const Vec3& origin, const Vec3& direction, double t_max) {
  return Ray(field, origin, direction, t_max).first();
}

}  // namespace supple::implicit
