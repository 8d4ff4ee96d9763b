/// @file pair_solver.h
/// The contact surface of one pair: which rule fits, the polar one first.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "supple/collision/find_contacts.h"
#include "surface/march/march_rule.h"
#include "surface/pair_result.h"
#include "surface/panels/panel_rule.h"
#include "surface/polar/imprint.h"
#include "surface/polar/polar_patches.h"
#include "surface/region/squeezed_region.h"
#include "surface/third_bodies.h"

namespace supple::collision {

/// Bodies by pair, to find third ones: the partners of body i are partner[offset[i] .. offset[i + 1]), rising.
struct Partners {
  std::vector<std::uint32_t> offset, partner;

  void build(std::size_t bodies, std::span<const BodyPair> pairs);
  [[nodiscard]] std::span<const std::uint32_t> of(std::uint32_t i) const {
    return std::span(partner).subspan(offset[i], offset[i + 1] - offset[i]);
  }
};

/// What find_shared_apex says of a body that several others meet.
struct SharedApex {
  std::optional<Apex> apex;
  std::size_t taker = 0;
  bool searched = false;
  std::size_t pair = 0;           ///< whose evaluations the search counts among
  std::uint64_t evaluations = 0;
};

/// What is asked of all pairs.
struct ContactQuery {
  std::span<const ContactBody> bodies;
  const ContactCandidates& candidates;
  const Partners& partners;
  std::span<const Box> boxes;              ///< of the bodies' surfaces
  std::span<const SharedApex> shared_apex;  ///< of the bodies; empty where no energies are asked for
  const ContactSettings& settings;
};

/// The solver of one thread; its buffers are reused.
class PairSolver {
 public:
  /// One search for all pairs of a body, where others may press on any of them.
  SharedApex find_apex(const ContactQuery& query, std::uint32_t body);
  /// @param k  of the candidate pairs
  void solve(const ContactQuery& query, std::size_t k, PairResult& out);

 private:
  /// A pair as the rules need it.
  struct Job {
    std::span<const ContactBody> bodies;
    std::span<const Box> boxes;
    const Box& overlap;
    std::span<const Vec3> seeds;
    BodyPair pair;
    const ContactBody &a, &b;
    PolarJob polar;
    bool convex;
    [[nodiscard]] const ContactSettings& settings() const { return polar.settings; }
  };

  bool join_team(std::span<const ContactBody> bodies, const ContactCandidates& candidates, const Partners& partners, const BodyPair& pair);
  void find_thirds(const Job& job, const Partners& partners);
  /// Of third bodies on the patches of a pair: nowhere near as hard, or harder on some of them, or all over.
  enum class Pressing : std::uint8_t { None, Some, All };
  Pressing thirds_press(const Job& job, const PairResult& out);
  bool thirds_press_beside(const Job& job, const PairResult& out);
  SharedApex search_apex(PairPressure& pressure, std::size_t side, const ContactQuery& query, std::uint32_t body);
  void find_apexes(Job& job, const ContactQuery& query);
  void add_flows(const Job& job, PairResult& out);
  [[nodiscard]] static bool fills_regions(const Job& job) {
    return job.settings().energy && (job.polar.regions[0] != Region::None || job.polar.regions[1] != Region::None);
  }
  void find_patches(const Job& job);
  bool rings(const Job& job, double error, PairResult& out);
  bool polar(const Job& job, PairResult& out);
  bool imprints_cut(const Job& job, PairResult& out);
  bool stars_cut(const Job& job, double asked, PairResult& out);
  bool polar_cut(const Job& job, PairResult& out);
  /// What imprints take of the patches, over their area and force, to about a tenth: the latter at most.
  struct Taken {
    double area = 0.0, force = 0.0;
  };
  std::optional<Taken> taken_by_imprints(const Job& job, const PairResult& out);
  bool may_leave_imprints(const Job& job, PairResult& out);
  bool march(const Job& job, PairResult& out, bool alone = false);
  bool panels(const Job& job, PairResult& out);
  bool march_instead(const Job& job, PairResult& out);
  [[nodiscard]] bool suits_panels(const Job& job) const;
  void choose(const Job& job, PairResult& out);
  void take_all_thirds(const Job& job);
  void take_third_levels(const Job& job);
  void begin_anew(const Job& job, PairResult& out);
  static double region_error(const ContactSettings& settings);
  void fill_unsure_regions(const Job& job, PairResult& out);
  void fill_beyond_thirds(const Job& job, PairResult& out);
  static bool may_lie_within(const Job& job, int side);
  void fill_within(const Job& job, bool equal, std::optional<int> softer, PairResult& out);
  template <class Rule, class Solve>
  bool solve_in_order(const Job& job, Rule& rule, ContactRule name, const Solve& solve, PairResult& out);

  PolarPatches patches_;
  ImprintFinder imprint_;
  MarchRuleSolver march_;
  PanelRoom panel_room_;
  PeakFinder finder_;
  StartPoints starts_;
  std::vector<ThirdLevel> third_levels_;
  std::vector<ImprintPlace> imprints_;
  std::vector<FreePlace> free_;  ///< among the points of patches that third bodies press on
  std::vector<PatchShare> share_;
  SqueezedRegion region_;
  Teams teams_;                  ///< of the body of the pair
  const Team* team_ = nullptr;   ///< of the pair's obstacle
  Box team_overlap_;
  std::vector<Vec3> team_seeds_;
  std::vector<std::uint32_t> third_;
  ThirdBodies thirds_;  ///< in the same order
  std::vector<const ContactBody*> third_bodies_;
  std::vector<double> value_, hardest_;
  std::vector<Vec3> rim_;
  std::vector<std::uint8_t> taken_;  ///< of points and rims, 1: a third body presses harder
  PressureBatch beside_;
  std::array<std::optional<Apex>, 2> apex_{};  ///< that what A, B lose to several bodies flows out of
  std::vector<const ContactBody*> others_;
  bool cut_by_thirds_ = false;       ///< a third body may press harder on a part of Sigma, or of what the bodies lose
  std::optional<Taken> little_;      ///< where that is little
  PairResult kept_;  ///< what another rule has left
};

}  // namespace supple::collision
