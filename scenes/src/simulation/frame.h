/// Everything that one force evaluation or one picture computes and can recompute. Each block is written by one stage;
/// capacity is reused from step to step.
#pragma once

#include <optional>
#include <functional>
#include <variant>
#include <vector>

#include "supple/collision/deformed_field.h"
#include "supple/collision/find_contacts.h"
#include "supple/collision/linearise.h"
#include "supple/collision/react.h"
#include "supple/collision/sleep.h"
#include "supple/core/content_versions.h"
#include "supple/core/executor.h"
#include "supple/implicit/creases.h"
#include "supple/implicit/delaunay.h"
#include "supple/implicit/field.h"
#include "supple/implicit/march_cubes.h"
#include "supple/implicit/partition_mesher.h"
#include "supple/implicit/solids.h"
#include "supple/scenes/division.h"
#include "supple/scenes/mesh_search.h"
#include "supple/scenes/model.h"
#include "supple/scenes/simulation.h"

namespace supple::scenes {

/// Position and motion of a fixed body in this frame.
struct LedSolid {
  std::variant<std::monostate, implicit::HalfSpace, implicit::SolidBox, implicit::MovedField> solid;  ///< none: it is at rest
  Pose pose;
  Vec3 velocity = Vec3::Zero();
  Vec3 spin = Vec3::Zero();
};

/// Meshers of bodies that touch, one for each lattice and error. Their kept data are valid for any state.
struct DivisionMeshers {
  struct OnLattice {
    double cell = 0.0;
    double error = 0.0;  ///< 0: no error is given
    bool used = true;    ///< in this frame
    implicit::PartitionMesher mesher{};             ///< without an error
    implicit::PartitionErrorMesher error_mesher{};  ///< with one
  };
  std::vector<OnLattice> mesher;
  ContentVersions fields, pressures;
};

struct Frame {
  // place_skeleton and index_field, by body
  std::vector<std::vector<Pose>> pose;
  std::vector<std::vector<Vec3>> velocity;
  std::vector<std::vector<Vec3>> spin;
  std::vector<implicit::PlacedSkeleton> placed;
  std::vector<Box> reach;                     ///< box of all supports; holds the surface box
  std::vector<Box> surface_box;               ///< of the bodies that are reached, and of the fixed ones
  std::vector<implicit::Field> field;
  std::vector<std::uint8_t> indexed;          ///< 1: `field` belongs to this frame
  std::uint64_t primitives_present = 0;       ///< of all bodies
  std::uint64_t bodies_present = 0;           ///< that collide
  std::uint64_t samples_present = 0;          ///< of these
  std::vector<implicit::CubeMesher> mesher;   ///< by body; keeps data of primitives that do not move
  std::vector<implicit::CreaseMesher> creases;  ///< the same for those whose blend leaves creases
  DivisionMeshers dividing;                   ///< keep data of touching bodies that do not move
  SearchCounts missed;                        ///< by the last meshes
  std::vector<std::uint8_t> convex;           ///< 1: a contact body that is convex; shape [bodies + fixed ones]
  std::vector<std::uint8_t> near;             ///< 1: its supports reach another body
  std::vector<std::uint32_t> reached;         ///< bodies in `reaching`, ascending; the others have no flags
  std::vector<collision::BodyPair> reaching;  ///< pairs whose supports reach one another, sorted
  collision::OverlapList reach_list;          ///< finds `reaching`
  // sample_surface, by body
  std::vector<std::vector<std::uint8_t>> active;
  std::vector<std::vector<Box>> shared;               ///< boxes shared with other bodies, in which rays search
  std::vector<implicit::SurfaceSamples> samples;
  std::vector<implicit::RigidSamples> rigid_samples;  ///< of bodies of one part whose kernels do not change
  std::vector<LedSolid> led;                          ///< shape [fixed bodies]
  // find_contacts, solve_contact_surface, react
  std::vector<collision::ContactBody> bodies;         ///< and the fixed ones after them
  std::vector<collision::BodyPair> pairs;
  std::optional<std::uint64_t> pairs_present;         ///< number of allowed pairs, once counted
  collision::ContactCandidates candidates;
  collision::ContactSurface surface;
  std::vector<collision::PartLoads> loads;    ///< by body
  std::vector<collision::PartLoads> dissipative;  ///< the dissipative part of `loads`, by body
  std::vector<std::uint32_t> pressed;         ///< contact bodies in `surface`, ascending: the only ones with loads
  collision::ReactionReport reaction;
  std::vector<Vec3> traction_force;           ///< by pair of `surface`
  std::vector<double> pair_power;             ///< dissipated by damping and friction [W], by pair of `surface`
  std::vector<double> friction_speed;         ///< below which friction falls to zero [m/s], 0 without friction, by pair of `surface`
  collision::LineariseScratch linearise;      ///< of implicit steps

  // resting bodies, placed once
  std::vector<std::uint32_t> resting;         ///< ascending
  collision::BoxTree resting_boxes;           ///< their `reach`
  bool resting_placed = false;                ///< false: to be placed again

  Frame(const Model& model, const std::vector<Body>& all);
};

/// Which stages of a step are measured.
enum class StepTiming : std::uint8_t {
  None,
  Sample,  ///< it stands for steps that are not measured
  Apart,   ///< it stands for itself
};

/// Measures one call of a stage: the first one, and those of steps that are measured.
class StageTimer {
 public:
  StageTimer(StageProfile& profile, StepTiming timing);
  ~StageTimer();
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  StageProfile& profile_;
  StepTiming timing_;
  double begin_ = 0.0;
};

struct StageContext {
  const Model& model;
  const std::vector<Body>& bodies;
  const collision::ContactRules& rules;
  const Executor& executor;
  Profile& profile;
  bool skip = true;
  StepTiming timing = StepTiming::None;               ///< of the stages
  const implicit::DelaunayMesher* delaunay = nullptr;
  const std::atomic<int>* interrupt = nullptr;        ///< see SimulationOptions::interrupt
  double time = 0.0;                                  ///< at which obstacles are placed [s]
  double step = 0.0;                                  ///< time for which loads are constant [s]; 0: loads are not held
  const std::vector<std::uint32_t>* awake = nullptr;  ///< bodies that move, ascending; null: all
  const collision::StickState* sticks = nullptr;
  const std::function<bool(const Box&)>* shown = nullptr;  ///< selects surfaces to mesh, by their bounding boxes; null: all
  double contact_error = 0.0;                         ///< of contact, where it is more than that of the scene
  std::uint64_t most_kept = implicit::kMostKeptToError;  ///< limit of kept data of meshes to an error, for all meshers of bodies that touch no other [byte]
};

/// The body whose smallest particle this is; or the first one after it.
[[nodiscard]] std::uint32_t body_led_by(const std::vector<Body>& bodies, std::uint32_t particle);

/// Whether a body is at rest.
[[nodiscard]] bool rests(const StageContext& context, std::size_t body);

/// Stages 2 and 3 for one body.
void place_and_index(const StageContext& context, const core::ParticleState& particles, std::size_t body, Frame& frame);

/// The same for every body with a surface.
void place_and_index_all(const StageContext& context, const core::ParticleState& particles, Frame& frame);

/// Stage 2 for the bodies that collide, and the positions of fixed ones at context.time.
void place_contact_bodies(const StageContext& context, const core::ParticleState& particles, Frame& frame);

/// Resting bodies whose supports reach a fixed body that moves in [context.time, until], at its position at either end [s].
[[nodiscard]] std::vector<std::uint32_t> find_stirred(const StageContext& context, const core::ParticleState& particles, double until,
                                                      Frame& frame);

/// Everything that the field of a body depends on, to the bit; fixed bodies follow the others.
void add_field_content(const std::vector<Body>& bodies, const Frame& frame, std::uint32_t body, ContentWords& words);

/// Stage 9 on the deformed fields, one mesh per object, with the columns that its look needs; the meshes of several pieces are
/// concatenated. @param laws  the laws without broken bonds
[[nodiscard]] std::vector<Mesh> polygonise_objects(const StageContext& context, const Division& division, const State& state,
                                                   const core::Interactions& laws, Frame& frame);

/// Replaces the names of arguments of meshers and grids by the scene's keys, or by the keys they follow from.
/// @param cell, error  objects that may have their own values; null: those of the scene
[[nodiscard]] Error with_keys_of(const Model& model, const Error& failure, const ObjectModel* cell, const ObjectModel* error);

}  // namespace supple::scenes
