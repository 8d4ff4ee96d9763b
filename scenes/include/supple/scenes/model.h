/// @file supple/scenes/model.h
/// A scene as the data of the modules: particles, laws, skeletons, contact bodies. Const during a run.
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include "supple/collision/deformed_field.h"
#include "supple/collision/react.h"
#include "supple/core/integrate.h"
#include "supple/core/interactions.h"
#include "supple/core/links.h"
#include "supple/implicit/field.h"
#include "supple/implicit/height_field.h"
#include "supple/implicit/mesh_solid.h"
#include "supple/implicit/solids.h"
#include "supple/implicit/surface_samples.h"
#include "supple/implicit/volume.h"
#include "supple/scenes/limits.h"
#include "supple/scenes/scene.h"
#include "supple/scenes/solid_motion.h"

namespace supple::scenes {

/// Lattice cells across the thinnest surface where the scene gives none: a plate then has about a hundred triangles across its rounded edge.
inline constexpr double kCellsAcross = 8.0;

/// One object: a range of particles and the surface they carry.
struct ObjectModel {
  std::string name;
  std::uint32_t first = 0;                ///< its particles are [first, last)
  std::uint32_t last = 0;
  implicit::Skeleton skeleton;            ///< empty: the object has no surface
  implicit::SampleLayout samples;         ///< empty unless it can touch another body and one of the two is not convex
  double sample_spacing = 0.0;            ///< largest distance of samples where bodies are alone, of all primitives [m]
  collision::ContactMaterial material;
  bool collides = false;                  ///< has `contact` and a surface
  bool hinges_join = false;               ///< laws also act between two hinges
  bool breaks = false;                    ///< has `breaking`, so it may fall into pieces
  bool separate = false;                  ///< each particle is a body of its own
  /// For each particle the first one that the blending graph connects it with, directly or through others, counted from the
  /// object's first; such components are bodies of their own. Empty: the object is one component.
  std::vector<std::uint32_t> component{};
  /// Nodes of the graph (groups) that do not blend with all others of their body, or may not once bonds have broken, by their first particles,
  /// counted likewise and sorted. They touch the groups that they do not blend with by their own fields, without those of the others.
  std::vector<std::uint32_t> group{};
  std::vector<collision::BodyPair> bonded{};       ///< components or groups with a bond between them, sorted: they never touch while it holds
  std::vector<collision::BodyPair> overlapping{};  ///< other pairs that overlap at the start, sorted: they touch once they have been apart
  /// Whether a pair consists of groups: groups touch within their component, components touch each other.
  [[nodiscard]] bool are_groups(const collision::BodyPair& pair) const { return component.empty() || component[pair.a] == component[pair.b]; }
  double fade = 0.0;                      ///< how long a broken bond's blend fades [s]
  bool holds_volume = false;              ///< kernels are scaled by State::volumes
  VolumeOfName volume_of = VolumeOfName::Object;
  implicit::VolumeControl volume;         ///< except for the target
  std::vector<double> target{};           ///< of the object, or by particle or primitive [m^3]; 0: the initial volume
  std::uint32_t first_volume = 0;         ///< index of `target` in State::volumes
  double volume_cell = 0.0;               ///< cell size of the volume measurement while no kernel is scaled [m]
  double rest_diameter = 0.0;             ///< largest distance of two particles at rest, or twice the iso radius of a single particle [m]
  double solid_volume = 0.0;              ///< that the surface encloses at the start, where the object has a `material` [m^3]; else 0
  double iso_radius = 0.0;                ///< smallest iso distance of its primitives [m]; 0 without surface
  LookDesc look;                          ///< determines the columns of its meshes
  double cell = 0.0;                      ///< lattice cell of its meshes and grids [m]; 0 without surface
  bool own_cell = false;                  ///< the object has its own key for `cell`
  bool cell_is_stated = false;            ///< by the object or by output.cell
  std::optional<double> mesh_error;       ///< error bound of its meshes [m]
  bool own_error = false;                 ///< the object has its own key for `mesh_error`
};

/// Size that errors of an object are compared with: its rest diameter with what its surface adds; of `separate` ones that of one body [m].
[[nodiscard]] double size_of(const ObjectModel& object);

/// A solid that forces do not move and that touches every object with contact. Without keys it is at rest; with keys they
/// move it, and `solid` is given at the origin.
struct FixedBody {
  std::string name;
  using Primitives = std::shared_ptr<const implicit::Field>;
  std::variant<implicit::HalfSpace, implicit::SolidBox, implicit::HeightField, implicit::MeshSolid, Primitives> solid;
  collision::ContactMaterial material;
  SolidMotion motion{};
  std::optional<double> core_value{};  ///< of primitives: a lower bound of the largest F; other solids have it at their centre
  double iso_radius = std::numeric_limits<double>::infinity();  ///< of primitives: the smallest iso distance [m]
  [[nodiscard]] bool led() const { return !motion.keys.empty(); }
  [[nodiscard]] implicit::FieldView field() const {
    return std::visit(
        []<class Solid>(const Solid& s) -> implicit::FieldView {
          if constexpr (std::is_same_v<Solid, Primitives>) return *s;
          else return s;
        },
        solid);
  }
};

/// Bounds of distance and speed of particles at a time [s]; larger values mean divergence.
struct Believable {
  double size = 0.0;          ///< far more than the size of the objects and the distances of initial positions and keys [m]
  double speed = 0.0;         ///< of particles at the start and of obstacles [m/s]
  double margin = 0.0;        ///< far more than one size per frame [m/s]
  double acceleration = 0.0;  ///< by gravity and the loads on a particle [m/s^2]
  [[nodiscard]] double distance(double time) const { return size + (speed + 0.5 * acceleration * time) * time; }  ///< from the origin [m]
  [[nodiscard]] double fastest(double time) const { return margin + speed + acceleration * time; }  ///< [m/s]
};

/// Pins that end at a time.
struct PinRelease {
  std::uint32_t particle = 0;
  std::uint8_t pins = 0;  ///< core::kPinPosition, kPinOrientation
  double time = 0.0;      ///< [s]
};

/// Times between which two objects or obstacles can touch.
struct ContactWindow {
  collision::BodyPair pair;  ///< object indices; fixed bodies follow the objects
  double from = 0.0;         ///< [s]
  double until = 0.0;        ///< [s], may be infinite
};

/// Links that break at a time, whatever their load.
struct CutEvent {
  double time = 0.0;  ///< [s]
  std::vector<std::uint32_t> links;
};

/// An object that is not there from the start.
struct Appearance {
  double time = 0.0;                   ///< [s]
  std::uint32_t object = 0;
  std::vector<Vec3> velocity;          ///< of its particles [m/s]
  std::vector<Vec3> angular_momentum;  ///< [kg m^2/s]
};

struct Model {
  core::ParticleSet particles;            ///< with the pins of the present time
  std::vector<std::uint8_t> held;         ///< pins without an end, shape [particles]
  std::vector<PinRelease> releases;
  std::vector<core::LedPin> led;          ///< pins that move, particles ascending
  std::vector<CutEvent> cuts;
  std::vector<Appearance> appearances;    ///< by time
  core::ParticleState initial;
  core::ParticleState rest;               ///< rest poses (the initial arrangement)
  core::Interactions interactions;        ///< of the unbroken scene
  core::Links links;                      ///< bonds that can break or yield
  std::vector<ObjectModel> objects;       ///< in the order of the scene (by name)
  std::vector<FixedBody> fixed;           ///< the ground, if it collides, then the obstacles by name
  collision::ContactRules rules;          ///< body index = object index; fixed bodies follow the objects
  std::vector<ContactWindow> windows;
  std::vector<collision::BodyPair> closed;  ///< pairs of `windows` that cannot touch at the present time, sorted
  collision::ContactSettings contact;
  collision::ReactionSettings reaction;
  collision::BulgeSettings bulge;
  std::vector<CameraDesc> cameras;        ///< cameras of the scene with their positions; empty until a Simulation sets them
  MeshingDesc meshing;                    ///< how surfaces are meshed
  double cell = 0.0;                      ///< lattice cell of objects without one of their own [m]; 0 when nothing has a surface
  std::optional<std::uint32_t> thinnest;  ///< the object whose thin surface determined `cell`; none: the cell was given, or follows from an extent
  double contact_frequency = 0.0;         ///< upper estimate of sqrt(P k A / m) over the objects that collide [rad/s]
  double largest_dissipation = 0.0;       ///< d of all pairs that touch [s/m]
  double smallest_length = 0.0;           ///< smallest length that a step must resolve: nearest rest distance or iso radius [m]
  double solid_speed = 0.0;               ///< bound of the speed of obstacles with keys and of pins that move [m/s]
  Believable believable;
};

/// Whether an object has appeared at a time [s].
[[nodiscard]] bool is_there(const Model& model, std::uint32_t object, double time);
/// Pairs of `windows` that cannot touch at a time, and those of objects that are not there yet, sorted.
[[nodiscard]] std::vector<collision::BodyPair> closed_at(const Model& model, double time);
/// Whether two objects or fixed bodies can touch at the present time.
[[nodiscard]] bool may_touch(const Model& model, std::uint32_t a, std::uint32_t b);

/// Pins of all particles at a time, shape [particles].
[[nodiscard]] std::vector<std::uint8_t> pinned_at(const Model& model, double time);

/// @throws Error{Scene} for faults that only the whole scene shows (a pair naming an absent object, an iso value that no kernel
/// reaches, two particles at one place with a bond between them ...), with the key concerned.
/// @param memory  limit of memory [byte]   @throws OverBudget before more is allocated
/// @pre duration, frame rate and masses are positive, as in every scene that was read
[[nodiscard]] Model build_model(const Scene& scene, double memory = kDefaultMemory);

/// The part of its object that a body is.
struct BodyOrigin {
  std::uint32_t piece = 0;      ///< the smallest particle that is connected to it by links
  std::uint32_t component = 0;  ///< of ObjectModel::component; 0 where that is empty
  static constexpr std::uint32_t kWhole = 0xffffffff;
  std::uint32_t group = kWhole;  ///< index in ObjectModel::group, for a body that is one group of another body
  std::vector<std::uint32_t> cut{};  ///< groups of the same body that it blended with or was bonded to before bonds broke; sorted
  [[nodiscard]] bool is_group() const noexcept { return group != kWhole; }
  /// In ObjectModel::bonded and overlapping.
  [[nodiscard]] std::uint32_t number() const noexcept { return is_group() ? group : component; }
};

/// A body: a whole object, a component of its blending graph, or a piece that broke off. After all of these follow their groups, which share
/// their particles and touch only groups of the same body that they do not blend with. Contact bodies have the same indices.
struct Body {
  std::uint32_t object = 0;
  BodyOrigin origin;
  std::string name;                        ///< of the object; of several bodies "name.1", "name.2" ...
  std::vector<std::uint32_t> particle;     ///< its parts are these, ascending
  std::vector<collision::PartYield> yield; ///< of its parts
  std::vector<std::uint32_t> primitive{}, seed{};  ///< indices in the object of the entries of `skeleton` and `samples`; empty: all
  implicit::Skeleton skeleton;
  implicit::SampleLayout samples;
};

/// When two bodies of one object touch.
enum class Meeting : std::uint8_t {
  Always,
  OnceApart,  ///< pieces, and groups whose bonds broke or blends faded, as a fresh crack must first open; components and groups that overlap at the start
  Never,      ///< components and groups with a bond between them, groups that blend, those of different bodies, a group and a body
};
[[nodiscard]] Meeting meeting_of(const ObjectModel& object, const BodyOrigin& a, const BodyOrigin& b);

/// Identifies a body among those of its object: its smallest particle; for groups of objects that may break, where bodies can share it, plus the number of all
/// particles.
[[nodiscard]] std::uint32_t leader_of(const Model& model, const Body& body);

/// Pairs of bodies of one object of kind OnceApart that have been apart, by their leaders, sorted. Part of State.
using ApartPairs = std::vector<collision::BodyPair>;

/// Name of a contact body: of a body, or of a fixed one.
[[nodiscard]] const std::string& body_name(const Model& model, const std::vector<Body>& bodies, std::size_t body);
/// Name of its object, or of a fixed one.
[[nodiscard]] const std::string& object_name(const Model& model, const std::vector<Body>& bodies, std::size_t body);
/// Links for the division into bodies: links that broke less than their object's `fade` ago still connect.
/// @param broken_for  time since each link broke [s], shape of the links
[[nodiscard]] core::LinkState parted_links(const Model& model, const core::LinkState& links, std::span<const double> broken_for);
/// Sets the weights of the blend's edges of objects that fade, by the ages of their links: a pair with a bond has the bond's
/// weight, one without the best of the paths over one common neighbour, or 1 where there never was such a path.
void fade_blends(const Model& model, const core::LinkState& links, std::span<const double> broken_for, std::vector<Body>& bodies);

/// The bodies at a state, in the order of objects and of smallest particles; then the groups, likewise. Their blends are faded.
/// @param broken_for  time since each link broke [s], shape of the links
[[nodiscard]] std::vector<Body> make_bodies(const Model& model, const core::LinkState& links, std::span<const double> broken_for);
/// Number of bodies that are not groups: these have surfaces.
[[nodiscard]] std::size_t surface_count(const std::vector<Body>& bodies);
/// Model::rules for these bodies; the fixed ones follow after them.
[[nodiscard]] collision::ContactRules make_body_rules(const Model& model, const std::vector<Body>& bodies,
                                                      const ApartPairs& apart);

}  // namespace supple::scenes
