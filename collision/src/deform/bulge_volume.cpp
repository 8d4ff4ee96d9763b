#include "deform/bulge_volume.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "numbers.h"

namespace supple::collision {
namespace {

constexpr double kTolerance = 1e-3;       // of a volume
constexpr int kFinest = 8;                // halvings of the first spacing of lines
constexpr std::size_t kMostLines = 1'000'000;
constexpr std::size_t kBatch = 1024;      // points

/// The cubic through values and slopes at t = 0 and 1.
struct Cubic {
  double c0 = 0.0, c1 = 0.0, c2 = 0.0, c3 = 0.0;
  Cubic() = default;
  Cubic(double value0, double slope0, double value1, double slope1)
      : c0(value0), c1(slope0), c2(3.0 * (value1 - value0) - 2.0 * slope0 - slope1), c3(2.0 * (value0 - value1) + slope0 + slope1) {}
  [[nodiscard]] double at(double t) const { return c0 + t * (c1 + t * (c2 + t * c3)); }
  [[nodiscard]] double slope(double t) const { return c1 + t * (2.0 * c2 + 3.0 * t * c3); }
  /// Of the corners of its control polygon, which hold it for t in [0, 1].
  [[nodiscard]] Interval range() const {
    const double b1 = c0 + c1 / 3.0, b2 = c0 + (2.0 * c1 + c2) / 3.0, b3 = c0 + c1 + c2 + c3;
    return {std::min({c0, b1, b2, b3}), std::max({c0, b1, b2, b3})};
  }
};

/// Where a cubic that is below `level` at `low` and above it at 1 has it: Newton's method within what bisection leaves.
double where(const Cubic& u, double level, double low) {
  double high = 1.0, t = low;
  for (int k = 0; k < 60; ++k) {
    const double off = u.at(t) - level;
    (off < 0.0 ? low : high) = t;
    double next = t - off / u.slope(t);
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    if (std::abs(next - t) < 1e-12) return next;
    t = next;
  }
  return t;
}

/// How lines lie: `across` of them through a cube along each of two axes.
struct Spacing {
  double size = 0.0;  ///< of the cubes [m]
  int across = 2;
};

/// -p of another body along a line.
struct Around {
  std::size_t other = 0;  ///< of the quadrature
  Cubic depth;
};

/// Lines through the cubes in which the bulge around one neighbour may hold something, one array per attribute.
struct Lines {
  std::vector<double> weight;  ///< area for which a line stands times its length [m^3]
  std::vector<double> begin;   ///< where they leave the own body, or 0
  std::vector<Cubic> depth;    ///< -p of the own body, which rises
  std::vector<std::size_t> last;  ///< of each line's `around`
  std::vector<Around> around;     ///< the neighbour, then others that may have a part
  [[nodiscard]] std::size_t size() const { return weight.size(); }
  [[nodiscard]] std::span<const Around> around_of(std::size_t line) const {
    const std::size_t first = line == 0 ? 0 : last[line - 1];
    return std::span(around).subspan(first, last[line] - first);
  }
  void clear() {
    weight.clear();
    begin.clear();
    depth.clear();
    last.clear();
    around.clear();
  }
};

class Quadrature {
 public:
  Quadrature(const BulgingBody& body, std::span<const WantedBulge> wanted) : body_(body), wanted_(wanted), profile_(wanted.size()) {
    for (const WantedBulge& w : wanted) others_.push_back({.body = w.other, .reach = w.width});
    for (const std::uint32_t j : body.limiting) {
      auto place = std::find_if(others_.begin(), others_.end(), [j](const Other& o) { return o.body == j; });
      if (place == others_.end()) place = others_.insert(place, {.body = j});
      place->limits = true;
      place->reach = std::max(place->reach, body.most);
    }
  }

  void set_height(std::size_t bulge, double height) {
    const double stiffness = wanted_[bulge].stiffness;
    profile_[bulge] = {.stiffness = stiffness, .height = height, .width = effective_width(wanted_[bulge].width, height, stiffness)};
  }
  [[nodiscard]] double height(std::size_t bulge) const { return profile_[bulge].height; }

  /// Lines through cubes of a size, enough for heights up to `height`. @return false where there would be too many
  [[nodiscard]] bool lay(std::size_t bulge, const Spacing& spacing, double height, Lines& out) const {
    std::vector<Vec3> cubes;
    if (!find_cubes(bulge, spacing, height, cubes)) return false;
    out.clear();
    for (std::size_t first = 0; first < cubes.size(); first += kBatch) {
      add_lines(bulge, std::span(cubes).subspan(first, std::min(kBatch, cubes.size() - first)), spacing, height, out);
    }
    return true;
  }

  /// What a bulge holds [m^3]. @param meets  set to true where another one takes part
  [[nodiscard]] double volume(std::size_t bulge, const Lines& lines, bool& meets) const {
    double sum = 0.0;
    for (std::size_t line = 0; line < lines.size(); ++line) {
      const double length = length_of(bulge, lines.begin[line], lines.depth[line], lines.around_of(line), meets);
      if (length > 0.0) sum += lines.weight[line] * length;
    }
    return sum;
  }

 private:
  struct Other {
    std::uint32_t body = 0;
    bool limits = false;  ///< no bulge reaches into it
    double reach = 0.0;   ///< -p from where on it has no part [Pa]
  };

  /// Centres of the cubes of a lattice about the centre of pressure.
  [[nodiscard]] bool find_cubes(std::size_t bulge, const Spacing& spacing, double height, std::vector<Vec3>& out) const {
    const WantedBulge& w = wanted_[bulge];
    const double size = spacing.size;
    const std::size_t most = kMostLines / static_cast<std::size_t>(spacing.across * spacing.across);
    const ContactBody& own = body_.bodies[body_.body];
    const ContactBody& other = body_.bodies[w.other];
    const double width = effective_width(w.width, height, w.stiffness);
    const double reach = std::max((body_.box.upper - w.centre).maxCoeff(), (w.centre - body_.box.lower).maxCoeff());
    double half = 0.5 * size;
    while (half < reach) half *= 2.0;
    struct Cube {
      Vec3 centre;
      double half;
    };
    std::vector<Cube> open{{w.centre, half}};
    while (!open.empty()) {
      const Cube cube = open.back();
      open.pop_back();
      const Box box{cube.centre - Vec3::Constant(cube.half), cube.centre + Vec3::Constant(cube.half)};
      const Interval around = other.field.bound(box);
      if (around.lower >= 0.0 || other.material.modulus * around.upper <= -width) continue;
      const Interval inside = own.field.bound(box);
      if (inside.lower >= 0.0 || own.material.modulus * inside.upper <= -highest_in(bulge, height, box)) continue;
      if (cube.half < 0.75 * size) {
        if (out.size() == most) return false;
        out.push_back(cube.centre);
        continue;
      }
      for (int k = 7; k >= 0; --k) {
        const Vec3 corner((k & 1) != 0 ? 0.5 : -0.5, (k & 2) != 0 ? 0.5 : -0.5, (k & 4) != 0 ? 0.5 : -0.5);
        open.push_back({cube.centre + cube.half * corner, 0.5 * cube.half});
      }
    }
    return true;
  }

  /// Of all bulges together in a box at most, where one has a height.
  [[nodiscard]] double highest_in(std::size_t bulge, double height, const Box& box) const {
    double sum = height;
    for (std::size_t k = 0; k < wanted_.size(); ++k) {
      const ContactBody& other = body_.bodies[wanted_[k].other];
      if (k != bulge && other.material.modulus * other.field.bound(box).upper > -wanted_[k].width) sum += wanted_[k].highest;
    }
    return std::min(sum, body_.most);
  }

  /// A piece of a line.
  struct Piece {
    Vec3 from, to;
    [[nodiscard]] Vec3 at(double t) const { return from + t * (to - from); }
  };

  /// -p of a body along pieces of lines, shape [pieces].
  [[nodiscard]] static std::vector<Cubic> depths(const ContactBody& body, std::span<const Piece> pieces) {
    std::vector<Vec3> end, slope(2 * pieces.size());
    std::vector<double> value(2 * pieces.size());
    end.reserve(2 * pieces.size());
    for (const Piece& piece : pieces) end.insert(end.end(), {piece.from, piece.to});
    body.field.evaluate(end, value, slope);
    const double scale = -body.material.modulus;
    std::vector<Cubic> depth;
    depth.reserve(pieces.size());
    for (std::size_t k = 0; k < pieces.size(); ++k) {
      const Vec3 along = scale * (pieces[k].to - pieces[k].from);
      depth.emplace_back(scale * value[2 * k], along.dot(slope[2 * k]), scale * value[2 * k + 1], along.dot(slope[2 * k + 1]));
    }
    return depth;
  }

  /// The same of all others of the quadrature; none of those that have no part in a box around the pieces.
  [[nodiscard]] std::vector<std::vector<Cubic>> depths_around(std::size_t bulge, std::span<const Piece> pieces) const {
    Box box;
    for (const Piece& piece : pieces) {
      box.include(piece.from);
      box.include(piece.to);
    }
    std::vector<std::vector<Cubic>> depth(others_.size());
    for (std::size_t j = 0; j < others_.size() && !pieces.empty(); ++j) {
      const ContactBody& body = body_.bodies[others_[j].body];
      if (j == bulge || -body.material.modulus * body.field.bound(box).upper < others_[j].reach) depth[j] = depths(body, pieces);
    }
    return depth;
  }

  /// Adds what of the lines through cubes may hold something with bulges up to a height.
  void add_lines(std::size_t bulge, std::span<const Vec3> cubes, const Spacing& spacing, double height, Lines& out) const {
    const ContactBody& own = body_.bodies[body_.body];
    const double size = spacing.size;
    const int across = spacing.across;
    std::vector<double> value(cubes.size());
    std::vector<Vec3> slope(cubes.size());
    own.field.evaluate(cubes, value, slope);
    std::vector<Piece> line;
    for (std::size_t n = 0; n < cubes.size(); ++n) {
      int axis = 0;
      slope[n].cwiseAbs().maxCoeff(&axis);
      const Vec3 half = std::copysign(0.5 * size, -slope[n][axis]) * Vec3::Unit(axis);  // outwards
      for (int k = 0; k < across * across; ++k) {
        Vec3 at = cubes[n];
        at[(axis + 1) % 3] += ((k % across + 0.5) / across - 0.5) * size;
        at[(axis + 2) % 3] += ((k / across + 0.5) / across - 0.5) * size;
        line.push_back({at - half, at + half});
      }
    }
    // Only the way from the surface to the highest bulge counts: cubics through its ends.
    const double width = effective_width(wanted_[bulge].width, height, wanted_[bulge].stiffness), most = std::min(others_most(bulge) + height, body_.most);
    const std::vector<Cubic> whole = depths(own, line), away = depths(body_.bodies[wanted_[bulge].other], line);
    std::vector<Piece> piece;
    std::vector<std::uint8_t> begins;  // 1: at the surface
    for (std::size_t k = 0; k < line.size(); ++k) {
      const Cubic& of = whole[k];
      const bool within = of.at(0.0) < 0.0;
      if (of.at(0.0) >= most || of.at(1.0) <= 0.0) continue;
      const Interval range = away[k].range();
      if (range.lower >= width || range.upper <= 0.0) continue;
      const double begin = within ? where(of, 0.0, 0.0) : 0.0, end = of.at(1.0) > most ? where(of, most, begin) : 1.0;
      if (!(begin < end)) continue;
      piece.push_back({line[k].at(begin), line[k].at(end)});
      begins.push_back(within ? 1 : 0);
    }
    const std::vector<Cubic> depth = depths(own, piece);
    const std::vector<std::vector<Cubic>> around = depths_around(bulge, piece);
    const double area = size * size / (across * across);
    for (std::size_t k = 0; k < piece.size(); ++k) {
      out.weight.push_back(area * (piece[k].to - piece[k].from).norm());
      out.begin.push_back(begins[k] != 0 && depth[k].c1 > 0.0 ? -depth[k].c0 / depth[k].c1 : 0.0);
      out.depth.push_back(depth[k]);
      out.around.push_back({bulge, around[bulge][k]});
      for (std::size_t j = 0; j < others_.size(); ++j) {
        if (j != bulge && !around[j].empty() && around[j][k].range().lower < others_[j].reach) out.around.push_back({j, around[j][k]});
      }
      out.last.push_back(out.around.size());
    }
  }

  [[nodiscard]] double others_most(std::size_t bulge) const {
    double sum = 0.0;
    for (std::size_t k = 0; k < wanted_.size(); ++k) sum += k != bulge ? wanted_[k].highest : 0.0;
    return sum;
  }

  struct Lift {
    double all = 0.0, own = 0.0;
  };
  /// Of all bulges together, and the share of one of them.
  [[nodiscard]] Lift lift(std::size_t bulge, std::span<const Around> around, double t, bool& meets) const {
    Lift out;
    double limit = body_.most;
    for (const Around& a : around) {
      const double x = a.depth.at(t);
      if (others_[a.other].limits) limit = std::min(limit, x);
      if (a.other >= profile_.size()) continue;
      const double h = profile_[a.other].value(x);
      out.all += h;
      if (a.other == bulge) out.own = h;
    }
    if (!(out.own > 0.0)) return {};
    meets = meets || out.all > out.own;
    if (limit < out.all) {
      limit = std::max(limit, 0.0);
      out.own *= limit / out.all;
      out.all = limit;
    }
    return out;
  }

  /// Length of the part of a line in {p < 0 < p^}, times the share of a bulge in the sum there.
  [[nodiscard]] double length_of(std::size_t bulge, double begin, const Cubic& own, std::span<const Around> around, bool& meets) const {
    double most = 0.0;
    for (const BulgeProfile& h : profile_) most += h.height;
    most = std::min(most, body_.most);
    if (own.at(0.0) >= most) return 0.0;
    const double end = own.at(1.0) > most ? where(own, most, begin) : 1.0;
    if (!(begin < end)) return 0.0;
    const Cubic& away = around.front().depth;
    if (std::min(away.at(begin), away.at(end)) >= profile_[bulge].width) return 0.0;
    constexpr int kParts = 6;
    const double step = (end - begin) / kParts;
    double length = 0.0;
    const auto excess = [&](double t, Lift& up) {
      up = lift(bulge, around, t, meets);
      return up.all - own.at(t);
    };
    const auto share = [](const Lift& up) { return up.all > 0.0 ? up.own / up.all : 0.0; };
    Lift before, after;
    double t = begin, left = excess(t, before);
    for (int k = 1; k <= kParts; ++k) {
      const double u = begin + k * step, right = excess(u, after);
      if (left > 0.0 || right > 0.0) {
        double from = t, to = u;
        double from_share = share(before), to_share = share(after);
        if (left <= 0.0 || right <= 0.0) {
          // The root of the chord, and that of the chord to it.
          double low = t, high = u, low_value = left, high_value = right, cut = t;
          Lift there;
          for (int n = 0; n < 2; ++n) {
            cut = low + (high - low) * (low_value / (low_value - high_value));
            const double value = excess(cut, there);
            ((value > 0.0) == (low_value > 0.0) ? low : high) = cut;
            ((value > 0.0) == (low_value > 0.0) ? low_value : high_value) = value;
          }
          cut = low + (high - low) * (low_value / (low_value - high_value));
          (left <= 0.0 ? from : to) = cut;
          (left <= 0.0 ? from_share : to_share) = share(there);
        }
        length += 0.5 * (from_share + to_share) * (to - from);
      }
      t = u;
      left = right;
      before = after;
    }
    return length;
  }

  const BulgingBody& body_;
  std::span<const WantedBulge> wanted_;
  std::vector<BulgeProfile> profile_;
  std::vector<Other> others_;  ///< those with bulges first, in their order
};

/// One bulge on its way to its height.
struct Search {
  Spacing spacing;
  double laid = 0.0;       ///< the highest a0 that the lines hold [Pa]
  double volume = 0.0;     ///< at the present height
  bool meets = false;      ///< another bulge takes part
  bool solved = false;     ///< for these cubes, if no other bulge takes part
  bool settled = false;    ///< for good, but for the others
  Lines lines;
};

/// The height at which a bulge has its volume by its lines, within `tolerance` of it, as the others stand; or the highest one. The volume rises with the
/// height, at first by its square.
void solve(Quadrature& quadrature, std::size_t k, const WantedBulge& wanted, double tolerance, Search& search) {
  constexpr int kMost = 60;
  double low = 0.0, low_root = -1.0, high = wanted.highest, high_root = kInfinity;  // sqrt(V / wanted) - 1
  double height = quadrature.height(k);
  for (int n = 0; n < kMost; ++n) {
    if (height > search.laid) {
      search.laid = std::min(wanted.highest, 2.0 * height);
      while (!quadrature.lay(k, search.spacing, search.laid, search.lines)) search.spacing.size *= 2.0;
    }
    quadrature.set_height(k, height);
    search.volume = quadrature.volume(k, search.lines, search.meets);
    const double share = search.volume / wanted.volume, root = std::sqrt(share) - 1.0;
    if (std::abs(share - 1.0) <= tolerance || (root < 0.0 && height >= wanted.highest)) break;
    (root < 0.0 ? low : high) = height;
    (root < 0.0 ? low_root : high_root) = root;
    if (std::isfinite(high_root)) {
      const double margin = 1e-3 * (high - low);  // so that both ends move
      height = std::clamp(low + (high - low) * (low_root / (low_root - high_root)), low + margin, high - margin);
    } else {
      const double rise = std::clamp(1.05 / std::sqrt(share), 1.05, 4.0);  // to the other side, if it is a little more than a square
      height = std::min(rise * height, wanted.highest);
    }
  }
  search.solved = true;
}

/// Halves the spacing of a search's lines, by turns in the cubes and with these, which is settled where that changes little, or there would be too many.
void refine(const Quadrature& quadrature, std::size_t k, const WantedBulge& wanted, Search& search) {
  Lines finer;
  Spacing spacing = search.spacing;
  spacing.across *= 2;
  const double laid = std::min(wanted.highest, 1.1 * quadrature.height(k));  // the shorter the pieces, the better their cubics
  if (!quadrature.lay(k, spacing, laid, finer)) {
    search.settled = true;
    return;
  }
  search.laid = laid;
  const double volume = quadrature.volume(k, finer, search.meets);
  search.settled = std::abs(volume - search.volume) <= kTolerance * wanted.volume;
  search.spacing = spacing;
  search.volume = volume;
  search.lines = std::move(finer);
  search.solved = false;
}

}  // namespace

std::vector<FoundBulge> find_bulges(const BulgingBody& body, std::span<const WantedBulge> wanted) {
  constexpr int kMostRounds = 20;
  constexpr double kStill = 1e-2 * kTolerance;  // once the lines are settled
  Quadrature quadrature(body, wanted);
  std::vector<Search> search(wanted.size());
  for (std::size_t k = 0; k < wanted.size(); ++k) {
    search[k].spacing.size = 0.5 * wanted[k].zone;
    quadrature.set_height(k, std::min(wanted[k].guess, wanted[k].highest));
  }
  for (int level = 0;; ++level) {
    bool moved = true;
    for (int round = 0; round < kMostRounds && moved; ++round) {
      moved = false;
      for (std::size_t k = 0; k < wanted.size(); ++k) {
        if (search[k].solved && !search[k].meets) continue;
        const double before = quadrature.height(k), still = search[k].settled ? kStill : kTolerance;
        solve(quadrature, k, wanted[k], still, search[k]);
        moved = moved || (search[k].meets && std::abs(quadrature.height(k) - before) > still * before);
      }
    }
    if (level == kFinest || std::all_of(search.begin(), search.end(), [](const Search& s) { return s.settled; })) break;
    for (std::size_t k = 0; k < wanted.size(); ++k) {
      if (!search[k].settled) refine(quadrature, k, wanted[k], search[k]);
    }
  }
  std::vector<FoundBulge> found;
  for (std::size_t k = 0; k < wanted.size(); ++k) found.push_back({quadrature.height(k), search[k].volume});
  return found;
}

}  // namespace supple::collision
