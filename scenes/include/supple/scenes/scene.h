/// @file supple/scenes/scene.h
/// A scene as its file describes it: one struct per YAML mapping, one member per key, in the same order, with its
/// default. Const after reading. docs/scene_reference.md is generated from the same field lists that read it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "supple/core/types.h"
#include "supple/scenes/looks.h"

namespace supple::scenes {

/// time_step: automatic, or fixed by the scene
struct TimeStepDesc {
  std::optional<double> size;        ///< [s]; absent: auto
  std::optional<int> substeps;       ///< exactly this many steps per frame (per `size` if that is given), a power of two; absent: auto
  int max_substeps = 4096;           ///< a scene whose automatic steps would be finer is refused
};

enum class MethodName : std::uint8_t { Auto, Symplectic, Rk4, Adaptive, BackwardEuler, ImplicitMidpoint, Implicit };
enum class RotationName : std::uint8_t { Splitting, Exponential };

/// integrator
struct IntegratorDesc {
  MethodName method = MethodName::Auto;
  RotationName rotation = RotationName::Splitting;
  std::optional<double> tolerance;   ///< absent: 1e-6 (adaptive) or 1e-9 (implicit methods)
};

enum class ArrangeKind : std::uint8_t { Single, Line, Ring, Grid, Spiral, File, Geodesic, Ball, Tube, Curve, Scatter, Fill, Points };
enum class NormalKind : std::uint8_t { Axis, Radial };

/// objects[].particles
struct ParticlesDesc {
  ArrangeKind arrange = ArrangeKind::Single;
  int count = 1;                      ///< line, ring, spiral, curve, scatter
  double radius = 0.0;                ///< ring, geodesic, ball, tube [m]
  int frequency = 1;                  ///< geodesic: parts of each edge of the icosahedron
  double inner_radius = 0.0;          ///< spiral [m]
  double outer_radius = 0.0;          ///< spiral [m]
  double turns = 1.0;                 ///< spiral
  double spacing = 0.0;               ///< line, grid, ball, tube, fill; scatter: the least distance; points: the typical one [m]
  double disorder = 0.0;              ///< each particle is moved at random by at most this [m]
  int columns = 1;                    ///< grid
  int rows = 1;                       ///< grid
  int layers = 1;                     ///< grid, along z
  double length = 0.0;                ///< tube, along z [m]
  std::vector<Vec3> points;           ///< curve: points on its way; points: the particles [m]
  std::vector<int> bonds;             ///< points: pairs of particles that a material joins, one after the other
  std::vector<double> sections;       ///< points: of the bonds [m^2]; empty: all equal
  std::vector<Vec3> normals;          ///< points: of a shell, outward; empty: a solid
  std::vector<Vec3> directions;       ///< points: of a shell, along which its first curvature is measured
  double thickness = 0.0;             ///< points: of a shell [m]
  std::vector<double> curvatures;     ///< points: of a shell, two for each particle [1/m]
  Vec3 size = Vec3::Zero();           ///< scatter: edges of a box [m]
  int seed = 1;                       ///< scatter
  std::string file;                   ///< file: CSV or PLY of particles; fill: OBJ or PLY of a closed mesh; beside the scene
  NormalKind normal = NormalKind::Axis;
  Vec3 own_normal = Vec3::UnitZ();    ///< direction of the normal in each particle's frame
  Vec3 at = Vec3::Zero();             ///< position of the arrangement's origin [m]
  Vec3 axis = Vec3::UnitZ();          ///< direction of its z axis
  double angle = 0.0;                 ///< rotation about its own z axis, before the others [rad] (key angle_deg)
  Vec3 velocity = Vec3::Zero();       ///< initial [m/s]
  Vec3 spin = Vec3::Zero();           ///< initial, rigid, about the centre of mass [rad/s]
  std::optional<double> mass;         ///< of one particle [kg]; absent: 1, or by ObjectDesc::material
  std::optional<double> inertia_radius;  ///< a in 2/5 m a^2 [m]; absent: half the nearest-neighbour distance; single particles have the moments of their solid
  Vec3 inertia_axes = Vec3::Zero();   ///< instead of inertia_radius: semi-axes of a solid ellipsoid in the particle's frame [m]; zero: absent
};

enum class LawKind : std::uint8_t {
  Cohesion, LinearCohesion, DirectedCohesion, LennardJones, GayBerne, Form, FormRadius, DirectedForm, BondFrame, Coplanarity,
  CoNormality, CoCircularity, Friction
};

/// objects[].interactions[]
struct InteractionDesc {
  LawKind law = LawKind::BondFrame;
  int neighbours = 1;                 ///< bonds between particles whose numbers differ by at most this
  std::optional<double> within;       ///< instead of neighbours: bonds between particles nearer than this at rest [m]
  bool geometric = false;             ///< instead of bonds: all particles in range, found in each step
  bool normalised = false;            ///< coplanarity, co_circularity: psi / d^2 instead of psi
  bool paper_literal = false;         ///< form_radius as printed, which has no energy
  double stretch = 0.0;               ///< bond_frame k_s [N/m]
  double rotation = 0.0;              ///< bond_frame k_theta [N m]
  double strength = 0.0;              ///< form, directed_form [J m^2]; form_radius, coplanarity, co_circularity [N/m];
                                      ///< co_normality and normalised laws [J]
  double linear = 0.0;                ///< friction c [N s/m]
  double angular = 0.0;               ///< friction c_r [N m s]
  std::optional<double> rest_distance;     ///< r0 of distance laws [m]; absent: the rest distance of each bond
  std::optional<double> maximum_distance;  ///< cohesion r_m [m]
  std::optional<double> maximum_ratio;     ///< cohesion r_m / r0
  std::optional<double> maximum_force;     ///< cohesion F_max [N]
  std::optional<double> scale_force;       ///< F0 of the cohesion laws, E of lennard_jones [N]
  std::optional<double> gain;              ///< cohesion E [N/m^2]
  std::optional<double> alpha;             ///< cohesion alpha [1/m^2]
  std::optional<double> table_error;       ///< cohesion from a table: largest error of the force over F_max
  double shape = 4.0;                      ///< linear_cohesion, directed_cohesion a
  double eta = 0.0;                        ///< linear_cohesion eta
  Vec3 semi_axes = Vec3::Zero();           ///< directed_cohesion, gay_berne, of every particle in its own axes [m]
  std::optional<double> depth;             ///< lennard_jones, gay_berne [J]
  std::optional<double> sigma;             ///< gay_berne [m]; absent: twice the smallest semi-axis
  double gamma = 1.0;                      ///< gay_berne
  Vec3 wells = Vec3::Ones();               ///< gay_berne, by own axis, over depth
  int upsilon = 1;                         ///< gay_berne
  int mu = 1;                              ///< gay_berne
  int repulsive = 12;                      ///< lennard_jones n
  int attractive = 6;                      ///< lennard_jones m
  std::optional<double> cut_off;           ///< lennard_jones r1 [m], absent: none; gay_berne
  std::optional<double> switch_from;       ///< lennard_jones r_s [m], absent: the force is shifted; gay_berne
  std::optional<double> range;             ///< weight range h [m]; absent: psi = 1 (bonded)
};

enum class ShapeName : std::uint8_t {
  Point, Segment, Square, Rectangle, Disc, Box, Ellipsoid, Triangle, Polygon, Ring, Arc, Curve, Superquadric, Directed
};
enum class KernelName : std::uint8_t {
  Wyvill, Gascuel, SoftObject, Murakami, Nishimura, Blinn, Cauchy, BlancSchlick
};

/// objects[].skeleton[].kernel
struct KernelDesc {
  KernelName type = KernelName::Wyvill;
  double radius = 0.0;                ///< support R [m]
  std::optional<double> thickness;    ///< gascuel: e [m]
  std::optional<double> slope;        ///< gascuel: -f' at the surface [1/m]
  double sharpness = 2.0;             ///< blinn, cauchy: s
  double hardness = 0.5;              ///< blanc_schlick: p
};

/// objects[].skeleton[]
struct SkeletonDesc {
  ShapeName shape = ShapeName::Point;
  double half_size = 0.0;             ///< square [m]
  double half_length = 0.0;           ///< segment, along the primitive's x [m]
  Vec3 half_sizes = Vec3::Zero();     ///< box; rectangle uses x and y [m]
  double radius = 0.0;                ///< disc, ring, arc [m]
  double half_angle = 0.0;            ///< arc, on either side of the x axis [rad] (key half_angle_deg)
  std::vector<Vec3> points;           ///< triangle, polygon: corners; curve: Bezier control points [m]
  Vec3 semi_axes = Vec3::Zero();      ///< ellipsoid, superquadric: of the support [m]
  Vec3 exponents = Vec3(0.5, 0.5, 0.0);  ///< superquadric: e1, e2
  Vec3 radii = Vec3::Zero();          ///< directed: of the support, along +x, +y, +z [m]
  Vec3 radii_behind = Vec3::Zero();   ///< directed: along -x, -y, -z [m]; zero: as radii
  double end_radius = 0.0;            ///< segment, curve: support radius at the end [m]; zero: as kernel.radius
  Vec3 stretch = Vec3::Ones();        ///< factors of shape and support along the primitive's axes
  Vec3 at = Vec3::Zero();             ///< offset in the particle's frame [m]
  Vec3 turn_axis = Vec3::UnitZ();     ///< with turn: rotation in the particle's frame
  double turn = 0.0;                  ///< [rad] (key turn_deg)
  bool convolve = false;              ///< segment, triangle, polygon, ring, arc: integrate the kernel over the shape
  std::vector<int> particles;         ///< which particles carry it; empty: all
  std::optional<double> volume;       ///< target of volume: {of: primitive} [m^3]; absent: the object's
  KernelDesc kernel;
};

/// objects[].material: physical properties from which masses, bonds, damping and contact follow
struct SubstanceDesc {
  double youngs_modulus = 0.0;        ///< E [Pa]
  double density = 0.0;               ///< rho [kg/m^3]
  double poissons_ratio = 0.2;        ///< nu
  double damping_ratio = 0.05;        ///< zeta of the slowest free vibration
  double friction = 0.5;
};

/// objects[].contact
struct MaterialDesc {
  std::optional<double> modulus;      ///< P0 [Pa]; absent: 1e4, or by ObjectDesc::material
  std::optional<double> friction;     ///< absent: 0, or by ObjectDesc::material
  std::optional<double> dissipation;  ///< d [s/m]; absent: 0, or by ObjectDesc::material
  std::optional<bool> self;           ///< absent: true
};

/// objects[].kinds[]: hinges interact with particles of all types, standard particles of different types only repel
struct KindDesc {
  bool hinge = false;
  int type = 0;                       ///< of standard particles
  std::vector<int> particles;         ///< negative counts from the end
};

/// objects[].repulsion: exponential repulsion from other objects that have it, where contact is off
struct RepulsionDesc {
  double force = 0.0;                 ///< [N]
  double distance = 0.0;              ///< d0 [m]
  double length = 0.0;                ///< lambda [m]
  bool own = false;                   ///< also between all particles of the object itself
};

/// objects[].medium
struct MediumDesc {
  double linear = 0.0;                ///< gamma [1/s]
  double angular = 0.0;               ///< gamma_r [1/s]
};

/// objects[].breaking: a bonded pair of particles that exceeds one of these loses all its laws
struct BreakingDesc {
  std::optional<double> stretch;      ///< d / d0 - 1
  std::optional<double> energy;       ///< [J]
  std::optional<double> force;        ///< [N]
  std::optional<double> couple;       ///< [N m]
};

/// objects[].yielding: bond frames above an energy take the present pose as their rest pose
struct YieldingDesc {
  double energy = 0.0;                ///< [J]
  double time = 0.0;                  ///< [s]
};

/// objects[].rayleigh
struct RayleighDesc {
  double mass = 0.0;                  ///< alpha [1/s]
  double stiffness = 0.0;             ///< beta [s]
};

enum class LeadName : std::uint8_t { Smooth, Linear };

/// objects[].pins[].motion.keys[]
struct PinKeyDesc {
  double time = 0.0;                  ///< [s]
  Vec3 by = Vec3::Zero();             ///< from the place at the start [m]
  double turn = 0.0;                  ///< [rad] (key turn_deg)
};

/// objects[].pins[].motion: where a pin leads its particle, from its place at the start
struct PinMotionDesc {
  std::vector<PinKeyDesc> keys;
  LeadName between = LeadName::Smooth;
  Vec3 turn_axis = Vec3::UnitZ();
  std::string x, y, z;                ///< instead of keys: expressions of t [s], lengths; empty: 0
};

/// objects[].pins[]
struct PinDesc {
  int particle = 0;                   ///< negative counts from the end: -1 is the last
  bool position = true;
  bool orientation = true;
  double until = std::numeric_limits<double>::infinity();  ///< time of its release [s]
  std::optional<PinMotionDesc> motion;
};

/// objects[].cuts[]: bonds that break at a time
struct CutDesc {
  double time = 0.0;                  ///< [s]
  std::vector<int> particles;         ///< all bonds between two of these; negative counts from the end
  std::optional<Vec3> at;             ///< instead: all bonds across the plane through this point at the start [m]
  Vec3 normal = Vec3::UnitX();        ///< of that plane
};

/// keys of a course
struct CourseKeyDesc {
  double time = 0.0;                  ///< [s]
  double factor = 0.0;
};

/// A factor as a function of time
struct CourseDesc {
  std::string expression;             ///< of t [s]
  std::vector<CourseKeyDesc> keys;    ///< instead: values at times, linear in between
};

/// objects[].loads[]
struct LoadDesc {
  int particle = 0;                   ///< negative counts from the end
  Vec3 force = Vec3::Zero();          ///< [N]
  Vec3 torque = Vec3::Zero();         ///< [N m]
  double from = 0.0;                  ///< [s]
  double until = std::numeric_limits<double>::infinity();  ///< [s]
  double ramp = 0.0;                  ///< [s]
  std::optional<CourseDesc> course;   ///< a factor of force and torque
};

enum class BlendName : std::uint8_t { Sum, Graph, Ricci, Gradient };

/// objects[].blend.groups[]
struct BlendGroupDesc {
  std::vector<int> particles;         ///< negative counts from the end
};

/// objects[].blend: how the fields of particles combine
struct BlendDesc {
  BlendName rule = BlendName::Graph;
  std::vector<BlendGroupDesc> groups;   ///< particles of one group sum; the others are groups of their own
  std::optional<int> neighbours;        ///< graph: groups blend whose particles' numbers differ by at most this
  std::optional<double> within;         ///< graph: groups also blend whose particles are nearer than this at rest [m]
  double exponent = 4.0;                ///< ricci
  double opening = 0.3;                 ///< gradient
  double fade = 0.0;                    ///< graph: time in which the blend of a broken bond fades [s]
};

enum class VolumeOfName : std::uint8_t { Object, Particle, Primitive };

/// objects[].volume: kernels are scaled so that the object, or each of its particles or primitives, keeps its volume
struct VolumeDesc {
  VolumeOfName of = VolumeOfName::Object;
  std::optional<double> target;       ///< [m^3]; absent: the initial volume
  double rate = 2.0;                  ///< alpha [1/s]
  double damping = 0.05;              ///< beta
};

/// objects[].meshing: replaces the values of `output`
struct ObjectMeshingDesc {
  std::optional<double> cell;               ///< lattice cell [m]; absent: as output.cell
  std::optional<double> error;              ///< largest distance of a triangle's centroid to the surface [m]; absent: as output.meshing.error
};

struct ObjectDesc {
  std::string name;
  ParticlesDesc particles;
  bool separate = false;                    ///< each particle is a body of its own
  std::vector<KindDesc> kinds;              ///< particles not named are standard, of type 0
  bool hinges_join = false;                 ///< laws also act between two hinges
  std::vector<InteractionDesc> interactions;
  std::optional<SubstanceDesc> material;    ///< absent: masses, bonds and contact have their own keys
  std::vector<SkeletonDesc> skeleton;
  double iso = 0.5;
  std::optional<BlendDesc> blend;           ///< absent: everything sums
  std::optional<VolumeDesc> volume;         ///< absent: the volume is not kept
  std::optional<MaterialDesc> contact;      ///< absent: the object touches nothing
  std::optional<RepulsionDesc> repulsion;
  std::optional<MediumDesc> medium;
  std::optional<BreakingDesc> breaking;
  std::optional<YieldingDesc> yielding;
  std::optional<RayleighDesc> rayleigh;
  std::vector<PinDesc> pins;
  std::vector<LoadDesc> loads;
  std::vector<CutDesc> cuts;
  double appears = 0.0;                     ///< time from which the object is there [s]
  double scale = 1.0;                       ///< of its lengths, which reading has multiplied by it
  Vec3 colour = Vec3(0.8, 0.8, 0.8);        ///< sRGB
  double roughness = 0.45;
  LookDesc look;
  ObjectMeshingDesc meshing;
};

struct RestitutionDesc {
  double value = 1.0;                 ///< e in (0, 1]
  double at_speed = 0.0;              ///< [m/s]
};

/// pairs[]: contact settings of two objects that replace those of their materials
struct PairDesc {
  std::vector<std::string> objects;   ///< two names of objects, obstacles or "ground"
  std::optional<bool> collide;
  double from = 0.0;                  ///< time from which they can touch [s]
  double until = std::numeric_limits<double>::infinity();  ///< and to which [s]
  std::optional<double> friction;
  std::optional<double> dissipation;
  std::optional<RestitutionDesc> restitution;
};

/// wind: motion of the medium in which objects with `medium` drag
struct WindDesc {
  Vec3 velocity = Vec3::Zero();       ///< [m/s]
  std::optional<CourseDesc> course;   ///< a factor of the velocity
};

enum class SplitName : std::uint8_t { Energy, Contribution };
enum class RuleName : std::uint8_t { Auto, Polar, March, Panels };
enum class CoreName : std::uint8_t { Soft, Barrier };

/// contact.stick: friction by springs
struct StickDesc {
  double stiffness = 0.0;             ///< of a pair's spring [N/m]
  double damping = 0.0;               ///< [s]
};

/// contact: of the scene
struct ContactDesc {
  std::optional<double> error;        ///< of force and area, relative [1]; absent: as the accuracy, or 1e-4 where steps are fixed
  RuleName rule = RuleName::Auto;
  SplitName split = SplitName::Energy;
  CoreName core = CoreName::Soft;
  double friction_speed = 1e-3;       ///< [m/s]
  std::optional<StickDesc> stick;     ///< absent: friction is viscous below `friction_speed`
  double bulge = 0.0;                 ///< attenuation alpha of the propagation zone, e.g. 0.4; 0: off
  bool bulge_volume = false;          ///< bulges that hold the displaced volume
  std::optional<double> bulge_width;  ///< over the other body's feature size; absent: 0.15, or as wide as bulge_volume needs
  bool bulge_literal = false;         ///< the term as published
  std::optional<double> sample_spacing;  ///< [m]; absent: a sixth (a third where contact.error is 5e-2 or more) of what is thinner, the primitive or the obstacles
};

/// sleep: bodies at rest are not moved
struct SleepDesc {
  double speed = 0.01;                ///< [m/s]
  double time = 0.5;                  ///< [s]
};

struct GroundDesc {
  double height = 0.0;                ///< [m]
  Vec3 colour = Vec3(0.58, 0.57, 0.55);
  std::optional<TextureDesc> texture;
  bool visible = true;
  bool collides = true;
  double modulus = 1e6;               ///< P of the half-space [Pa]
  double slope = 1.0;                 ///< |grad F| [1/m]
  double friction = 0.5;
};

enum class ObstacleName : std::uint8_t { Plane, Box, Heights, Mesh, Implicit };

/// obstacles[].keys[]
struct ObstacleKeyDesc {
  double time = 0.0;                  ///< [s]
  Vec3 at = Vec3::Zero();             ///< position, as ObstacleDesc::at [m]
  double turn = 0.0;                  ///< box, mesh [rad] (key turn_deg)
};

/// obstacles[]: solids at rest or moved by keys, which touch every object that has contact
struct ObstacleDesc {
  std::string name;
  ObstacleName shape = ObstacleName::Box;
  Vec3 at = Vec3::Zero();             ///< a point of the plane; the middle of the box; added to heights and meshes [m]
  Vec3 normal = Vec3::UnitZ();        ///< plane: outward
  double extent = 2.0;                ///< plane: half the edge of the square that pictures show [m]
  Vec3 half_sizes = Vec3::Zero();     ///< box [m]
  double rounding = 0.0;              ///< box: radius of its edges [m]
  Vec3 turn_axis = Vec3::UnitZ();     ///< box, mesh, implicit, with turn
  double turn = 0.0;                  ///< box, mesh, implicit [rad] (key turn_deg)
  std::vector<ObstacleKeyDesc> keys;  ///< instead of `at` and `turn`, rising in time
  LeadName between = LeadName::Smooth;
  std::string file;                   ///< heights: CSV of x, y, z on a regular grid; mesh: OBJ or PLY; beside the scene
  std::vector<SkeletonDesc> skeleton; ///< implicit: about `at`
  double iso = 0.5;                   ///< implicit
  Vec3 colour = Vec3(0.72, 0.74, 0.78);  ///< sRGB
  double roughness = 0.6;
  std::optional<TextureDesc> texture;
  bool visible = true;
  double smooth = 0.52359877559829887;  ///< mesh: edges whose faces make a smaller angle look smooth [rad] (key smooth_deg)
  double modulus = 1e6;               ///< P [Pa]
  double slope = 1.0;                 ///< |grad F| [1/m]
  double friction = 0.5;
};

enum class ImageName : std::uint8_t { Png, Exr };

struct ImagesDesc {
  std::vector<int> size = {1280, 720};
  int samples = 4;
  std::vector<ImageName> formats = {ImageName::Png};
};

enum class TableName : std::uint8_t { Csv, Vtk };
enum class MeshName : std::uint8_t { Ply, Obj, Usd };
enum class GridName : std::uint8_t { Vdb };
enum class MeshingName : std::uint8_t { Auto, Cubes, Tetrahedra, Delaunay, OpenVdb };
enum class GriddedName : std::uint8_t { Objects, Scene, Both };
enum class GridContentName : std::uint8_t { Distance, Field };

struct MeshingDesc {
  MeshingName method = MeshingName::Auto;  ///< of bodies that touch no other
  std::optional<double> error;             ///< largest distance of a triangle's centroid to the surface [m]; absent: by the cell
  double angle = 0.5235987755982988;       ///< Delaunay: least angle of a triangle [rad]
  std::optional<double> size;              ///< Delaunay: largest radius of a surface ball [m]; absent: two cells
  std::optional<double> distance;          ///< Delaunay: from circumcentre to surface [m]; absent: a tenth of the size
  std::optional<bool> search;              ///< Auto, Cubes: search for closed pieces between the nodes of the lattice; absent: where it costs little relative to meshing
  bool motion = false;                     ///< columns of velocity and owner
};

struct GriddingDesc {
  GriddedName of = GriddedName::Objects;                 ///< one grid per object, one of all, or both
  GridContentName content = GridContentName::Distance;
  double half_width = 3.0;                               ///< of the narrow band [cells]
};

struct SamplingDesc {
  std::optional<double> spacing;      ///< [m]; absent: by density, or four cells
  std::optional<double> density;      ///< instead of spacing: samples per square metre [1/m^2]
};

struct FilmDesc {
  std::optional<double> frame_rate;   ///< of the film [1/s]; absent: the scene's, so that the film plays in real time
};

struct OutputDesc {
  std::optional<ImagesDesc> images;
  std::optional<FilmDesc> film;       ///< needs images
  std::vector<TableName> contacts;    ///< formats; empty: none
  std::vector<TableName> particles;
  std::vector<TableName> samples;     ///< even samples of the surfaces
  std::vector<MeshName> mesh;
  std::vector<GridName> grid;
  MeshingDesc meshing;
  GriddingDesc gridding;
  SamplingDesc sampling;
  std::optional<double> cell;         ///< lattice cell [m]; absent: 8 cells across the smallest surface thickness, and 64 along the balls around each object's supports
};

struct ScenePlaces;

struct Scene {
  int schema = 1;
  std::string title;
  double duration = 0.0;              ///< [s]
  double frame_rate = 24.0;           ///< [1/s]
  Vec3 gravity = Vec3::Zero();        ///< [m/s^2]
  std::optional<CourseDesc> gravity_course;  ///< a factor of gravity
  std::optional<WindDesc> wind;       ///< absent: the medium is at rest
  bool planar = false;                ///< particles keep their z and turn about z only
  std::optional<double> accuracy;     ///< over the size of the bodies [1]; absent: see accuracy.h
  TimeStepDesc time_step;
  IntegratorDesc integrator;
  std::vector<ObjectDesc> objects;    ///< sorted by name
  std::vector<ObstacleDesc> obstacles;  ///< sorted by name
  std::vector<PairDesc> pairs;
  ContactDesc contact;
  std::optional<SleepDesc> sleep;     ///< absent: nothing sleeps
  CameraDesc camera;
  std::vector<CameraDesc> cameras;    ///< instead of camera: each has an image sequence and a film
  LightDesc light;
  std::vector<AreaLightDesc> lights;
  BackgroundDesc background;
  RenderDesc render;
  std::optional<GroundDesc> ground;
  OutputDesc output;
  std::filesystem::path source;       ///< the file it was read from; not a key
  std::shared_ptr<const ScenePlaces> places;  ///< lines and columns of its keys in that file, for messages; not a key
  std::uint64_t content_hash = 0;     ///< of all keys that act on the motion, and of files they name; identifies the scene of saved states; not a key
  std::shared_ptr<const std::string> motion_keys;  ///< these keys with their values, for messages; not a key
  std::uint64_t picture_hash = 0;     ///< of all keys that affect a picture of a state, and of files they name; not a key

  /// Frame n shows t = (n - 1) / frame_rate; frame 1 is the initial state.
  [[nodiscard]] int frame_count() const;
};

}  // namespace supple::scenes
