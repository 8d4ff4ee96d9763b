#include "model/model_contact.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <span>

#include "model/model_skeleton.h"
#include "supple/core/error.h"
#include "supple/core/io/mesh_files.h"
#include "supple/core/io/read_mesh.h"
#include "supple/core/math.h"
#include "supple/scenes/accuracy.h"

namespace supple::scenes {
namespace {

using collision::BodyPair;

constexpr double kSamplesAcross = 6.0;  // of the smallest thickness
constexpr double kRoughAcross = 3.0;    // the same, where contact.error is kRough or more
constexpr double kRough = 5e-2;

/// x - ln(1 + x) for x > -1, without cancellation near 0.
double lag(double x) {
  if (std::abs(x) > 0.2) return x - math::log(1.0 + x);
  double sum = 0.0;
  double power = x;
  for (int k = 2; k < 26; ++k) {  // 0.2^26 is below the last bit
    power *= -x;
    sum -= power / k;
  }
  return sum;
}

collision::ContactRule rule_of(RuleName name) {
  switch (name) {
    case RuleName::Polar: return collision::ContactRule::Polar;
    case RuleName::March: return collision::ContactRule::March;
    case RuleName::Panels: return collision::ContactRule::Panels;
    case RuleName::Auto: break;
  }
  return collision::ContactRule::None;
}

constexpr std::uint32_t kNobody = 0xffffffff;

/// Index of an object, or of a fixed body after them.
std::uint32_t body_of(const Model& model, const std::string& name) {
  for (std::uint32_t i = 0; i < model.objects.size(); ++i) {
    if (model.objects[i].name == name) return i;
  }
  for (std::uint32_t i = 0; i < model.fixed.size(); ++i) {
    if (model.fixed[i].name == name) return static_cast<std::uint32_t>(model.objects.size()) + i;
  }
  return kNobody;
}

/// Upper estimate of the angular frequency of one object's contact, sqrt(P k A / m): its pressure rises by P k a metre
/// of depth (k = |grad f| on the surface), over the patch of a primitive at moderate overlap, A = pi a (a + h) with a the
/// iso distance and h the largest half size (a linear ball is at most half as stiff: F' <= pi K a^2 / 2), on the
/// lightest particle that carries such a primitive. Against another body both compliances are in series, so a pair is
/// never faster than the faster of its two bodies against a rigid one. Where the normal passes the particle's centre at an arm
/// r, which what extends beyond a ball allows, it turns, too: 1 / m + r^2 / I in place of 1 / m. Blows at the very end of a body
/// are brief: they are let have twice the phase in a step.
struct ContactSpring {
  double stiffness = 0.0;     ///< [N/m]
  double inverse_mass = 0.0;  ///< [1/kg]
};

/// Of every primitive.
std::vector<ContactSpring> contact_springs(const ObjectModel& object, const core::ParticleSet& particles) {
  std::vector<ContactSpring> springs;
  for (const implicit::Primitive& primitive : object.skeleton.primitive) {
    const double a = iso_radius(primitive, object.skeleton.iso);
    const double scale = implicit::distance_scale(primitive);
    const Vec3 support = 0.5 * implicit::support_box(primitive).extent();
    const double least = primitive.kernel.radius / scale;
    const double half = std::max(support.maxCoeff() - least, 0.0) * (implicit::scales(primitive) ? a / least : 1.0);
    const double slope = implicit::iso_slope(primitive.kernel, object.skeleton.iso) * scale;
    const double stiffness = object.material.modulus * slope * std::numbers::pi * a * (a + half);
    const std::uint32_t carrier = object.first + primitive.part;
    const double arm = primitive.offset.position.norm() + (support - Vec3::Constant(least)).cwiseMax(0.0).norm();
    const double inverse_mass = 1.0 / particles.mass[carrier];
    const double turning = 0.25 * (inverse_mass + arm * arm / particles.inertia[carrier].minCoeff());
    springs.push_back({stiffness, std::max(inverse_mass, turning)});
  }
  return springs;
}

double contact_frequency(const ObjectModel& object, const core::ParticleSet& particles) {
  double largest = 0.0;
  for (const ContactSpring& spring : contact_springs(object, particles)) largest = std::max(largest, spring.stiffness * spring.inverse_mass);
  return std::sqrt(largest);
}

/// The stiffest of an object's contacts and the lightest that it moves, which need not be one.
ContactSpring extreme_of(const ObjectModel& object, const core::ParticleSet& particles) {
  ContactSpring out;
  for (const ContactSpring& spring : contact_springs(object, particles)) {
    out.stiffness = std::max(out.stiffness, spring.stiffness);
    out.inverse_mass = std::max(out.inverse_mass, spring.inverse_mass);
  }
  return out;
}

/// The same of the springs of friction: half a dozen at a particle, at arms of its iso radius. Their damping counts as the
/// frequency at which a step would overshoot by the same amount.
double stick_frequency(const ObjectModel& object, const core::ParticleSet& particles, const collision::StickRule& stick) {
  constexpr double kSprings = 6.0;
  double lightest = 0.0;  // inverse mass at the end of such an arm [1/kg]
  for (std::uint32_t i = object.first; i < object.last; ++i) {
    const double arm = object.iso_radius;
    lightest = std::max(lightest, 1.0 / particles.mass[i] + arm * arm / particles.inertia[i].minCoeff());
  }
  const double square = kSprings * stick.stiffness * lightest;
  return std::hypot(std::sqrt(square), square * stick.damping);
}

/// Heights at the points of a regular grid, in any order.
implicit::HeightField height_field(const Scene& scene, const ObstacleDesc& d, const std::string& key, ModelFaults& faults) {
  const implicit::HeightField none{Vec3::Zero(), 1.0, 2, 2, std::vector<double>(4, 0.0), 1.0};
  auto read = faults.read(key + ".file", [&] { return io::read_points_csv(named_file(files_of(scene), d.file)); });
  if (!read) return none;
  std::vector<Vec3>& points = *read;
  std::sort(points.begin(), points.end(), [](const Vec3& a, const Vec3& b) {
    return a.y() != b.y() ? a.y() < b.y() : a.x() < b.x();
  });
  std::size_t columns = 0;
  while (columns < points.size() && points[columns].y() == points[0].y()) ++columns;
  const std::size_t rows = columns > 0 ? points.size() / columns : 0;
  bool regular = columns >= 2 && rows >= 2 && columns * rows == points.size();
  const double spacing = regular ? points[1].x() - points[0].x() : 1.0;
  regular = regular && spacing > 0.0;
  std::vector<double> heights;
  for (std::size_t i = 0; i < points.size() && regular; ++i) {
    const double x = points[0].x() + spacing * static_cast<double>(i % columns);
    const double y = points[0].y() + spacing * static_cast<double>(i / columns);
    regular = std::hypot(points[i].x() - x, points[i].y() - y) <= 1e-6 * spacing;
    heights.push_back(points[i].z());
  }
  if (!regular) {
    faults.add(key + ".file", "expected points of a regular grid in x and y, at least 2 by 2, equally far apart both ways",
               std::to_string(points.size()) + " points that are not one", "");
    return none;
  }
  return {Vec3(points[0].x(), points[0].y(), 0.0) + d.at, spacing, columns, rows, heights, d.slope};
}

/// A mesh from a file, moved to its place; refused ones leave a fault and `body` as it is.
void add_mesh(const Scene& scene, const ObstacleDesc& d, ModelFaults& faults, FixedBody& body) try {
  auto read = faults.read("obstacles." + d.name + ".file", [&] { return io::read_mesh(named_file(files_of(scene), d.file)); });
  if (!read) return;
  const Quat turn = core::rotation_exp(d.turn * d.turn_axis.normalized());
  body.solid = implicit::MeshSolid(*read, {.slope = d.slope, .pose = {d.at, turn}});
} catch (const Error& error) {
  if (error.kind() != ErrorKind::Scene) throw;
  const Fault& fault = error.faults().front();
  faults.add("obstacles." + d.name + ".file", fault.expected, fault.found, fault.hint);
}

/// Primitives that sum; refused ones leave a fault and `body` as it is.
void add_primitives(const ObstacleDesc& d, const std::string& key, ModelFaults& faults, FixedBody& body) {
  ObjectDesc carried;
  carried.skeleton = d.skeleton;
  carried.iso = d.iso;
  std::vector<double> volume;
  const implicit::Skeleton skeleton = build_skeleton(carried, key, 1, volume, faults);
  if (skeleton.primitive.empty()) return;
  const Pose pose{d.at, core::rotation_exp(d.turn * d.turn_axis.normalized())};
  implicit::PlacedSkeleton placed;
  implicit::place_skeleton(skeleton, {&pose, 1}, placed);
  const auto field = std::make_shared<implicit::Field>();
  implicit::index_field(skeleton, placed, *field);
  body.solid = FixedBody::Primitives(field);
  body.core_value = std::numeric_limits<double>::infinity();
  for (const implicit::Primitive& primitive : skeleton.primitive) {
    body.core_value = std::min(*body.core_value, implicit::peak(primitive.kernel) - skeleton.iso);
    body.iso_radius = std::min(body.iso_radius, iso_radius(primitive, skeleton.iso));
  }
}

void add_fixed_bodies(const Scene& scene, Model& model, ModelFaults& faults) {
  if (scene.ground && scene.ground->collides) {
    const GroundDesc& d = *scene.ground;
    model.fixed.push_back({.name = "ground",
                           .solid = implicit::HalfSpace{Vec3(0.0, 0.0, d.height), Vec3::UnitZ(), d.slope},
                           .material = {d.modulus, d.friction, 0.0}});
  }
  for (const ObstacleDesc& d : scene.obstacles) {
    FixedBody body{.name = d.name,
                   .solid = implicit::HalfSpace{d.at, d.normal.normalized(), d.slope},
                   .material = {d.modulus, d.friction, 0.0},
                   .motion = {d.keys, d.between, d.turn_axis.normalized()}};
    if (d.shape == ObstacleName::Box) {
      const Pose pose{d.at, core::rotation_exp(d.turn * d.turn_axis.normalized())};
      body.solid = implicit::SolidBox(pose, d.half_sizes, d.rounding, d.slope);
    } else if (d.shape == ObstacleName::Heights) {
      body.solid = height_field(scene, d, "obstacles." + d.name, faults);
    } else if (d.shape == ObstacleName::Mesh) {
      add_mesh(scene, d, faults, body);
    } else if (d.shape == ObstacleName::Implicit) {
      add_primitives(d, "obstacles." + d.name, faults, body);
    }
    if (body.led()) {
      const Box box = body.field().surface_box();
      const bool turns = std::any_of(d.keys.begin(), d.keys.end(), [](const ObstacleKeyDesc& k) { return k.turn != 0.0; });
      const double radius = turns ? box.lower.cwiseAbs().cwiseMax(box.upper.cwiseAbs()).norm() : 0.0;
      model.solid_speed = std::max(model.solid_speed, largest_speed(body.motion, radius));
    }
    model.fixed.push_back(std::move(body));
  }
}

void add_pairs(const Scene& scene, Model& model, ModelFaults& faults, std::vector<BodyPair>& forbidden) {
  const auto n = static_cast<std::uint32_t>(model.objects.size());
  const auto collides = [&](std::uint32_t body) { return body >= n || model.objects[body].collides; };
  const auto material = [&](std::uint32_t body) -> const collision::ContactMaterial& {
    return body >= n ? model.fixed[body - n].material : model.objects[body].material;
  };
  for (std::size_t k = 0; k < scene.pairs.size(); ++k) {
    const PairDesc& d = scene.pairs[k];
    const std::string key = "pairs[" + std::to_string(k) + ']';
    if (d.objects.size() != 2) {
      faults.add(key + ".objects", "expected 2 names", std::to_string(d.objects.size()), "");
      continue;
    }
    std::array<std::uint32_t, 2> body{};
    bool known = true;
    for (std::size_t side = 0; side < 2; ++side) {
      body[side] = body_of(model, d.objects[side]);
      if (body[side] != kNobody) continue;
      known = false;
      if (d.collide && !*d.collide) continue;  // a ground with collides: false
      faults.add(key + ".objects[" + std::to_string(side) + ']',
                 d.objects[side] == "ground" ? "expected a ground that collides" : "expected the name of an object",
                 '\'' + shown(d.objects[side]) + '\'', d.objects[side] == "ground" ? "set ground.collides: true" : "");
    }
    if (!known) continue;
    const BodyPair pair{std::min(body[0], body[1]), std::max(body[0], body[1])};
    if (pair.a == pair.b) {
      faults.add(key + ".objects", "expected two different objects", '\'' + shown(d.objects[0]) + "' twice", "");
      continue;
    }
    if (d.collide && !*d.collide) {
      forbidden.push_back(pair);
      continue;
    }
    if (!collides(pair.a) || !collides(pair.b)) {
      const std::string& name = d.objects[collides(body[0]) ? 1 : 0];
      faults.add(key, "expected two objects with contact", '\'' + shown(name) + "' without",
                 "add 'contact: {}' to it, or set 'collide: false' here");
      continue;
    }
    collision::PairMaterial combined = collision::combine(material(pair.a), material(pair.b));
    if (d.friction) combined.friction = *d.friction;
    if (d.dissipation) combined.dissipation = *d.dissipation;
    if (d.restitution) combined.dissipation = dissipation_for(d.restitution->value, d.restitution->at_speed);
    model.rules.overrides.push_back({pair, combined});
    if (d.from > 0.0 || std::isfinite(d.until)) model.windows.push_back({pair, d.from, d.until});
  }
  model.closed = closed_at(model, 0.0);
  std::sort(forbidden.begin(), forbidden.end());
  std::sort(model.rules.overrides.begin(), model.rules.overrides.end(),
            [](const auto& a, const auto& b) { return a.pair < b.pair; });
}

/// Between every two objects that have it and that do not touch: forces by geometric mean, lengths by mean.
void add_repulsion(const Scene& scene, Model& model, const std::vector<BodyPair>& forbidden) {
  for (std::uint32_t a = 0; a < scene.objects.size(); ++a) {
    for (std::uint32_t b = a + 1; b < scene.objects.size(); ++b) {
      if (!scene.objects[a].repulsion || !scene.objects[b].repulsion) continue;
      const bool touch = model.objects[a].collides && model.objects[b].collides &&
                         !std::binary_search(forbidden.begin(), forbidden.end(), BodyPair{a, b});
      if (touch) continue;
      const RepulsionDesc& x = *scene.objects[a].repulsion;
      const RepulsionDesc& y = *scene.objects[b].repulsion;
      core::GeometricLaw<core::Repulsion> law;
      law.name = model.objects[a].name + '-' + model.objects[b].name + "/repulsion";
      law.object_a = a;
      law.object_b = b;
      law.law.force = std::sqrt(x.force * y.force);
      law.law.distance = 0.5 * (x.distance + y.distance);
      law.law.length = 0.5 * (x.length + y.length);
      law.range = law.law.cut_off();
      model.interactions.repulsion.push_back(law);
    }
  }
}

/// Inside one object: between all particles, or between those that have no other law between them.
void add_own_repulsion(const Scene& scene, Model& model) {
  for (std::uint32_t a = 0; a < scene.objects.size(); ++a) {
    const ObjectDesc& d = scene.objects[a];
    if (!d.repulsion || !(d.repulsion->own || !d.kinds.empty())) continue;
    core::GeometricLaw<core::Repulsion> law;
    law.name = d.name + "/repulsion";
    law.object_a = law.object_b = a;
    law.law = {.force = d.repulsion->force, .distance = d.repulsion->distance, .length = d.repulsion->length};
    law.range = law.law.cut_off();
    if (!d.repulsion->own) {
      law.kinds = d.hinges_join ? core::PairKinds::IncompleteButHinges : core::PairKinds::Incomplete;
    }
    model.interactions.repulsion.push_back(law);
  }
}

/// Whether every body of an object, now and later, is convex by construction: such bodies find each other without samples.
bool only_convex(const ObjectModel& object) {
  if (object.breaks) return false;
  if (!object.separate && object.component.empty()) return implicit::has_convex_core(object.skeleton);
  implicit::Skeleton one{.primitive = std::vector<implicit::Primitive>(1), .part_count = 1, .iso = object.skeleton.iso, .blend = {}};
  std::vector<std::uint8_t> taken(object.last - object.first, 0);  // by the first particle of a body
  for (const implicit::Primitive& primitive : object.skeleton.primitive) {
    std::uint8_t& other = taken[object.separate ? primitive.part : object.component[primitive.part]];
    one.primitive[0] = primitive;
    if (other != 0 || !implicit::has_convex_core(one)) return false;
    other = 1;
  }
  return true;
}

/// Components and groups of an object with a bond between them.
void find_bonded(Model& model) {
  const auto add = [](std::uint32_t x, std::uint32_t y, ObjectModel& object) {
    const auto [a, b] = std::minmax(x, y);
    if (a != b) object.bonded.push_back({a, b});
  };
  std::vector<std::uint32_t> group_of(model.particles.size(), BodyOrigin::kWhole);  // of each particle
  for (const ObjectModel& object : model.objects) {
    if (object.group.empty()) continue;
    const std::vector<std::uint32_t>& node = object.skeleton.blend.node;
    std::vector<std::uint32_t> led_by(node.size(), BodyOrigin::kWhole);  // nodes are no more than particles
    for (const std::uint32_t first : object.group) led_by[node[first]] = first;
    for (std::uint32_t i = 0; i < node.size(); ++i) group_of[object.first + i] = led_by[node[i]];
  }
  for (const auto& [p, q] : core::bonded_pairs(model.interactions)) {
    ObjectModel& object = model.objects[model.particles.object[p]];
    if (model.particles.object[q] != model.particles.object[p]) continue;
    const std::uint32_t i = p - object.first, j = q - object.first;
    if (!object.component.empty()) add(object.component[i], object.component[j], object);
    if (!object.component.empty() && object.component[i] != object.component[j]) continue;
    const std::uint32_t a = group_of[p], b = group_of[q];
    if (a != BodyOrigin::kWhole && b != BodyOrigin::kWhole) add(a, b, object);
  }
  for (ObjectModel& object : model.objects) {
    std::sort(object.bonded.begin(), object.bonded.end());
    object.bonded.erase(std::unique(object.bonded.begin(), object.bonded.end()), object.bonded.end());
  }
}

/// The seeds of a primitive, by the faces of its surface's box, or by a ball around what sends rays from its centre.
double seeds_of(const implicit::Primitive& primitive, double iso, double spacing) {
  const bool star = primitive.shape == implicit::ShapeKind::Ellipsoid || primitive.shape == implicit::ShapeKind::Superquadric ||
                    primitive.shape == implicit::ShapeKind::Directed;
  const double share = implicit::iso_distance(primitive.kernel, iso) / primitive.kernel.radius;
  Vec3 side = implicit::support_box(primitive).extent() / spacing;
  if (star) return std::numbers::pi * std::pow(share * side.maxCoeff(), 2);
  side = (side.array() - 2.0 * (1.0 - share) * primitive.kernel.radius * primitive.stretch.minCoeff() / spacing).max(1.0);
  return 2.0 * (side.x() * side.y() + side.y() * side.z() + side.z() * side.x());
}

/// Spacing of the samples of each primitive: that of the scene, or a sixth of the thinnest of the primitive and the obstacles, which have no samples. What is
/// thin on another object is seen by that object's own samples. Rough contacts take a third instead: each sample searches as far as the next one.
std::vector<double> sample_spacings(const Scene& scene, const Model& model, const ObjectModel& object) {
  double solids = std::numeric_limits<double>::infinity();
  for (const FixedBody& body : model.fixed) solids = std::min(solids, body.iso_radius);
  const double across = contact_error(scene) < kRough ? kSamplesAcross : kRoughAcross;
  std::vector<double> out;
  for (const implicit::Primitive& primitive : object.skeleton.primitive) {
    const double thinnest = std::min(iso_radius(primitive, object.skeleton.iso), solids);
    out.push_back(scene.contact.sample_spacing.value_or(2.0 * thinnest / across));
  }
  return out;
}

double count_seeds(const ObjectModel& object, std::span<const double> spacing) {
  double seeds = 0.0;
  for (std::size_t k = 0; k < spacing.size(); ++k) seeds += seeds_of(object.skeleton.primitive[k], object.skeleton.iso, spacing[k]);
  return seeds;
}

/// Rows of seeds have numbers that fit an int, with room to spare. @return the first primitive where they do not
std::optional<std::size_t> too_long_row(const ObjectModel& object, std::span<const double> spacing) {
  constexpr double kMostInRow = 5e5;
  for (std::size_t k = 0; k < spacing.size(); ++k) {
    if (!(implicit::support_box(object.skeleton.primitive[k]).extent().maxCoeff() <= kMostInRow * spacing[k])) return k;
  }
  return std::nullopt;
}

}  // namespace

double iso_radius(const implicit::Primitive& primitive, double iso) {
  const double distance = implicit::iso_distance(primitive.kernel, iso);
  return distance / implicit::distance_scale(primitive);
}

double solid_half_size(const implicit::Primitive& primitive) {
  if (primitive.shape != implicit::ShapeKind::Box) return 0.0;
  return primitive.size.cwiseProduct(primitive.stretch).minCoeff();
}

std::size_t own_contacts(const ObjectModel& object) {
  if (object.breaks) return 2;
  if (object.separate) return object.last > object.first + 1 ? 2 : 0;
  const auto origin = [&object](std::uint32_t first) { return BodyOrigin{0, object.component.empty() ? 0 : object.component[first], first}; };
  for (auto a = object.group.begin(); a != object.group.end(); ++a) {
    if (std::any_of(a + 1, object.group.end(), [&](std::uint32_t b) { return meeting_of(object, origin(*a), origin(b)) != Meeting::Never; })) {
      return object.group.size();
    }
  }
  if (object.component.empty()) return 0;
  std::vector<std::uint8_t> solid(object.component.size(), 0);  // components that have a surface
  for (const implicit::Primitive& primitive : object.skeleton.primitive) solid[object.component[primitive.part]] = 1;
  const auto bodies = static_cast<std::size_t>(std::count(solid.begin(), solid.end(), 1));
  const auto tied = std::count_if(object.bonded.begin(), object.bonded.end(),
                                  [&](const BodyPair& pair) { return solid[pair.a] != 0 && solid[pair.b] != 0; });
  return bodies * (bodies - 1) / 2 > static_cast<std::size_t>(tied) ? bodies : 0;
}

double dissipation_for(double restitution, double speed) {
  const double e = restitution;
  SUPPLE_EXPECTS(e > 0.0 && e <= 1.0 && speed > 0.0);
  if (e == 1.0) return 0.0;
  // g(y) = (y - ln(1 + y)) + (e y + ln(1 - e y)) rises from 0 and falls to -inf at y = 1 / e: one root, bracketed.
  double low = 0.5 * (1.0 - e);  // the root is near 1.5 (1 - e) for e near 1 and near 1 / e for e near 0
  double high = 1.0 / e;
  for (int i = 0; i < 200; ++i) {
    const double y = 0.5 * (low + high);
    if (y <= low || y >= high) break;
    (e * y < 1.0 && lag(y) - lag(-e * y) > 0.0 ? low : high) = y;
  }
  return 0.5 * (low + high) / speed;
}

double pair_contact_frequency(const Model& model) {
  const auto count = static_cast<std::uint32_t>(model.objects.size());
  std::vector<ContactSpring> spring(count);
  for (std::uint32_t i = 0; i < count; ++i) spring[i] = extreme_of(model.objects[i], model.particles);
  double square = 0.0;
  for (std::uint32_t i = 0; i < count; ++i) {
    const ObjectModel& object = model.objects[i];
    if (!object.collides) continue;
    if (own_contacts(object) > 0) square = std::max(square, spring[i].stiffness * spring[i].inverse_mass);  // half the stiffness, twice the inverse mass
    for (std::uint32_t j = i + 1; j < count + model.fixed.size(); ++j) {
      if (model.rules.allowed && !model.rules.allowed(i, j)) continue;
      if (j >= count) {
        square = std::max(square, spring[i].stiffness * spring[i].inverse_mass);
      } else if (model.objects[j].collides && spring[i].stiffness + spring[j].stiffness > 0.0) {
        const double both = spring[i].stiffness * spring[j].stiffness / (spring[i].stiffness + spring[j].stiffness);
        square = std::max(square, both * (spring[i].inverse_mass + spring[j].inverse_mass));
      }
    }
  }
  return std::min(model.contact_frequency, std::sqrt(square));
}

double largest_friction(const Model& model) {
  const std::size_t n = model.objects.size();
  const auto collides = [&](std::size_t i) { return i >= n || model.objects[i].collides; };
  const auto material = [&](std::size_t i) { return i >= n ? model.fixed[i - n].material : model.objects[i].material; };
  const auto& overrides = model.rules.overrides;
  double largest = 0.0;
  for (const auto& o : overrides) largest = std::max(largest, o.material.friction);
  for (std::uint32_t a = 0; a < n; ++a) {
    if (!collides(a) || material(a).friction == 0.0) continue;
    if (own_contacts(model.objects[a]) > 0) largest = std::max(largest, material(a).friction);
    for (std::uint32_t b = a + 1; b < n + model.fixed.size(); ++b) {
      const collision::BodyPair pair{a, b};
      if (!collides(b) || (model.rules.allowed && !model.rules.allowed(a, b))) continue;
      const double both = std::sqrt(material(a).friction * material(b).friction);
      if (both > largest && std::none_of(overrides.begin(), overrides.end(), [&](const auto& o) { return o.pair == pair; })) largest = both;
    }
  }
  return largest;
}

void build_contact(const Scene& scene, MemoryBudget& budget, Model& model, ModelFaults& faults) {
  add_fixed_bodies(scene, model, faults);
  model.contact.error = contact_error(scene);
  model.contact.only = rule_of(scene.contact.rule);
  model.reaction.split = scene.contact.split == SplitName::Energy ? collision::SplitRule::Energy
                                                                  : collision::SplitRule::Contribution;
  model.reaction.friction_speed = scene.contact.friction_speed;
  if (scene.contact.stick) {
    model.reaction.stick = {.stiffness = scene.contact.stick->stiffness, .damping = scene.contact.stick->damping};
  }
  model.bulge = {.attenuation = scene.contact.bulge, .keep_volume = scene.contact.bulge_volume, .literal = scene.contact.bulge_literal};
  const double free_width = model.bulge.keep_volume ? std::numeric_limits<double>::infinity() : model.bulge.width;
  model.bulge.width = scene.contact.bulge_width.value_or(free_width);

  std::vector<BodyPair> forbidden;
  add_pairs(scene, model, faults, forbidden);
  add_repulsion(scene, model, forbidden);
  add_own_repulsion(scene, model);
  if (!forbidden.empty()) {
    model.rules.allowed = [forbidden](std::uint32_t a, std::uint32_t b) {
      return !std::binary_search(forbidden.begin(), forbidden.end(), BodyPair{std::min(a, b), std::max(a, b)});
    };
  }

  for (const auto& pair : model.rules.overrides) {
    model.largest_dissipation = std::max(model.largest_dissipation, pair.material.dissipation);
  }
  find_bonded(model);
  const auto count = static_cast<std::uint32_t>(model.objects.size());
  std::vector<std::vector<double>> spacing(count);  // of the samples, by object and primitive
  std::vector<std::uint8_t> convex;
  for (const ObjectModel& object : model.objects) convex.push_back(only_convex(object) ? 1 : 0);
  for (const FixedBody& body : model.fixed) convex.push_back(body.field().core_point(Vec3::Zero()) ? 1 : 0);
  for (std::uint32_t i = 0; i < count; ++i) {
    ObjectModel& object = model.objects[i];
    if (!object.collides) continue;
    bool touches = own_contacts(object) > 0;
    bool needs_samples = convex[i] == 0;
    for (std::uint32_t j = 0; j < count + model.fixed.size() && !(touches && needs_samples); ++j) {
      const bool other = j >= count || (j != i && model.objects[j].collides);
      if (!other || (model.rules.allowed && !model.rules.allowed(i, j))) continue;
      touches = true;
      needs_samples = needs_samples || convex[j] == 0;
    }
    if (!touches) continue;
    model.largest_dissipation = std::max(model.largest_dissipation, object.material.dissipation);
    // Springs of friction need not be accurate, but stable: steps of an accuracy let them have twice the phase.
    const double sticks = (accuracy_of(scene) ? 0.5 : 1.0) * stick_frequency(object, model.particles, model.reaction.stick);
    model.contact_frequency = std::max(model.contact_frequency, std::hypot(contact_frequency(object, model.particles), sticks));
    if (!needs_samples) continue;
    spacing[i] = sample_spacings(scene, model, object);
    if (const auto row = too_long_row(object, spacing[i])) {
      faults.add("contact.sample_spacing", "expected at most 500000 surface samples in a row", "more on '" + object.name + "', at a spacing of " + short_text(spacing[i][*row]) + " m",
                 "use a larger sample_spacing, or shorter or thicker parts");
      continue;
    }
    budget.add({.what = Counted::Samples, .key = scene.contact.sample_spacing ? "contact.sample_spacing" : "objects." + object.name + ".skeleton",
                .number = count_seeds(object, spacing[i])});
    object.sample_spacing = *std::max_element(spacing[i].begin(), spacing[i].end());
  }
  budget.expect();
  for (std::uint32_t i = 0; i < count; ++i) {
    ObjectModel& object = model.objects[i];
    if (object.sample_spacing > 0.0) object.samples = implicit::make_sample_layout(object.skeleton, spacing[i]);
  }
}

}  // namespace supple::scenes
