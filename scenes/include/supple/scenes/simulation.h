/// @file supple/scenes/simulation.h
/// The simulation of a scene. Results are computed on request; reading meshes, contacts or audits never changes a later state.
///
///     #include <supple/scenes/read_scene.h>
///     #include <supple/scenes/simulation.h>
///
///     supple::scenes::Simulation simulation(supple::scenes::read_scene("ball_hits_spiral.yaml"));
///     while (simulation.frame() < simulation.scene().frame_count()) simulation.step_frame();
#pragma once

#include <array>
#include <atomic>
#include <functional>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "supple/core/content_versions.h"
#include "supple/core/mesh.h"
#include "supple/implicit/delaunay.h"
#include "supple/scenes/division.h"
#include "supple/scenes/mesh_search.h"
#include "supple/scenes/model.h"
#include "supple/scenes/plan.h"
#include "supple/scenes/state.h"

namespace supple::scenes {

struct SimulationOptions {
  int threads = 1;             ///< 0: all of the machine; the result does not depend on it
  bool skip = true;            ///< false: runs every stage on everything, for the test that skipping changes no bit
  bool profile = false;        ///< measure the time of every step, not of every 61st of those that are short
  implicit::DelaunayMesher delaunay{};  ///< for `meshing: {method: delaunay}`; empty: scenes with it are refused
  const std::atomic<int>* interrupt = nullptr;  ///< not 0: long calls throw Interrupted; see InterruptScope (core/interrupt.h)
  double memory = kDefaultMemory;  ///< limit of memory for the scene, by the counts made before it is built [byte]
  int finer = 0;               ///< steps are halved this many more times; negative: fewer times, but at most one step per frame
  bool divide = true;          ///< false: of bodies that do not bulge the meshes are whole where they touch, too, and overlap there: they look the same from outside, and cost less
  bool questions = false;      ///< for queries of states: an initial state that needs finer steps than time_step.max_substeps is refused by the first step, not earlier
};

/// Work of one stage so far.
struct StageProfile {
  std::uint64_t calls = 0;     ///< of `advance`: steps
  double cpu_s = 0.0;          ///< of this stage alone. Measured in every step after one of a millisecond and more; of others in the first and every 61st (a
                               ///< prime, so that events of period 2^k steps are sampled in proportion) and scaled by calls; where several frames are
                               ///< in work at the same time, divided so that the stages add up to the total
  double first_s = 0.0;        ///< measured of the first call: its set-up is not scaled
  double later_s = 0.0;        ///< measured of later calls that stand for others
  double apart_s = 0.0;        ///< of calls that stand for themselves, and of occasional work: not scaled
  std::uint64_t timed = 0;     ///< calls that stand for others
  std::uint64_t apart = 0;     ///< calls that stand for themselves
  std::uint64_t visited = 0;   ///< pairs, primitives, samples, blocks ... that were processed
  std::uint64_t present = 0;   ///< their total number
  std::uint64_t evaluations = 0;  ///< of fields, for contact surfaces
  /// Adds a measured call; `scale` brings `cpu_s` up to date.
  void book(double seconds, bool stands_for_itself);
  void scale();
};
using Profile = std::array<StageProfile, kStageCount>;

/// Energies of the current state [J].
struct Energies {
  double kinetic = 0.0;
  double interaction = 0.0;    ///< of the pair laws
  double contact = 0.0;
  [[nodiscard]] double total() const { return kinetic + interaction + contact; }
};

/// Relative errors since frame 1, the largest so far; `audits` in result.json.
struct Audits {
  double momentum_error = 0.0;          ///< over the largest sum of m |v| [1]
  double angular_momentum_error = 0.0;  ///< over the largest sum of |x - c| m |v| + |L| [1]
  double energy_error = 0.0;            ///< over the largest kinetic + interaction + contact energy [1]
  double energy_returned = 0.0;         ///< energy that damping and friction returned, over the largest energy [1]
  double contact_residual = 0.0;        ///< |p_A - p_B| / max(P_A, P_B) on contact samples, the largest [1]
  double largest_overlap = 0.0;         ///< of the undeformed fields [m]
  double largest_overlap_share = 0.0;   ///< over the thickness of the thinner body [1]
};

/// Changes of the particles between two steps; absent arrays stay as they are. Each has the shape [particles].
struct ParticleChange {
  std::optional<std::vector<Vec3>> position{};          ///< [m]
  std::optional<std::vector<Quat>> orientation{};       ///< body to world, of any length > 0
  std::optional<std::vector<Vec3>> velocity{};          ///< [m/s]
  std::optional<std::vector<Vec3>> angular_momentum{};  ///< about the particle's centre, world axes [kg m^2/s]
  std::optional<std::vector<Vec3>> angular_velocity{};  ///< instead of it, world axes [rad/s]
};

class Simulation {
 public:
  /// @throws OverBudget when the scene needs more than options.memory; Error{Scene} when the model cannot be built; unless `options.questions`, Error{Limit} as `expect_steps`
  explicit Simulation(Scene scene, SimulationOptions options = {});
  ~Simulation();
  Simulation(Simulation&&) noexcept;
  Simulation& operator=(Simulation&&) noexcept;

  [[nodiscard]] const Scene& scene() const;
  [[nodiscard]] const Model& model() const;
  /// The arrays of its particles keep their addresses for the life of this object, so that they can be
  /// viewed.
  [[nodiscard]] const State& state() const;
  [[nodiscard]] const std::vector<Body>& bodies() const;         ///< objects, or the pieces that they broke into
  [[nodiscard]] const core::Interactions& laws() const;          ///< the laws without broken bonds
  [[nodiscard]] int frame() const;              ///< the last frame reached; 1 at the start
  [[nodiscard]] double time() const;            ///< [s]
  [[nodiscard]] double time_step() const;       ///< of the current frame interval [s]
  [[nodiscard]] std::uint64_t state_hash() const;
  [[nodiscard]] const IntegratorPlan& integrator() const;
  /// Speed below which friction fell to zero between two objects or obstacles, by their names: the largest at frames (explicit methods) or steps [m/s].
  [[nodiscard]] const std::map<std::pair<std::string, std::string>, double>& friction_speeds() const;
  /// Work of the steps of this object so far: sums, the largest last correction, and whether all steps met the tolerance.
  [[nodiscard]] const core::StepReport& integration() const;

  /// @throws Error{Limit} when a step from here would have to be finer than time_step.max_substeps allows
  void expect_steps() const;
  /// One time step, frame time / 2^halvings; a step that ends a frame updates the audits. @throws Error{Diverged} naming particle, cause and value; the state is then
  /// that of the last frame. Steps do not stop at the scene's last frame; `scene().duration` matters for runs and turntables only:
  /// later steps equal those of a longer scene, to the bit.
  void step();
  /// Steps to the next frame, also past the last one of the scene.
  void step_frame();
  /// Steps to a frame. @param go_on  called after every step but the last: false ends the steps there; may be empty
  /// @return whether the frame is reached; true without a step where it was reached before
  bool advance_to(int frame, const std::function<bool()>& go_on = {});
  /// Continues from a saved state. @pre it belongs to this scene
  void restore(State state);
  /// Continues from a state of a scene with other values of masses, stiffnesses, friction, loads or looks. They act from now on: forces
  /// and seeds of contacts are computed again, all bodies are awake, and ledger and audits start anew. Velocities and angular momenta are
  /// those of the state; the frame number stays, and with the same frame rate the time does.
  /// @throws Error{Usage} for a state with another number of particles, breakable bonds or held volumes
  void adopt(State state);
  /// Sets positions and velocities of particles between two steps; pinned particles get no velocity. The change of
  /// momentum, angular momentum and energy is booked in the ledger as external, so that the audits stay valid. Forces are computed again, and
  /// islands of changed particles wake.
  /// @throws Error{Usage} for arrays of another shape, values that are not finite, orientations of length 0, and both angular arrays
  void set_particles(const ParticleChange& change);

  /// Forces and torques that act on the particles from now on besides those of the scene, until this is called again; to be called between two steps, before
  /// each one for forces that change. They are external loads as those of the scene: the ledger has their work and impulse. They are no part of the state:
  /// whoever restores a state gives them again.
  /// @param loads  about the particles' centres, world axes, shape [particles]; empty: none   @throws Error{Usage} for another shape and values that are not finite
  void set_loads(const core::Loads& loads);

  /// Meshes of the current surfaces, one per object in the order of the scene (empty without skeleton); deformed by
  /// contact, with the column "contact" (implicit/polygonise.h) and those that looks need: "pressure" [Pa], "speed" [m/s],
  /// "stretch" [1], "rest_x" ... [m]. Kept until the next step.
  [[nodiscard]] const std::vector<Mesh>& meshes();
  /// Contacts of the current state between `bodies()`, the ground being the last. Kept until the next step.
  [[nodiscard]] const collision::ContactSurface& contacts();
  /// What the energies of contacts may be off by [J], shape [contacts().summary] (collision/contact_surface.h).
  [[nodiscard]] std::vector<double> energy_estimates();
  /// Bodies of the contact stage, the fixed ones last; valid until the next step.
  [[nodiscard]] std::span<const collision::ContactBody> contact_bodies();
  /// Total force on body A of each contact, damping and friction included [N], shape [contacts().summary].
  [[nodiscard]] const std::vector<Vec3>& contact_forces();
  /// Power dissipated by damping and friction of each contact [W], shape [contacts().summary].
  [[nodiscard]] const std::vector<double>& contact_powers();
  /// Loads of contact on all particles at the current state.
  [[nodiscard]] const core::Loads& contact_loads();
  /// Fields of the bodies at the current state; valid until the next step.
  [[nodiscard]] const std::vector<implicit::Field>& fields();
  /// Division of space between bodies that touch, the basis of `meshes`: deformed pressures, bulges included. Kept until the next step.
  [[nodiscard]] const Division& division();
  /// Everything that the field of one of `contact_bodies` depends on in the current state, to the bit.
  void add_field_content(std::uint32_t body, ContentWords& words);

  /// Edge of a lattice cell of `meshes` [m], for objects without one of their own.
  [[nodiscard]] double cell() const;
  /// Sets the cell of all objects, by the number of cells along the longest side of all surfaces.
  void set_cells(int cells);
  /// For objects without a cell of their own.
  void set_cell(double cell);
  /// From now on `meshes` are empty for bodies that touch nothing and whose surface lies in a box for which
  /// `shown` is false. An empty function: all are made.
  void set_shown(std::function<bool(const Box&)> shown);

  [[nodiscard]] Energies energies();
  [[nodiscard]] Audits audits() const;
  /// Warnings as sentences: about the initial state, contacts that missed the given error so far, volumes off their targets in the present state, and
  /// results of the searches of all meshes so far.
  [[nodiscard]] std::vector<std::string> warnings() const;
  /// Results of the searches of all meshes made of the present state, and numbers of meshes that were not searched.
  [[nodiscard]] const SearchCounts& searches() const;
  /// Work by stage; `advance` is all of a step except the stages before it.
  [[nodiscard]] Profile profile() const;
  /// Where a stage outside the simulation (render, export) books its work.
  [[nodiscard]] StageProfile& profile(Stage stage);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace supple::scenes
