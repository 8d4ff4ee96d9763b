/// @file sample_rule.h
/// Quadrature on any Sigma by surface samples (Gascuel 1993; Desbrun & Gascuel 1995): where the seed rays of both bodies
/// cross Sigma there is a point, and the area across the ray over its cosine to Sigma's normal is its weight. Every ray
/// bundle sweeps its primitive's whole support, so a partition of unity over the primitives of both bodies, by
/// contribution and cosine, makes one sum of all bundles. Cells that the rim cuts count with the part inside. Order 2.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "supple/collision/contact_surface.h"
#include "surface/pair_pressure.h"
#include "surface/patch_points.h"

namespace supple::collision {

class SampleRuleSolver {
 public:
  struct Limits {
    double error;             ///< relative, asked for
    int refinements;          ///< times that the spacing of the seeds is halved, at most
    std::size_t rays;         ///< of both bodies, looked at in one layout
    std::size_t evaluations;  ///< of pressures, in all layouts, about: with more of them there is nothing, unless the error is met
  };
  struct Job {
    PairPressure& pressure;
    std::span<const ContactBody* const> third;  ///< bodies whose larger pressure takes space away from the pair
    Box overlap;
    Regions regions;  ///< what is wanted of the squeezed regions
    Vec3 reference;   ///< origin of the moments in `sums`
    double spacing;   ///< of the seeds to begin with [m], > 0
    Limits limits;
  };
  /// Halves the spacing of the seeds until two consecutive layouts agree to the error asked for, within the job's limits.
  /// @return whether Sigma was met, within the limits; false too where neither body has a skeleton
  bool solve(const Job& job, PatchPoints& points);

  [[nodiscard]] const PatchSums& sums() const noexcept { return sums_; }
  [[nodiscard]] double estimate() const noexcept { return estimate_; }
  [[nodiscard]] double thickness() const noexcept { return thickness_; }  ///< about the point of largest pressure [m]

 private:
  /// The rays of one body in world axes, and their stretch inside the overlap's box.
  struct Rays {
    std::vector<Vec3> foot, direction, spread;
    std::vector<double> begin, end, reach;
    std::vector<std::uint32_t> primitive, first;  ///< stations of ray r are [first[r], first[r + 1])
    std::vector<double> station;                  ///< along the ray [m]
    std::vector<double> gap, own;                 ///< p_A - p_B and the own pressure at the stations [Pa]
    [[nodiscard]] std::size_t size() const noexcept { return foot.size(); }
    [[nodiscard]] Vec3 at(std::size_t ray, double t) const { return foot[ray] + t * direction[ray]; }
    [[nodiscard]] double swept(std::size_t ray, double t) const {
      return std::max(spread[ray].x() + t * (spread[ray].y() + t * spread[ray].z()), 0.0);
    }
    void clear();
  };
  /// Where a ray crosses Sigma, or a stretch in which it does.
  struct Crossing {
    std::uint32_t side, ray;
    double low, high, t;
    bool falls;  ///< p_A - p_B falls along the ray
  };
  /// A stretch of a ray within the own squeezed region.
  struct Column {
    std::uint32_t ray;
    double begin, end;
  };

  [[nodiscard]] Box shrink(const Box& overlap) const;
  std::size_t send(PairPressure& pressure, int side, const Box& box, double spacing);
  void find_crossings(PairPressure& pressure, double scale);
  void third_pressures(std::span<const ContactBody* const> third);
  void place_points(PairPressure& pressure, std::span<const ContactBody* const> third, const Vec3& reference, PatchPoints& points);
  void shares(const PressureBatch& at);
  /// Contribution of every primitive of one body at the points of `parts_`, one call a primitive that is not zero there.
  template <class Use>
  void for_contributions(int side, std::size_t point, const Vec3& x, const Use& use) const;
  void add_columns(PairPressure& pressure, int side, std::span<const ContactBody* const> third, PatchPoints& points);
  void add_columns_across(PairPressure& pressure, int side, PatchPoints& points);

  std::array<const ContactBody*, 2> body_{};
  std::array<Rays, 2> rays_;
  std::array<implicit::FieldParts, 2> parts_;
  implicit::SampleLayout layout_;
  std::vector<Crossing> crossings_;
  std::vector<std::uint32_t> open_;
  std::vector<Column> column_;
  PressureBatch at_, moved_;
  std::vector<double> share_, third_, value_, weight_;
  std::vector<Vec3> slope_, third_slope_;
  PatchSums sums_;
  double spacing_ = 0.0;
  double largest_cell_ = 0.0;  // on Sigma, by share [m^2]
  bool edge_on_ = false;  // Sigma passes where rays begin
  double estimate_ = 1.0;
  double thickness_ = 0.0;
};

}  // namespace supple::collision
