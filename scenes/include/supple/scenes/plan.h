/// @file supple/scenes/plan.h
/// Which stages a scene runs, decided once, in a table that can be printed (`supple explain`).
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "supple/core/integrators.h"
#include "supple/core/parts.h"
#include "supple/scenes/accuracy.h"
#include "supple/scenes/model.h"

namespace supple::scenes {

/// In the order of one frame. Interact to Integrate run once per step, Polygonise to Export once per output frame.
enum class Stage : std::uint8_t {
  Interact,
  PlaceSkeleton,
  IndexField,
  SampleSurface,
  FindContacts,
  SolveContactSurface,
  React,
  Integrate,
  Polygonise,
  Render,
  Export,
};
inline constexpr int kStageCount = 11;

/// What stages read and write, as a bit mask.
using DataMask = std::uint32_t;
namespace data {
inline constexpr DataMask kState = 1u << 0;      ///< particles, kept samples, the ledger
inline constexpr DataMask kForces = 1u << 1;
inline constexpr DataMask kSkeleton = 1u << 2;
inline constexpr DataMask kField = 1u << 3;
inline constexpr DataMask kSamples = 1u << 4;
inline constexpr DataMask kPairs = 1u << 5;
inline constexpr DataMask kContacts = 1u << 6;
inline constexpr DataMask kMesh = 1u << 7;
inline constexpr DataMask kImage = 1u << 8;
}  // namespace data

struct StageInfo {
  Stage stage;
  std::string_view name;    ///< of the function, e.g. "find_contacts"
  std::string_view module;
  DataMask reads;
  DataMask writes;
};
[[nodiscard]] std::span<const StageInfo> stage_table();
[[nodiscard]] const StageInfo& info(Stage stage);

/// The outputs that a run writes.
struct OutputRequest {
  bool images = false;
  bool film = false;
  bool meshes = false;
  bool grids = false;
  bool contacts = false;
  bool particles = false;
  bool samples = false;
};
/// The outputs that the scene's `output` requests.
[[nodiscard]] OutputRequest requested_outputs(const Scene& scene);

struct PlannedStage {
  Stage stage;
  bool on = false;
  std::string reason;
};

struct StepPlan {
  std::vector<PlannedStage> stages;  ///< all of them, in order
  [[nodiscard]] bool on(Stage stage) const;
};

/// The integration method of a scene, and the reason for it.
struct IntegratorPlan {
  core::IntegratorSettings settings;
  double pair_frequency = 0.0;  ///< largest of the pair laws about rest [rad/s]
  double damping_rate = 0.0;    ///< largest of friction between particles and stiffness damping, about rest [1/s]
  bool chosen = false;          ///< chosen by the cost model: `integrator.method` is auto and the scene does not fix the step
  std::string reason;
  /// Frequency that limits the step [rad/s]. The adaptive method finds its own; implicit methods need none, but one chosen by `auto` resolves contact.
  double limiting_frequency = 0.0;
  StepBounds bounds;            ///< of automatic steps
  double slow_slip = 1e-3;      ///< see core::ImplicitContact
};

/// `auto` chooses velocity Verlet unless a frame needs more of its steps than `time_step.max_substeps`, or more by
/// kImplicitCost than of backward Euler at its own limits: a count of steps, never a clock.
/// With `accuracy` it chooses velocity Verlet or implicit midpoint, whichever reaches it at less cost. Explicit steps must be short for stability, for
/// friction, which they blur below a speed that grows with the step, and for the damping of pairs, whose half steps let what is damped faster than a step
/// relax too fast. A step of implicit midpoint counts as kImplicitStepCost explicit ones where bodies touch and as `implicit_pair_cost` elsewhere; where
/// stability limits explicit steps, what does are vibrations, whose phase implicit ones would lose, and it counts as kImplicitCost. The method
/// `implicit` is implicit midpoint in steps that resolve contact: of second order, it needs an eighth of the steps of backward Euler for the
/// same error. Where the scene fixes steps that are longer than contacts last, it is backward Euler, which is stable there.
[[nodiscard]] IntegratorPlan plan_integrator(const Scene& scene, const Model& model);

/// Of implicit methods: the speed below which friction falls to zero [m/s]. Bodies held by friction creep no faster, so it is far below the
/// visible.
[[nodiscard]] double stick_speed(const Scene& scene, const Model& model);

/// Approximate cost of a step of backward Euler in steps of velocity Verlet: three corrections, each with the Hessian of
/// every pair and a Cholesky factor, are worth 110 for a chain of 10 particles and 2300 for a shell of 1000.
inline constexpr int kImplicitCost = 1024;

/// The same of implicit midpoint at the tolerance of an accuracy: 9 to 11 for a jelly of 64 particles that tumbles down stairs.
inline constexpr int kImplicitStepCost = 10;

/// The same where `damping_ratio` or `rayleigh` damps the fastest vibrations within a period: they have no phase that long steps could lose, and an
/// explicit step with such damping is as long as seven others. 5 for a block of 360 particles.
inline constexpr int kDampedStepCost = 8;

/// The same without contact, 32 for a spiral of ten particles; it grows with their number as a step of backward Euler does.
[[nodiscard]] double implicit_pair_cost(std::size_t particles);

/// The limits of a step for particles of these speeds [m/s], [rad/s]; gravity adds its speed of one frame.
[[nodiscard]] core::StepLimits step_limits(const Scene& scene, const Model& model, double frequency,
                                           const core::Speeds& speeds);

/// Every stage with the reason it is on or off.
/// @post well_formed(plan)
[[nodiscard]] StepPlan plan_step(const Scene& scene, const Model& model, const OutputRequest& outputs);

/// Every stage that is on reads only what State holds or an earlier stage wrote.
[[nodiscard]] bool well_formed(const StepPlan& plan);

}  // namespace supple::scenes
