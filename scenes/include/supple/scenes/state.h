/// @file supple/scenes/state.h
/// Exactly what is needed to continue a run with the same bits; a saved state is this struct in a file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "supple/collision/sleep.h"
#include "supple/collision/stick.h"
#include "supple/core/error.h"
#include "supple/core/integrate.h"
#include "supple/core/links.h"
#include "supple/core/particles.h"
#include "supple/implicit/surface_samples.h"
#include "supple/scenes/model.h"

namespace supple::scenes {

/// Results of a run so far for result.json; kept over restarts, not part of the hash.
struct RunRecord {
  struct ObjectRecord {
    double largest_deformation = 0.0;  ///< RMS after the best rigid fit over the rest diameter; 0 of separate bodies [1]
    double final_shape_error = 0.0;    ///< the same, now
  };
  core::Motion initial;                ///< at frame 1
  double initial_energy = 0.0;         ///< kinetic + pair + contact at frame 1 [J]
  double largest_energy = 0.0;         ///< of the same [J]
  double momentum_scale = 0.0;         ///< largest so far [N s]
  double angular_momentum_scale = 0.0; ///< largest so far [N m s]
  double momentum_error = 0.0;         ///< largest |P - P0 - impulses| [N s]
  double angular_momentum_error = 0.0; ///< [N m s]
  double energy_error = 0.0;           ///< largest |E - E0 - W + D| [J]
  double most_dissipated = 0.0;        ///< largest D at a frame so far [J]
  double energy_returned = 0.0;        ///< largest fall of D below that [J]; dissipation never returns energy
  double contact_residual = 0.0;       ///< largest |p_A - p_B| / max(P_A, P_B) on a contact sample [1]
  double largest_overlap = 0.0;        ///< thickness of the overlap of undeformed fields [m]
  double largest_overlap_share = 0.0;  ///< the same over twice the smaller iso radius [1]
  std::vector<ObjectRecord> objects;
  /// A pair whose energy exceeded half of its capacity: the first time and the largest energy.
  struct Overload {
    std::string a, b;                  ///< names of the bodies
    double time = 0.0;                 ///< [s]
    double energy = 0.0;               ///< of approach and contact [J]
    double capacity = 0.0;             ///< largest contact energy of the pair [J]
  };
  std::vector<Overload> overloads;
  /// Work dissipated by damping and friction of a pair since the start: the integral of the power over the steps, springs of friction included.
  struct PairWork {
    collision::BodyPair bodies;
    double work = 0.0;                 ///< [J]
    double power = 0.0;                ///< at the end of the last step [W]
  };
  std::vector<PairWork> pair_work;     ///< of all pairs with dissipation, sorted by bodies
  /// Contact of two objects, or of an object and an obstacle, so far: summed over their bodies, taken at the end of every step. A and B are their numbers, those of
  /// obstacles after those of objects; forces are those on A, of implicit steps the means over the step.
  struct PairContact {
    collision::BodyPair objects;
    std::uint64_t touches = 0;         ///< contacts that began
    double contact_time = 0.0;         ///< [s]
    double peak_force = 0.0;           ///< [N]
    double peak_time = 0.0;            ///< [s]
    Vec3 impulse = Vec3::Zero();       ///< integral of the force [N s]
    double largest_depth = 0.0;        ///< overlap of the undeformed bodies [m]
    double first_begin = 0.0;          ///< of the first contact [s]
    double first_end = -1.0;           ///< [s]; negative: it lasts
    double approach_speed = 0.0;       ///< before the first contact: of the centres of mass against its impulse [m/s]
    double rebound_speed = 0.0;        ///< after it, along its impulse [m/s]
    // The present contact, or the last one.
    bool touching = false;
    bool begun = false;                ///< in the last step
    Vec3 force = Vec3::Zero();         ///< at the end of the last step; zero without contact [N]
    double depth = 0.0, depth_before = 0.0;  ///< at the end of the last step and of the one before [m]
    double last_step = 0.0;            ///< length of the last step in contact [s]
    double touch_begin = 0.0;          ///< [s]
    Vec3 touch_impulse = Vec3::Zero(); ///< [N s]
    Vec3 touch_velocity = Vec3::Zero();  ///< of the centre of mass of A relative to that of B before it [m/s]
  };
  std::vector<PairContact> pair_contacts;  ///< of all pairs that ever touched, sorted by objects
  std::uint64_t core_impulses = 0;     ///< pairs that hard cores turned back
  /// A solid, and whether the surface of an object may have come to it. Those that none came to have no part in the motion.
  struct Solid {
    std::string name;
    bool reached = false;
  };
  std::vector<Solid> solids;           ///< in the order of Model::fixed
  /// Boxes that hold the surface of an object with contact in the steps so far, one for `reach_frames` frames after the other [m]; by object, the last ones may be left out.
  std::vector<std::vector<Box>> reach;
  std::uint64_t reach_frames = 1;
  bool valid = false;
};

struct State {
  std::int32_t frame = 1;              ///< the frame this state shows when substep is 0
  std::int32_t substep = 0;            ///< steps done towards the next frame, < 2^halvings
  std::int32_t halvings = 0;           ///< the current step is frame time / 2^halvings
  std::uint64_t steps = 0;             ///< steps since the start
  core::ParticleState particles;
  core::KickState kick;
  core::Ledger ledger;
  core::LinkState links;               ///< broken and yielded bonds
  std::vector<double> broken_for;      ///< time since each link broke, up to its object's `fade` [s], shape [links]
  std::vector<implicit::VolumeState> volumes;  ///< by object, or by its particles or primitives
  ApartPairs apart;                    ///< pieces of one object that can touch each other now
  std::vector<implicit::SampleState> samples;  ///< by body
  collision::SleepState sleep;         ///< sleeping bodies; empty where the scene has no `sleep`
  collision::StickState sticks;        ///< springs of friction; empty where the scene has no `contact.stick`
  RunRecord record;

  [[nodiscard]] std::uint64_t hash() const;    ///< of everything but the record
};

/// The scene that a state belongs to.
struct StateOrigin {
  std::uint64_t scene = 0;                   ///< Scene::content_hash
  std::shared_ptr<const std::string> keys{}; ///< Scene::motion_keys, so that a message can name those that differ; may be empty
};
[[nodiscard]] StateOrigin origin_of(const Scene& scene);

/// Requirements of a saved state besides being complete and of the scene.
struct StateWanted {
  std::optional<int> frame{};  ///< the state at this frame, as written by `supple run`; absent: any
  bool same_program = false;   ///< saved by this build of the program, whose results have the same bits
  std::string otherwise{};     ///< what else to do about a state of another scene: "or ..."
  /// Not null: a state of another scene is accepted, and this says in which keys they differ: "objects.ball.particles.mass=2 (here 1)".
  std::string* differences = nullptr;
  /// Not null: a state of another scene is accepted, and this receives that scene.
  StateOrigin* belongs_to = nullptr;
};

/// A damaged file: it is truncated, or a byte of it changed.
class DamagedState : public Error {
 public:
  using Error::Error;
};

/// Saved states: versioned, little-endian, with a hash over the content, the scene, its keys and the build of the program.
void save_state(const std::filesystem::path& path, const State& state, const StateOrigin& origin);
/// @throws DamagedState; Error{Corrupt} when the state is complete but does not meet the requirements; Error{Io}
[[nodiscard]] State load_state(const std::filesystem::path& path, const StateOrigin& origin, const StateWanted& wanted = {});

/// The scene that draws a saved state. It is the given one where that has written the state. Where the two differ in solids at rest that no surface came to up to
/// this state, as `RunRecord::reach` and `solids` prove, it is the given one with those solids out of contact, and the state belongs to it. Otherwise it is the given
/// one, and `load_state` refuses.
[[nodiscard]] Scene scene_to_draw(const Scene& scene, const std::filesystem::path& state);

}  // namespace supple::scenes
