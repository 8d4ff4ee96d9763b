#include "supple/scenes/model.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <span>

#include "file/expand/course.h"
#include "model/arrangement.h"
#include "model/led_pins.h"
#include "model/material.h"
#include "model/model_contact.h"
#include "model/model_faults.h"
#include "model/model_laws.h"
#include "model/model_skeleton.h"
#include "model/model_volume.h"
#include "model/point_tree.h"
#include "supple/core/error.h"
#include "supple/scenes/accuracy.h"

namespace supple::scenes {
namespace {

constexpr double kCellsAlong = 64.0;   // at least, along the largest side of an object with its supports

constexpr double kRounding = 1e-12;  // of a time that is a sum of steps

constexpr double kBelievable = 1e4;     // ways of a particle over the size of everything, and over that in a frame

/// Which particles are hinges, and the types of the others.
void set_kinds(const ObjectDesc& d, const std::string& key, const ObjectModel& object, Model& model, ModelFaults& faults) {
  const std::uint32_t n = object.last - object.first;
  for (std::size_t k = 0; k < d.kinds.size(); ++k) {
    for (std::size_t j = 0; j < d.kinds[k].particles.size(); ++j) {
      const std::string place = key + ".kinds[" + std::to_string(k) + "].particles[" + std::to_string(j) + ']';
      if (const auto index = particle_index(d.kinds[k].particles[j], n, place, faults)) {
        model.particles.kind[object.first + *index] =
            d.kinds[k].hinge ? core::kHinge : static_cast<std::uint32_t>(d.kinds[k].type);
      }
    }
  }
}

/// Principal moments of a solid ellipsoid of these semi-axes, m/5 (b^2 + c^2, ...).
Vec3 principal_moments(double mass, const Vec3& axes) {
  const Vec3 squares = axes.cwiseAbs2();
  return 0.2 * mass * (Vec3::Constant(squares.sum()) - squares);
}

/// Of a ball around the primitive's origin that holds its support.
double largest_radius(const implicit::Primitive& p) {
  const bool plain = p.shape <= implicit::ShapeKind::Ellipsoid && p.taper == 1.0 && p.stretch == Vec3::Ones();
  if (plain) return p.size.norm() + p.kernel.radius;
  const Box box = implicit::support_box(p);
  return box.lower.cwiseAbs().cwiseMax(box.upper).norm();
}

/// The solids that single particles carry; particles with the same entries of the skeleton share one.
class CarriedSolids {
 public:
  CarriedSolids(const ObjectDesc& d, const implicit::Skeleton& skeleton, std::uint32_t n, bool planar) : skeleton_(skeleton), planar_(planar), entries_(n) {
    for (std::uint32_t k = 0; k < d.skeleton.size(); ++k) {
      for (const int given : d.skeleton[k].particles) {
        const std::int64_t index = given < 0 ? std::int64_t{given} + n : given;
        if (index >= 0 && index < n) entries_[static_cast<std::size_t>(index)].push_back(k);
      }
    }
  }
  const CarriedSolid& of(std::uint32_t particle) {
    const auto [place, fresh] = solids_.try_emplace(entries_[particle]);  // entries without a list belong to all
    if (fresh) place->second = carried_solid(skeleton_, particle, planar_);
    return place->second;
  }

 private:
  const implicit::Skeleton& skeleton_;
  bool planar_;
  std::vector<std::vector<std::uint32_t>> entries_;
  std::map<std::vector<std::uint32_t>, CarriedSolid> solids_;
};

constexpr double kUnitMass = 1.0;  // [kg], of a particle where the scene says nothing

/// @param volumes  of the particles, where the object has a material
std::vector<double> masses_of(const ObjectDesc& d, const core::Arrangement& arrangement, std::span<const double> volumes) {
  std::vector<double> mass = arrangement.mass;
  if (mass.empty()) mass.assign(arrangement.size(), d.particles.mass.value_or(kUnitMass));
  for (std::size_t i = 0; i < volumes.size(); ++i) mass[i] = d.material->density * volumes[i];
  return mass;
}

Vec3 centre_of(std::span<const Vec3> position, std::span<const double> mass) {
  Vec3 sum = Vec3::Zero();
  double all = 0.0;
  for (std::size_t i = 0; i < position.size(); ++i) {
    sum += mass[i] * position[i];
    all += mass[i];
  }
  return sum / all;
}

/// Skeleton, blending graph and held volume of an object with this arrangement.
void add_surface(const ObjectDesc& d, const std::string& key, const core::Arrangement& arrangement, ObjectModel& object, ModelFaults& faults) {
  const auto n = static_cast<std::uint32_t>(arrangement.size());
  std::vector<double> volume;
  object.skeleton = build_skeleton(d, key, n, volume, faults);
  if (d.blend) {
    object.skeleton.blend = blend_of(*d.blend, key + ".blend", arrangement.position, faults);
    object.fade = d.blend->fade;
  }
  for (const implicit::Primitive& primitive : object.skeleton.primitive) {
    const double iso = iso_radius(primitive, d.iso);
    object.iso_radius = object.iso_radius == 0.0 ? iso : std::min(object.iso_radius, iso);
  }
  if (d.volume && !object.skeleton.primitive.empty()) hold_volume(d, key, n, std::move(volume), object, faults);
}

/// What the particles of one object follow from.
struct ParticleSource {
  const Scene& scene;
  const ObjectDesc& d;
  const core::Arrangement& arrangement;
  std::vector<double> volume;   ///< of each particle, where the object has a material [m^3]
  std::vector<double> mass;     ///< [kg]
  std::vector<double> nearest;  ///< distance to the next particle [m]
  Vec3 centre = Vec3::Zero();   ///< of mass [m]
};

/// A solid ellipsoid with the inertia of a particle: its semi-axes, in the frame of the arrangement after a turn.
struct InertiaEllipsoid {
  Vec3 axes = Vec3::Zero();
  Quat turn = Quat::Identity();
};

/// The frame of a single particle is turned to the principal axes of its solid; no laws depend on it.
InertiaEllipsoid inertia_of(const ParticleSource& s, std::uint32_t i, CarriedSolids& solids) {
  const ParticlesDesc& particles = s.d.particles;
  InertiaEllipsoid own{.axes = particles.inertia_axes};
  if (particles.inertia_radius) {
    own.axes.setConstant(*particles.inertia_radius);
  } else if (own.axes.isZero() && !s.arrangement.inertia_radius.empty()) {
    own.axes.setConstant(s.arrangement.inertia_radius[i]);
  } else if (own.axes.isZero() && (s.arrangement.size() == 1 || s.d.separate)) {
    const CarriedSolid& lone = solids.of(i);
    own.axes = lone.axes;
    if (s.scene.planar) own.axes.setConstant(std::sqrt(0.5 * (own.axes.x() * own.axes.x() + own.axes.y() * own.axes.y())));  // it turns about z alone
    own.turn = lone.turn;
  } else if (own.axes.isZero()) {
    own.axes.setConstant(s.d.material ? cube_inertia_radius(s.volume[i]) : 0.5 * s.nearest[i]);
  }
  return own;
}

/// A fault where a particle has no extent.
void expect_extent(const ObjectDesc& d, const std::string& key, std::size_t n, const Vec3& axes, ModelFaults& faults) {
  if (axes.maxCoeff() > 0.0 || faults.has(key + ".iso")) return;  // without a surface there is no solid
  faults.add_once(key + ".particles.inertia_radius", "expected a length > 0 [m]", "nothing",
                  n > 1 && !d.separate ? "two particles are at the same place: this key is required"
                  : d.skeleton.empty() ? "a single particle without a surface: this key is required"
                                       : "no point was found where the field of its skeleton reaches the iso value");
}

void add_particle(const ParticleSource& s, std::uint32_t i, const InertiaEllipsoid& own, Model& model) {
  const core::Arrangement& arrangement = s.arrangement;
  const ParticlesDesc& given = s.d.particles;
  const Vec3 inertia = principal_moments(s.mass[i], own.axes);
  Quat q = arrangement.orientation[i];
  if (own.turn.w() != 1.0) q = (q * own.turn).normalized();
  model.particles.mass.push_back(s.mass[i]);
  model.particles.inertia.push_back(inertia);
  model.particles.normal.push_back(own.turn.conjugate() * (arrangement.normal.empty() ? given.own_normal.normalized() : arrangement.normal[i]));
  model.particles.object.push_back(static_cast<std::uint32_t>(model.objects.size()));
  model.particles.pinned.push_back(0);
  model.particles.kind.push_back(0);
  model.initial.position.push_back(arrangement.position[i]);
  model.initial.orientation.push_back(q);
  const Vec3 velocity = arrangement.velocity.empty() ? Vec3(Vec3::Zero()) : arrangement.velocity[i];
  model.initial.velocity.push_back(velocity + given.velocity + given.spin.cross(arrangement.position[i] - s.centre));
  model.initial.angular_momentum.emplace_back(q * inertia.cwiseProduct(q.conjugate() * given.spin));
}

/// Length that particle i makes the scene resolve.
double length_of(const ParticleSource& s, std::uint32_t i, const Vec3& axes, const ObjectModel& object) {
  // Bodies that only meet by their surfaces may begin anywhere; what begins in one place has no distance to resolve.
  const bool only_touches = s.d.separate && object.iso_radius > 0.0;
  if (s.nearest[i] > 0.0 && std::isfinite(s.nearest[i]) && !only_touches) return s.nearest[i];
  if (s.arrangement.size() == 1) return 0.5 * object.rest_diameter;
  return object.iso_radius > 0.0 ? object.iso_radius : axes.maxCoeff();
}

/// Particles of one object.
void add_particles(const Scene& scene, const ObjectDesc& d, const std::string& key, ObjectModel& object, Model& model,
                   ModelFaults& faults) {
  const core::Arrangement arrangement = arrange(scene, d.particles, key + ".particles", faults);
  const auto n = static_cast<std::uint32_t>(arrangement.size());
  object.first = static_cast<std::uint32_t>(model.particles.size());
  object.last = object.first + n;
  if (n == 0) {
    faults.add_once(key + ".particles.file", "expected at least one particle", "none", "");
    return;
  }
  add_surface(d, key, arrangement, object, faults);
  const PointTree tree(arrangement.position);
  ParticleSource source{.scene = scene, .d = d, .arrangement = arrangement, .volume = {}, .mass = {}, .nearest = tree.nearest_distances()};
  if (d.material) {
    source.volume = material_volumes(d, key, arrangement, object.skeleton, faults);
    object.solid_volume = std::accumulate(source.volume.begin(), source.volume.end(), 0.0);
  }
  source.mass = masses_of(d, arrangement, source.volume);
  source.centre = centre_of(arrangement.position, source.mass);
  CarriedSolids solids(d, object.skeleton, n, scene.planar);
  std::vector<Quat> turn;
  for (std::uint32_t i = 0; i < n; ++i) {
    const InertiaEllipsoid own = inertia_of(source, i, solids);
    expect_extent(d, key, n, own.axes, faults);
    add_particle(source, i, own, model);
    turn.push_back(own.turn);
    if (n == 1) object.rest_diameter = 2.0 * (object.iso_radius > 0.0 ? object.iso_radius : own.axes.maxCoeff());
    model.smallest_length = std::min(model.smallest_length, length_of(source, i, own.axes, object));
  }
  turn_primitives(turn, object.skeleton);
  if (object.iso_radius > 0.0) model.smallest_length = std::min(model.smallest_length, object.iso_radius);
  if (n > 1) object.rest_diameter = tree.largest_distance();
}

/// Null without a course; a fault at `key` where its expression has no value at some time.
std::shared_ptr<const core::Course> course_in(const Scene& scene, const std::optional<CourseDesc>& d, const std::string& key, ModelFaults& faults) try {
  return course_of(d, scene);
} catch (const ExpressionFault& fault) {
  faults.add(key + ".expression", fault.expected, fault.found, fault.hint);
  return nullptr;
}

void add_pins_and_loads(const Scene& scene, const ObjectDesc& d, const std::string& key, const ObjectModel& object, Model& model,
                        ModelFaults& faults) {
  const std::uint32_t n = object.last - object.first;
  for (std::size_t k = 0; k < d.pins.size(); ++k) {
    const auto index = particle_index(d.pins[k].particle, n, key + ".pins[" + std::to_string(k) + "].particle", faults);
    if (!index) continue;
    const auto pins = static_cast<std::uint8_t>((d.pins[k].position ? core::kPinPosition : 0) | (d.pins[k].orientation ? core::kPinOrientation : 0));
    if (std::isfinite(d.pins[k].until)) {
      model.releases.push_back({object.first + *index, pins, d.pins[k].until});
    } else {
      model.particles.pinned[object.first + *index] |= pins;
    }
    if (d.pins[k].motion) add_led_pin(scene, d.pins[k], key + ".pins[" + std::to_string(k) + ']', {.particle = object.first + *index, .pins = pins, .place = {}}, model, faults);
  }
  for (std::size_t k = 0; k < d.loads.size(); ++k) {
    const LoadDesc& load = d.loads[k];
    const auto index = particle_index(load.particle, n, key + ".loads[" + std::to_string(k) + "].particle", faults);
    if (!index) continue;
    const std::shared_ptr<const core::Course> course = course_in(scene, load.course, key + ".loads[" + std::to_string(k) + "].course", faults);
    model.interactions.external.push_back(
        {object.first + *index, load.force, load.torque, load.from, load.until, load.ramp, course});
  }
}

/// Gravity with a course, and the push of the wind gamma m w, are loads on each particle.
void add_changing_fields(const Scene& scene, Model& model, ModelFaults& faults) {
  const double forever = std::numeric_limits<double>::infinity();
  const auto add = [&](std::uint32_t i, const Vec3& force, const std::shared_ptr<const core::Course>& course) {
    model.interactions.external.push_back({i, force, Vec3::Zero(), 0.0, forever, 0.0, course});
  };
  if (scene.gravity_course && !scene.gravity.isZero()) {
    const auto course = course_in(scene, scene.gravity_course, "gravity_course", faults);
    model.interactions.gravity.setZero();
    for (std::uint32_t i = 0; i < model.particles.size(); ++i) add(i, model.particles.mass[i] * scene.gravity, course);
  }
  if (!scene.wind || scene.wind->velocity.isZero()) return;
  const auto course = course_in(scene, scene.wind->course, "wind.course", faults);
  for (std::size_t k = 0; k < scene.objects.size(); ++k) {
    if (!scene.objects[k].medium || scene.objects[k].medium->linear == 0.0) continue;
    for (std::uint32_t i = model.objects[k].first; i < model.objects[k].last; ++i) {
      add(i, scene.objects[k].medium->linear * model.particles.mass[i] * scene.wind->velocity, course);
    }
  }
}

/// Links that a cut breaks, by their bonds at the start.
void add_cuts(const ObjectDesc& d, const std::string& key, const ObjectModel& object, Model& model, ModelFaults& faults) {
  const std::uint32_t n = object.last - object.first;
  for (std::size_t k = 0; k < d.cuts.size(); ++k) {
    const CutDesc& cut = d.cuts[k];
    const std::string place = key + ".cuts[" + std::to_string(k) + ']';
    std::vector<std::uint8_t> side(n, 0);  // 1: listed, or beyond the plane
    for (std::size_t j = 0; j < cut.particles.size(); ++j) {
      if (const auto index = particle_index(cut.particles[j], n, place + ".particles[" + std::to_string(j) + ']', faults)) side[*index] = 1;
    }
    for (std::uint32_t i = 0; cut.at && i < n; ++i) side[i] = (model.rest.position[object.first + i] - *cut.at).dot(cut.normal) > 0.0 ? 1 : 0;
    CutEvent event{.time = cut.time, .links = {}};
    for (std::uint32_t link = 0; link < model.links.size(); ++link) {
      const std::uint32_t a = model.links.first[link], b = model.links.second[link];
      if (a < object.first || a >= object.last) continue;
      const int sides = side[a - object.first] + side[b - object.first];
      if (sides == (cut.at ? 1 : 2)) event.links.push_back(link);
    }
    if (event.links.empty()) faults.add(place, "expected a bond that is cut", "none", cut.at ? "move the plane between bonded particles" : "name two bonded particles");
    model.cuts.push_back(std::move(event));
  }
}

core::LinkRule link_rule(const ObjectDesc& d, std::uint32_t object) {
  core::LinkRule rule{.object = object, .breaking = {}, .yield = {}};
  if (d.breaking) {
    rule.breaking.stretch = d.breaking->stretch.value_or(rule.breaking.stretch);
    rule.breaking.energy = d.breaking->energy.value_or(rule.breaking.energy);
    rule.breaking.force = d.breaking->force.value_or(rule.breaking.force);
    rule.breaking.couple = d.breaking->couple.value_or(rule.breaking.couple);
  }
  if (d.yielding) rule.yield = {d.yielding->energy, d.yielding->time};
  rule.cut = !d.cuts.empty();
  return rule;
}

/// Components of the blending graph of an object with self contact become bodies, and so do groups that are connected through others only. An object that keeps its
/// volume stays one body: all that do not blend are groups of it.
void divide_by_blend(const ObjectDesc& d, ObjectModel& object) {
  if (!d.contact->self.value_or(true)) return;
  BlendComponents components = blend_components(object.skeleton.blend, object.last - object.first);
  const bool several = std::any_of(components.first.begin(), components.first.end(), [](std::uint32_t first) { return first != 0; });
  const std::vector<std::uint32_t>& node = object.skeleton.blend.node;
  std::vector<std::uint8_t> solid(node.size(), 0);  // nodes that have primitives; there are no more than particles
  for (const implicit::Primitive& primitive : object.skeleton.primitive) {
    if (!node.empty()) solid[node[primitive.part]] = 1;
  }
  if (d.volume ? several : object.fade > 0.0 && object.skeleton.blend.rule == implicit::BlendRule::Graph) {  // any two groups may not blend, then or later
    std::vector<std::uint8_t> seen(node.size(), 0);
    components.group.clear();
    for (std::uint32_t i = 0; i < node.size(); ++i) {
      if (seen[node[i]]++ == 0) components.group.push_back(i);
    }
  }
  std::erase_if(components.group, [&](std::uint32_t first) { return solid[node[first]] == 0; });
  if (several && !d.volume) object.component = std::move(components.first);
  object.group = std::move(components.group);
}

/// All particles move in one plane z = const.
void confine_to_plane(Model& model, ModelFaults& faults) {
  const double z = model.initial.position.front().z();
  for (std::size_t i = 0; i < model.particles.size(); ++i) {
    const double other = model.initial.position[i].z();
    if (other != z) {
      const std::string& name = model.objects[model.particles.object[i]].name;
      faults.add_once("objects." + name + ".particles", "expected all particles at one z in a planar scene",
                      "z = " + number_text(other) + " m beside z = " + number_text(z) + " m",
                      "choose 'at' and 'axis' so that they lie in one horizontal plane, or remove 'planar'");
    }
    model.particles.pinned[i] |= core::kPlanar;
  }
}

/// Far from the origin rounding makes points of a thin object equal.
void expect_resolved(const Model& model, ModelFaults& faults) {
  constexpr double kFurthest = 1e8;  // kernel radii, of which round-off is then 1e-8
  std::vector<double> thinnest(model.objects.size(), std::numeric_limits<double>::infinity());
  for (std::size_t k = 0; k < thinnest.size(); ++k) {
    for (const implicit::Primitive& p : model.objects[k].skeleton.primitive) thinnest[k] = std::min(thinnest[k], p.kernel.radius);
  }
  for (std::size_t i = 0; i < model.particles.size(); ++i) {
    const ObjectModel& object = model.objects[model.particles.object[i]];
    const double radius = thinnest[model.particles.object[i]];
    const double away = model.initial.position[i].norm();
    if (away <= kFurthest * radius) continue;
    faults.add_once("objects." + object.name + ".particles", "expected positions within 1e8 kernel radii of the origin",
                    short_text(away) + " m away with a radius of " + short_text(radius) + " m", "move the scene nearer to the origin");
  }
}

/// Objects that appear later are held until then.
void add_appearances(const Scene& scene, Model& model) {
  for (std::uint32_t i = 0; i < model.objects.size(); ++i) {
    const double time = scene.objects[i].appears;
    if (time == 0.0) continue;
    Appearance& appearance = model.appearances.emplace_back(Appearance{.time = time, .object = i, .velocity = {}, .angular_momentum = {}});
    for (std::uint32_t p = model.objects[i].first; p < model.objects[i].last; ++p) {
      model.releases.push_back({p, core::kPinPosition | core::kPinOrientation, time});
      appearance.velocity.push_back(core::free_translation(model.held[p], model.initial.velocity[p]));
      appearance.angular_momentum.push_back(core::free_rotation(model.held[p], model.initial.angular_momentum[p]));
    }
  }
  std::stable_sort(model.appearances.begin(), model.appearances.end(), [](const Appearance& a, const Appearance& b) { return a.time < b.time; });
}

/// Pinned particles begin at rest, or the pin would take their momentum in the first step.
void stop_pinned(Model& model) {
  for (std::size_t i = 0; i < model.particles.size(); ++i) {
    const std::uint8_t pinned = model.particles.pinned[i];
    model.initial.velocity[i] = core::free_translation(pinned, model.initial.velocity[i]);
    model.initial.angular_momentum[i] = core::free_rotation(pinned, model.initial.angular_momentum[i]);
  }
}

/// Error of meshes that follows from `accuracy`; none where the scene gives a cell, a pixel error or another mesher.
std::optional<double> error_by_accuracy(const Scene& scene, const ObjectModel& object) {
  const MeshingName method = scene.output.meshing.method;
  const bool cubes = method == MeshingName::Auto || method == MeshingName::Cubes;
  if (!cubes || object.cell_is_stated || scene.render.pixel_error || object.skeleton.primitive.empty()) return std::nullopt;
  return accuracy_rules(*scene.accuracy).mesh_share * size_of(object);
}

/// Limits of what is no divergence: where particles start and how fast, free flight, also under the loads, and far more than
/// the size of the objects on top.
void set_believable(const Scene& scene, const Box& everything, Model& model) {
  double size = everything.extent().norm();
  if (!(size > 0.0)) size = model.smallest_length;
  double start = 0.0, speed = 0.0;
  for (std::size_t i = 0; i < model.particles.size(); ++i) {
    start = std::max(start, model.initial.position[i].norm());
    speed = std::max(speed, model.initial.velocity[i].norm());
  }
  for (const core::LedPin& pin : model.led) {
    for (int k = 0; k <= scene.frame_count(); ++k) start = std::max(start, pin.place(k / scene.frame_rate).position.norm());
  }
  for (const FixedBody& body : model.fixed) {
    for (const ObstacleKeyDesc& key : body.motion.keys) start = std::max(start, key.at.norm());
  }
  std::vector<double> pushed(model.particles.size(), 0.0);
  for (const core::ExternalLoad& load : model.interactions.external) {
    pushed[load.particle] += (load.course ? load.course->largest() : 1.0) * load.force.norm();
  }
  double acceleration = 0.0;
  for (std::size_t i = 0; i < pushed.size(); ++i) acceleration = std::max(acceleration, pushed[i] / model.particles.mass[i]);
  model.believable = {.size = kBelievable * size + start,
                      .speed = std::max(speed, model.solid_speed),
                      .margin = kBelievable * size * scene.frame_rate,
                      .acceleration = scene.gravity.norm() + acceleration};
}

/// Particles, surfaces, pins and loads of all objects.
void add_objects(const Scene& scene, Model& model, ModelFaults& faults) {
  for (const ObjectDesc& d : scene.objects) {
    const std::string key = "objects." + d.name;
    SUPPLE_EXPECTS(d.particles.mass.value_or(kUnitMass) > 0.0);
    ObjectModel object;
    object.name = d.name;
    add_particles(scene, d, key, object, model, faults);
    if (object.first == object.last) continue;
    if (d.contact) {
      object.material = contact_material(d, object.skeleton);
      object.collides = !object.skeleton.primitive.empty();
      object.breaks = d.breaking.has_value() || !d.cuts.empty();
    }
    object.separate = d.separate;
    if (object.collides && !object.separate) divide_by_blend(d, object);
    set_kinds(d, key, object, model, faults);
    object.hinges_join = d.hinges_join;
    add_pins_and_loads(scene, d, key, object, model, faults);
    model.objects.push_back(std::move(object));
  }
  if (model.particles.size() == 0 && faults.none()) faults.add("objects", "expected at least one object with particles", "none", "");
  faults.raise();  // what follows needs particles
}

/// The rest pose, and what is held at the start.
void set_start(const Scene& scene, Model& model, ModelFaults& faults) {
  model.rest = model.initial;
  for (Vec3& velocity : model.rest.velocity) velocity.setZero();
  for (Vec3& momentum : model.rest.angular_momentum) momentum.setZero();
  if (scene.planar) confine_to_plane(model, faults);
  model.held = model.particles.pinned;
  add_appearances(scene, model);
  model.particles.pinned = pinned_at(model, 0.0);
  stop_pinned(model);
  expect_resolved(model, faults);
  sort_led_pins(scene, model, faults);
}

/// Laws and damping of all objects. @return how their links break and yield
std::vector<core::LinkRule> add_all_laws(const Scene& scene, Model& model, ModelFaults& faults) {
  model.interactions.gravity = scene.gravity;
  add_changing_fields(scene, model, faults);
  std::vector<core::LinkRule> link_rules;
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    const ObjectDesc& d = scene.objects[i];
    const auto object = static_cast<std::uint32_t>(i);
    add_laws(d.interactions, model.objects[i], "objects." + d.name, model, faults);
    if (d.material) add_material_laws(d, model.objects[i], "objects." + d.name, model, faults);
    if (d.breaking || d.yielding || !d.cuts.empty()) link_rules.push_back(link_rule(d, object));
    if (d.rayleigh && d.rayleigh->mass > 0.0) model.interactions.medium.push_back({object, d.rayleigh->mass, d.rayleigh->mass});
    if (d.rayleigh && d.rayleigh->stiffness > 0.0) model.interactions.stiffness_damping.push_back({object, d.rayleigh->stiffness});
    if (d.medium) model.interactions.medium.push_back({object, d.medium->linear, d.medium->angular});
  }
  return link_rules;
}

/// What an object's mesh is to resolve.
struct ObjectExtent {
  Box box;                                                     ///< with its surface [m]
  double cell = std::numeric_limits<double>::infinity();       ///< that fits [m]
  bool thin = false;                                           ///< its thickness decides about the cell
};

ObjectExtent extent_of(const ObjectModel& object, const Model& model) {
  ObjectExtent own;
  double reach = object.iso_radius;
  for (const implicit::Primitive& primitive : object.skeleton.primitive) {
    const double thickness = 2.0 * (iso_radius(primitive, object.skeleton.iso) + solid_half_size(primitive));
    own.cell = std::min(own.cell, thickness / kCellsAcross);
    reach = std::max(reach, primitive.offset.position.norm() + largest_radius(primitive));
  }
  for (std::uint32_t p = object.first; p < object.last; ++p) {
    own.box = own.box.united(Box{model.rest.position[p], model.rest.position[p]}.inflated(reach));
  }
  const double coarsest = own.box.extent().maxCoeff() / kCellsAlong;
  own.thin = !object.skeleton.primitive.empty() && own.cell < coarsest;
  if (!object.skeleton.primitive.empty() && !own.thin) own.cell = coarsest;
  return own;
}

/// Cells and errors of the meshes of all objects. @return the box of all objects with their surfaces
Box set_cells(const Scene& scene, Model& model) {
  double cell = std::numeric_limits<double>::infinity();
  double least_own = cell;
  Box everything;
  for (std::size_t i = 0; i < model.objects.size(); ++i) {
    ObjectModel& object = model.objects[i];
    const ObjectMeshingDesc& meshing = scene.objects[i].meshing;
    object.own_cell = meshing.cell.has_value();
    object.cell_is_stated = object.own_cell || scene.output.cell;
    object.own_error = meshing.error.has_value();
    object.mesh_error = meshing.error ? meshing.error : scene.output.meshing.error;
    if (scene.accuracy && !object.mesh_error) object.mesh_error = error_by_accuracy(scene, object);
    if (meshing.cell) least_own = std::min(least_own, *meshing.cell);
    const ObjectExtent own = extent_of(object, model);
    if (!object.own_cell && own.cell < cell) {
      cell = own.cell;
      model.thinnest.reset();
      if (own.thin && !scene.output.cell) model.thinnest = static_cast<std::uint32_t>(i);
    }
    everything = everything.united(own.box);
  }
  if (!std::isfinite(cell)) cell = least_own;
  if (std::isfinite(cell)) model.cell = scene.output.cell.value_or(cell);
  for (std::size_t i = 0; i < model.objects.size(); ++i) {
    ObjectModel& object = model.objects[i];
    object.look = scene.objects[i].look;
    if (!object.skeleton.primitive.empty()) object.cell = scene.objects[i].meshing.cell.value_or(model.cell);
  }
  return everything;
}

/// Rules of meshes; velocities of their vertices where pictures need them.
void set_meshing(const Scene& scene, Model& model) {
  model.meshing = scene.output.meshing;
  if (scene.output.images) {
    const auto& formats = scene.output.images->formats;
    if (std::find(formats.begin(), formats.end(), ImageName::Exr) != formats.end()) model.meshing.motion = true;
  }
  if (scene.render.shutter > 0.0) model.meshing.motion = true;
}

}  // namespace

bool is_there(const Model& model, std::uint32_t object, double time) {
  return std::none_of(model.appearances.begin(), model.appearances.end(), [&](const Appearance& appearance) {
    return appearance.object == object && time < appearance.time * (1.0 - kRounding);
  });
}

std::vector<collision::BodyPair> closed_at(const Model& model, double time) {
  std::vector<collision::BodyPair> closed;
  for (const ContactWindow& window : model.windows) {
    if (time < window.from * (1.0 - kRounding) || time >= window.until * (1.0 - kRounding)) closed.push_back(window.pair);
  }
  for (const Appearance& appearance : model.appearances) {
    if (is_there(model, appearance.object, time)) continue;
    for (std::uint32_t other = 0; other < model.objects.size() + model.fixed.size(); ++other)
      closed.push_back({std::min(appearance.object, other), std::max(appearance.object, other)});
  }
  std::sort(closed.begin(), closed.end());
  return closed;
}

bool may_touch(const Model& model, std::uint32_t a, std::uint32_t b) {
  return (!model.rules.allowed || model.rules.allowed(a, b)) &&
         !std::binary_search(model.closed.begin(), model.closed.end(), collision::BodyPair{std::min(a, b), std::max(a, b)});
}

std::vector<std::uint8_t> pinned_at(const Model& model, double time) {
  std::vector<std::uint8_t> pinned = model.held;
  for (const PinRelease& release : model.releases) {
    if (time < release.time * (1.0 - kRounding)) pinned[release.particle] |= release.pins;
  }
  return pinned;
}

double size_of(const ObjectModel& object) {
  const double surface = 2.0 * object.iso_radius;
  if (object.separate || object.last == object.first + 1) return surface > 0.0 ? surface : object.rest_diameter;
  return object.rest_diameter + surface;
}

Model build_model(const Scene& scene, double memory) {
  SUPPLE_EXPECTS(scene.duration > 0.0 && scene.frame_rate > 0.0);  // scenes need not come from a file
  SceneCounts counts = count_scene(scene, memory);
  std::erase_if(counts.count, [](const Count& count) { return rule_of(count.what).drawn; });
  MemoryBudget budget(scene, std::move(counts), memory);
  Model model;
  ModelFaults faults(scene);
  model.smallest_length = std::numeric_limits<double>::infinity();
  add_objects(scene, model, faults);
  set_start(scene, model, faults);
  const std::vector<core::LinkRule> link_rules = add_all_laws(scene, model, faults);
  build_contact(scene, budget, model, faults);
  faults.raise();
  model.links = core::make_links(model.particles, model.rest, model.interactions, link_rules);
  for (std::size_t i = 0; i < scene.objects.size(); ++i) add_cuts(scene.objects[i], "objects." + scene.objects[i].name, model.objects[i], model, faults);
  faults.raise();
  const Box everything = set_cells(scene, model);
  set_meshing(scene, model);
  set_believable(scene, everything, model);
  return model;
}

}  // namespace supple::scenes
