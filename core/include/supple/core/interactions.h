/// @file supple/core/interactions.h
/// Everything that acts on the particles of a scene except contact: bonded and geometric pair laws, friction
/// between particles, medium damping, external loads, gravity. Built once from a scene, then const.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "supple/core/cohesion_variants.h"
#include "supple/core/directed_form.h"
#include "supple/core/executor.h"
#include "supple/core/gay_berne.h"
#include "supple/core/lennard_jones.h"
#include "supple/core/literal_form.h"
#include "supple/core/neighbours.h"
#include "supple/core/pair_laws.h"
#include "supple/core/particles.h"

namespace supple::core {

/// A law on a fixed list of pairs; index k is the same bond in `first`, `second` and `law`.
template <class Law>
struct BondedLaw {
  std::string name;                    ///< name for users: "spiral/bond_frame"
  std::vector<std::uint32_t> first;    ///< particle A, shape [bonds]
  std::vector<std::uint32_t> second;   ///< particle B, A < B, shape [bonds]
  std::vector<Law> law;                ///< shape [bonds]
};

/// The pairs of a geometric law, by the kinds of the particles.
enum class PairKinds : std::uint8_t {
  Any,
  Incomplete,            ///< those that do not interact completely, two hinges among them
  IncompleteButHinges,   ///< the same without two hinges
  Complete,              ///< those that interact completely, two hinges not among them
  CompleteWithHinges,    ///< the same with two hinges
};

[[nodiscard]] inline bool takes_kinds(PairKinds kinds, std::uint32_t kind_a, std::uint32_t kind_b) {
  switch (kinds) {
    case PairKinds::Any: return true;
    case PairKinds::Incomplete: return !interact_completely(kind_a, kind_b, false);
    case PairKinds::IncompleteButHinges: return !interact_completely(kind_a, kind_b, true);
    case PairKinds::Complete: return interact_completely(kind_a, kind_b, false);
    case PairKinds::CompleteWithHinges: return interact_completely(kind_a, kind_b, true);
  }
  return false;
}

/// A law between every two particles of two objects (or of one) that are nearer than its range.
template <class Law>
struct GeometricLaw {
  std::string name;
  std::uint32_t object_a = 0;
  std::uint32_t object_b = 0;  ///< may equal object_a
  double range = 0.0;          ///< [m]; the law must vanish there
  Law law;
  PairKinds kinds = PairKinds::Any;
  [[nodiscard]] bool takes(const ParticleSet& set, std::uint32_t a, std::uint32_t b) const {
    const bool one_type = set.kind.empty();
    return takes_kinds(kinds, one_type ? 0 : set.kind[a], one_type ? 0 : set.kind[b]);
  }
};

/// Friction between particles, momentum-conserving: a force -c v_rel at the mid point of the pair, v_rel being the
/// relative velocity there, and a couple c_r times the relative spin. Zero for rigid motion, power never positive.
struct Friction {
  std::string name;
  std::vector<std::uint32_t> first, second;  ///< A < B, shape [bonds]
  double linear = 0.0;    ///< c [N s/m]
  double angular = 0.0;   ///< c_r [N m s]
};

/// Drag of a surrounding medium on one object: F = -gamma m v, tau = -gamma_r I omega.
struct MediumDamping {
  std::uint32_t object = 0;
  double linear = 0.0;   ///< gamma [1/s]
  double angular = 0.0;  ///< gamma_r [1/s]
};

/// Rayleigh's damping of deformation in one object, F = -beta K q': K is the stiffness of each of its pairs, the positive
/// semi-definite Hessian at the present pose without the rigid motions of the pair. A mode of frequency omega gets the
/// damping ratio beta omega / 2; momentum and angular momentum stay.
struct StiffnessDamping {
  std::uint32_t object = 0;
  double time = 0.0;  ///< beta [s]
};

/// A factor as a function of time: linear between the times, constant before the first and after the last.
struct Course {
  std::vector<double> time;    ///< [s], rising, at least one
  std::vector<double> factor;  ///< [1], shape of `time`
  [[nodiscard]] double at(double t) const;
  [[nodiscard]] double largest() const;  ///< of the absolute values
};

/// A force and a torque on one particle during a time window, ramped linearly at both ends.
struct ExternalLoad {
  std::uint32_t particle = 0;
  Vec3 force = Vec3::Zero();    ///< [N], world axes
  Vec3 torque = Vec3::Zero();   ///< [N m], world axes
  double begin = 0.0;           ///< [s]
  double end = 0.0;             ///< [s], the first time without load; may be infinite
  double ramp = 0.0;            ///< rise and fall time inside the window [s]
  std::shared_ptr<const Course> course{};  ///< a factor besides; null: 1
  [[nodiscard]] double factor(double time) const;  ///< in [0, 1] without a course
  /// Mean of the factor over [from, to], from < to: a step with this mean gets the whole impulse of a load of any duration.
  [[nodiscard]] double mean(double from, double to) const;
  /// Whether the factor changes in [from, to]; a change at either end counts, also one that rounding puts just before `from`: of
  /// successive steps, the one that ends as the load begins and the one after it both return true.
  [[nodiscard]] bool changes(double from, double to) const;

 private:
  [[nodiscard]] double window(double time) const;
  [[nodiscard]] double mean_of_window(double from, double to) const;
};

struct Interactions {
  std::vector<BondedLaw<Cohesion>> cohesion;
  std::vector<BondedLaw<Form>> form;
  std::vector<BondedLaw<FormRadius>> form_radius;
  std::vector<BondedLaw<BondFrame>> bond_frame;
  std::vector<BondedLaw<Coplanarity>> coplanarity;
  std::vector<BondedLaw<NormalisedCoplanarity>> normalised_coplanarity;
  std::vector<BondedLaw<CoNormality>> co_normality;
  std::vector<BondedLaw<CoCircularity>> co_circularity;
  std::vector<BondedLaw<NormalisedCoCircularity>> normalised_co_circularity;
  std::vector<BondedLaw<LennardJones>> lennard_jones;
  std::vector<BondedLaw<LinearCohesion>> linear_cohesion;
  std::vector<BondedLaw<DirectedCohesion>> directed_cohesion;
  std::vector<BondedLaw<TabulatedCohesion>> tabulated_cohesion;
  std::vector<BondedLaw<DirectedForm>> directed_form;
  std::vector<BondedLaw<LiteralForm>> literal_form;  ///< has no energy and counts as 0
  std::vector<GeometricLaw<Cohesion>> geometric_cohesion;
  std::vector<GeometricLaw<LinearCohesion>> geometric_linear_cohesion;
  std::vector<GeometricLaw<TabulatedCohesion>> geometric_tabulated_cohesion;
  std::vector<GeometricLaw<LennardJones>> geometric_lennard_jones;
  std::vector<GeometricLaw<SwitchedGayBerne>> gay_berne;
  std::vector<GeometricLaw<Coplanarity>> geometric_coplanarity;      ///< of these three the weight ends at the range
  std::vector<GeometricLaw<CoNormality>> geometric_co_normality;
  std::vector<GeometricLaw<CoCircularity>> geometric_co_circularity;
  std::vector<GeometricLaw<Repulsion>> repulsion;
  std::vector<Friction> friction;
  std::vector<MediumDamping> medium;
  std::vector<StiffnessDamping> stiffness_damping;
  std::vector<ExternalLoad> external;
  Vec3 gravity = Vec3::Zero();  ///< [m/s^2]
  /// External loads are means over this span of time [s], that of a step; without extent, they are those of the moment.
  std::array<double, 2> load_span{};

  /// Number of pair laws; friction and external loads are not counted.
  [[nodiscard]] std::size_t law_count() const;
};

/// Every two particles with a bonded law between them, once: A < B, ascending. Pictures of bonds show these.
[[nodiscard]] std::vector<std::array<std::uint32_t, 2>> bonded_pairs(const Interactions& interactions);

/// Energy [J], forces and torques of one law, for `query forces` and for audits.
struct LawReport {
  std::string name;
  double energy = 0.0;
  Loads loads;
};

/// Counts of one evaluation, for `--profile`.
struct InteractionCounts {
  std::uint64_t pairs_visited = 0;
  std::uint64_t pairs_present = 0;
};

/// Per-particle gather lists and buffers, made once; capacity is kept between steps. Frame data.
class InteractionWorkspace {
 public:
  InteractionWorkspace(const ParticleSet& set, const Interactions& interactions);
  ~InteractionWorkspace();
  InteractionWorkspace(InteractionWorkspace&&) noexcept;
  InteractionWorkspace& operator=(InteractionWorkspace&&) noexcept;
  struct Impl;
  Impl& impl() { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

/// Stage 1. Adds the conservative pair loads (not friction and not medium damping: those are part of `advance`).
/// Deterministic: each particle gathers its pairs in a fixed order. @pre `loads` is sized to the particles
InteractionCounts accumulate_interactions(const ParticleSet& set, const ParticleState& state,
                                          const Interactions& interactions, const Executor& executor,
                                          InteractionWorkspace& workspace, Loads& loads);

/// Adds gravity and the external loads of the moment `time` or, where `load_span` has an extent, their means over it.
/// @pre `external` is sized to the particles
void add_external_loads(const ParticleSet& set, const Interactions& interactions, double time, Loads& external);

/// Gravity and the external loads, as means over [from, to] or, where both are one, of that moment; replaces the loads.
void external_loads(const ParticleSet& set, const Interactions& interactions, double from, double to, Loads& external);

/// Potential energy of all pair laws [J] (gravity and external loads are counted as external work). A geometric law is
/// counted from the end of its range, so that a pair that comes or goes there changes nothing.
[[nodiscard]] double potential_energy(const ParticleSet& set, const ParticleState& state,
                                      const Interactions& interactions);

/// The same, law by law, with loads; also one report each for "gravity" and "external" (energy 0).
[[nodiscard]] std::vector<LawReport> report_laws(const ParticleSet& set, const ParticleState& state,
                                                 const Interactions& interactions, double time);

/// Upper bound of the largest angular frequency of the pair laws about rest [rad/s]: omega^2 <= max_i (2/m_i) sum_j k_ij
/// for translation plus the same with inertia and torsional stiffness for rotation.
[[nodiscard]] double largest_frequency(const ParticleSet& set, const ParticleState& rest,
                                       const Interactions& interactions);

}  // namespace supple::core
