#include "model/warnings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "file/fields/fields_rules.h"
#include "file/read_scene_faults.h"
#include "model/model_contact.h"
#include "output/meshes/search_choice.h"
#include "supple/core/counted.h"

namespace supple::scenes {
namespace {

std::string names_of(const StageContext& context, const collision::BodyPair& pair) {
  return '\'' + body_name(context.model, context.bodies, pair.a) + "' and '" + body_name(context.model, context.bodies, pair.b) + '\'';
}

/// A point of a primitive's shape in the world, in its middle where that belongs to it.
Vec3 middle_of(const implicit::Primitive& primitive, const Pose& carrier) {
  Vec3 middle = Vec3::Zero();
  switch (primitive.shape) {
    case implicit::ShapeKind::Ring:
    case implicit::ShapeKind::Arc: middle.x() = primitive.size.x(); break;
    case implicit::ShapeKind::Curve: {  // de Casteljau at the half of the parameter
      std::vector<Vec3> corner = primitive.control;
      for (; corner.size() > 1; corner.pop_back()) {
        for (std::size_t i = 0; i + 1 < corner.size(); ++i) corner[i] = 0.5 * (corner[i] + corner[i + 1]);
      }
      middle = corner.front();
      break;
    }
    default:
      for (const Vec3& corner : primitive.control) middle += corner / static_cast<double>(primitive.control.size());
  }
  const Vec3 at = primitive.offset.position + primitive.offset.orientation * middle.cwiseProduct(primitive.stretch);
  return carrier.position + carrier.orientation * at;
}

void add_deep(const StageContext& context, const Frame& frame, std::vector<std::string>& warnings) {
  for (const collision::BodyPair& pair : frame.reaching) {
    if (!begins_deep(context.bodies, frame, pair)) continue;
    warnings.push_back(names_of(context, pair) + " overlap so deeply at the start that contact may not separate them");
  }
}

/// Parts of one object that its blending graph does not join, and that nevertheless do not touch.
void add_passing(const Model& model, std::vector<std::string>& warnings) {
  for (const ObjectModel& object : model.objects) {
    const std::string key = "objects." + object.name + ".contact: ";
    const std::size_t pairs = object.overlapping.size();
    if (pairs > 0) {
      const collision::BodyPair& one = object.overlapping.front();
      warnings.push_back(key + "parts that do not blend overlap at the start, and touch only once they have been apart: " + counted(pairs, "pair") + ", the first with particles " + std::to_string(one.a) + " and " +
                         std::to_string(one.b));
    }
  }
}

/// Convolved primitives add up to less than their kernel, perhaps nowhere to the iso value.
void add_without_surface(const StageContext& context, const core::ParticleState& particles, Frame& frame,
                         std::vector<std::string>& warnings) {
  for (std::size_t i = 0; i < surface_count(context.bodies); ++i) {
    const implicit::Skeleton& skeleton = context.bodies[i].skeleton;
    const auto convolved = [](const implicit::Primitive& p) { return p.convolved; };
    if (std::none_of(skeleton.primitive.begin(), skeleton.primitive.end(), convolved)) continue;
    place_and_index(context, particles, i, frame);
    double most = 0.0;
    for (const implicit::Primitive& primitive : skeleton.primitive) {
      const Vec3 middle = middle_of(primitive, frame.pose[i][primitive.part]);
      most = std::max(most, implicit::FieldView(frame.field[i]).value(middle) + skeleton.iso);
    }
    if (most > skeleton.iso) continue;
    warnings.push_back('\'' + context.bodies[i].name + "' may have no surface: at the centres of its primitives its field is at most " +
                       number_text(most) + ", its iso value is " + number_text(skeleton.iso));
  }
}

/// Whether each body of an object is one ball, of which no part can be lost.
bool has_only_balls(const ObjectModel& object) {
  std::vector<std::uint8_t> taken(object.last - object.first, 0);  // by the first particle of a body
  for (const implicit::Primitive& primitive : object.skeleton.primitive) {
    if (primitive.shape != implicit::ShapeKind::Point) return false;
    const std::uint32_t body = object.separate ? primitive.part : object.component.empty() ? 0 : object.component[primitive.part];
    if (std::exchange(taken[body], 1) != 0) return false;
  }
  return true;
}

void add_missed(const Model& model, std::vector<std::string>& warnings) {
  const MeshingDesc& d = model.meshing;
  const bool cubes = d.method == MeshingName::Auto || d.method == MeshingName::Cubes;
  for (const ObjectModel& object : model.objects) {
    if (object.mesh_error) continue;  // chooses smaller cells
    if (cubes && !search_is_off(d) && has_only_balls(object)) continue;  // a search finds closed pieces, no lost connections
    double thickness = std::numeric_limits<double>::infinity();
    for (const implicit::Primitive& primitive : object.skeleton.primitive) {
      thickness = std::min(thickness, 2.0 * (iso_radius(primitive, object.skeleton.iso) + solid_half_size(primitive)));
    }
    if (!(object.cell > thickness && thickness > 0.0)) continue;
    const std::string key = object.own_cell ? "objects." + object.name + ".meshing.cell" : "output.cell";
    warnings.push_back(key + ": lattice cells of " + number_text(object.cell) + " m may miss '" + object.name + "' or break it into pieces, as it is " +
                       short_text(thickness) + " m thick; use smaller cells or 'output.meshing.error'" + (cubes ? "" : " with method auto"));
  }
}

/// Meshes of obstacles that are not taken as they are.
void add_mended_meshes(const Model& model, std::vector<std::string>& warnings) {
  constexpr double kMuch = 0.01;  // of the size
  for (const FixedBody& body : model.fixed) {
    const auto* solid = std::get_if<implicit::MeshSolid>(&body.solid);
    if (solid == nullptr) continue;
    const implicit::MeshSolid::Report& report = solid->report();
    const std::string key = "obstacles." + body.name + ".file: ";
    if (report.turned > 0) {
      warnings.push_back(key + counted(report.turned, "triangle is", "triangles are") +
                         " reversed, as most of the triangles that share their edges are oriented the other way");
    }
    if (report.deviation > kMuch * report.size) {
      warnings.push_back(key + "the surface deviates by up to " + short_text(report.deviation) + " m, " + short_text(100.0 * report.deviation / report.size) +
                         " % of its size" + (report.crossing > 0 ? ", where triangles cross; unite its shells" : ""));
    }
  }
}

/// Growth of an object's pressure with the depth, at most [Pa/m].
double steepness(const ObjectModel& object) {
  double largest = 0.0;
  for (const implicit::Primitive& primitive : object.skeleton.primitive) {
    largest = std::max(largest, implicit::iso_slope(primitive.kernel, object.skeleton.iso) * implicit::distance_scale(primitive));
  }
  return object.material.modulus * largest;
}

/// Compares an obstacle with the stiffest object that may touch it. @param slope  growth of the pressure over the modulus [1/m]
void look_for_softness(const Model& model, std::size_t fixed, const std::string& key, double slope, std::vector<std::string>& warnings) {
  constexpr double kMuch = 10.0;
  const FixedBody& body = model.fixed[fixed];
  const ObjectModel* stiffest = nullptr;
  double most = 0.0;
  for (std::size_t i = 0; i < model.objects.size(); ++i) {
    const auto a = static_cast<std::uint32_t>(i), b = static_cast<std::uint32_t>(model.objects.size() + fixed);
    const ObjectModel& object = model.objects[i];
    if (!object.collides || (model.rules.allowed && !model.rules.allowed(a, b)) || steepness(object) <= most) continue;
    stiffest = &object;
    most = steepness(object);
  }
  const double own = body.material.modulus * slope;
  if (stiffest == nullptr || most <= kMuch * own) return;
  const bool has_slope = !std::holds_alternative<FixedBody::Primitives>(body.solid);
  const double as_stiff = has_slope ? most / body.material.modulus : most / slope;
  warnings.push_back(key + (has_slope ? ".slope: '" : ".modulus: '") + body.name + "' is " + short_text(most / own) + " times softer than '" +
                     stiffest->name + "', which sinks into it: the pressure grows by " + short_text(own) + " Pa per metre of depth in it, by " +
                     short_text(most) + " in '" + stiffest->name + "'; a " + (has_slope ? "slope" : "modulus") + " of " + short_text(as_stiff) +
                     " makes it as stiff");
}

/// Obstacles of the default stiffness, which follows neither the size nor the stiffness of the objects. A given one is meant.
void add_soft_obstacles(const Scene& scene, const Model& model, std::vector<std::string>& warnings) {
  std::size_t fixed = 0;
  if (scene.ground && scene.ground->collides) {
    if (scene.ground->slope == GroundDesc{}.slope) look_for_softness(model, fixed, "ground", scene.ground->slope, warnings);
    ++fixed;
  }
  for (const ObstacleDesc& d : scene.obstacles) {
    const bool primitives = d.shape == ObstacleName::Implicit;
    const bool given = primitives ? d.modulus != ObstacleDesc{}.modulus : d.slope != ObstacleDesc{}.slope;
    const implicit::FieldView field = model.fixed[fixed].field();
    if (!given) look_for_softness(model, fixed, "obstacles." + d.name, primitives ? field.gradient_bound(field.surface_box()) : d.slope, warnings);
    ++fixed;
  }
}

/// Checks a spacing of contact samples given by the scene [m].
void add_wide_samples(const Model& model, double spacing, std::vector<std::string>& warnings) {
  const std::string key = "contact.sample_spacing: ";
  if (std::all_of(model.objects.begin(), model.objects.end(), [](const ObjectModel& o) { return o.samples.size() == 0; })) {
    warnings.push_back(key + "it has no effect, as no contact is searched by samples: convex bodies need none");
    return;
  }
  double solids = std::numeric_limits<double>::infinity();  // obstacles have no samples: those of the objects must meet them
  for (const FixedBody& body : model.fixed) solids = std::min(solids, body.iso_radius);
  for (const ObjectModel& object : model.objects) {
    const double thickness = 2.0 * std::min(object.iso_radius, solids);
    if (object.samples.size() == 0 || spacing <= thickness) continue;
    warnings.push_back(key + "samples " + number_text(spacing) + " m apart may miss contacts of '" + object.name + "', as " +
                       (solids < object.iso_radius ? "an obstacle" : "it") + " is " + number_text(thickness) + " m thick");
  }
}

/// Keys that are given but have no effect.
void add_idle(const Scene& scene, const Model& model, std::vector<std::string>& warnings) {
  const ContactDesc& d = scene.contact;
  const auto idle = [&](bool given, const std::string& key, const char* why) {
    if (given) warnings.push_back(key + ": it has no effect, as " + why);
  };
  if ((d.stick || d.friction_speed != ContactDesc{}.friction_speed) && largest_friction(model) == 0.0) {
    constexpr const char* kSmooth = "no two bodies that may touch have friction";
    idle(d.stick.has_value(), "contact.stick", kSmooth);
    idle(d.friction_speed != ContactDesc{}.friction_speed, "contact.friction_speed", kSmooth);
  }
  const bool flat = d.bulge == 0.0 && !d.bulge_volume;
  idle(flat && d.bulge_width, "contact.bulge_width", "'bulge' is 0");
  idle(flat && d.bulge_literal, "contact.bulge_literal", "'bulge' is 0");
  for (std::size_t k = 0; k < scene.pairs.size(); ++k) {
    const PairDesc& pair = scene.pairs[k];
    const bool always = pair.from == 0.0 && std::isinf(pair.until);
    idle(always && !pair.collide && !pair.friction && !pair.dissipation && !pair.restitution, "pairs[" + std::to_string(k) + ']',
         "it has no key beside 'objects'");
  }
  const auto& meshes = scene.output.mesh;
  if (scene.output.meshing.motion && !meshes.empty() && std::all_of(meshes.begin(), meshes.end(), [](MeshName m) { return m == MeshName::Obj; })) {
    warnings.push_back("output.meshing.motion: it has no effect, as OBJ files have no such columns; ply and usd have");
  }
  for (std::size_t i = 0; i < model.objects.size(); ++i) {
    const ObjectModel& object = model.objects[i];
    const auto& contact = scene.objects[i].contact;
    idle(contact && contact->self.value_or(false) && object.collides && own_contacts(object) == 0,
         "objects." + object.name + ".contact.self", "no parts of the object can touch each other: they blend or are bonded");
  }
}

}  // namespace

bool begins_deep(const std::vector<Body>& bodies, const Frame& frame, const collision::BodyPair& pair) {
  const auto seen = [&](std::uint32_t i) {
    return i >= bodies.size() || std::binary_search(frame.reached.begin(), frame.reached.end(), i);
  };
  const auto lies_in = [&](std::uint32_t inner, std::uint32_t outer) {
    if (inner >= bodies.size()) return false;
    const auto& primitives = bodies[inner].skeleton.primitive;
    return std::any_of(primitives.begin(), primitives.end(), [&](const implicit::Primitive& primitive) {
      return frame.bodies[outer].field.value(middle_of(primitive, frame.pose[inner][primitive.part])) > 0.0;
    });
  };
  return seen(pair.a) && seen(pair.b) && (lies_in(pair.a, pair.b) || lies_in(pair.b, pair.a));
}

std::vector<std::string> find_odd_start(const Scene& scene, const StageContext& context, const core::ParticleState& particles, Frame& frame) {
  std::vector<std::string> warnings;
  add_deep(context, frame, warnings);
  add_passing(context.model, warnings);
  add_without_surface(context, particles, frame, warnings);
  add_missed(context.model, warnings);
  add_mended_meshes(context.model, warnings);
  add_soft_obstacles(scene, context.model, warnings);
  add_idle(scene, context.model, warnings);
  if (scene.contact.sample_spacing) add_wide_samples(context.model, *scene.contact.sample_spacing, warnings);
  return warnings;
}

void add_unresolved(const StageContext& context, RuleName only, const collision::ContactSurface& surface,
                    std::vector<std::string>& warnings) {
  if (only == RuleName::Auto) return;
  for (const auto& s : surface.summary) {
    if (s.error_estimate < 1.0 || s.force.norm() > 0.0) continue;
    const std::string text = "contact.rule: " + std::string(name_of(only)) + " does not fit the contact of " + names_of(context, s.bodies) +
                             ", which has no force then; 'auto' fits all contacts";
    if (std::find(warnings.begin(), warnings.end(), text) == warnings.end()) warnings.push_back(text);
  }
}

bool misses_error(const collision::ContactSurface::Summary& contact, double given_error) {
  constexpr double kSlack = 1.01;  // rules end slightly above the given error
  return contact.error_estimate > kSlack * given_error;
}

void UnmetContacts::look(const StageContext& context, const collision::ContactSurface& surface, double time) {
  const double given_error = context.model.contact.error;
  const auto kind = [&](std::uint32_t body) -> const std::string& {
    const bool is_group = body < context.bodies.size() && context.bodies[body].origin.is_group();
    return (is_group ? body_name : object_name)(context.model, context.bodies, body);
  };
  for (const auto& s : surface.summary) {
    if (!misses_error(s, given_error) || s.force.norm() == 0.0) continue;  // without force: the given rule does not fit
    Worst& worst = worst_[{kind(s.bodies.a), kind(s.bodies.b)}];
    if (worst.times++ == 0) worst.first = time;
    if (s.error_estimate > worst.bound) worst = {s.error_estimate, time, worst.first, worst.times};
  }
}

void UnmetContacts::add_to(double given_error, std::vector<std::string>& warnings) const {
  for (const auto& [pair, worst] : worst_) {
    std::array<char, 160> numbers{};
    std::snprintf(numbers.data(), numbers.size(), " misses the given %.2g: its largest error estimate is %.2g at t = %.6g s, and %llu are too large from t = %.6g s on",
                  given_error, worst.bound, worst.time, static_cast<unsigned long long>(worst.times), worst.first);
    warnings.push_back("contact.error: contact of '" + pair.first + "' and '" + pair.second + '\'' + numbers.data());
  }
}

void add_missed_volumes(const Model& model, const std::vector<implicit::VolumeState>& volumes, std::vector<std::string>& warnings) {
  constexpr double kNear = 0.005;  // measures err by a tenth of that
  for (const ObjectModel& object : model.objects) {
    if (!object.holds_volume) continue;
    std::size_t missed = 0, worst = 0;
    double most = 0.0;
    for (std::size_t k = 0; k < object.target.size(); ++k) {
      const implicit::VolumeState& held = volumes[object.first_volume + k];
      if (!(object.target[k] > 0.0 && held.volume > 0.0)) continue;  // it has no target, or no step was made
      const double off = std::abs(held.volume / object.target[k] - 1.0);
      if (off <= kNear) continue;
      ++missed;
      if (off > most) {
        most = off;
        worst = k;
      }
    }
    if (missed == 0) continue;
    const implicit::VolumeState& held = volumes[object.first_volume + worst];
    std::string text = "objects." + object.name + ".volume: ";
    if (object.volume_of == VolumeOfName::Object) {
      text += '\'' + object.name + '\'';
    } else {
      const std::string what(name_of(object.volume_of));
      text += std::to_string(missed) + " of " + std::to_string(object.target.size()) + " volumes by " + what;
      text += (missed == 1 ? " misses its target, most that of " : " miss their targets, most that of ") + what;
      text += ' ' + std::to_string(worst) + ", which";
    }
    text += " has " + short_text(held.volume) + " m^3, its target is " + short_text(object.target[worst]) + " m^3; its kernels ";
    const bool grows = held.volume < object.target[worst];
    if (grows && held.scale >= implicit::kLargestScale) text += "are scaled by 4, the largest scale";
    else if (!grows && held.scale <= implicit::kLeastScale) text += "are scaled by 1/4, the smallest scale";
    else text += std::string("still ") + (grows ? "grow" : "shrink") + ", scaled by " + short_text(held.scale) + " ('rate' sets how fast)";
    warnings.push_back(std::move(text));
  }
}

void set_missed(const MeshingDesc& meshing, const SearchCounts& all, std::vector<std::string>& warnings) {
  const std::string key = "output.meshing.search: ", crossing = "output.meshing.distance: ";
  const std::string blunt = "output.meshing.method: cells whose crease is cut off", bulging = "contact.bulge_volume: ";
  std::erase_if(warnings, [&](const std::string& warning) {
    return warning.starts_with(key) || warning.starts_with(crossing) || warning.starts_with(blunt) ||
           warning.starts_with(bulging);
  });
  std::string text;
  const auto add = [&](bool shown, const char* what, std::uint64_t count) {
    if (shown) text += (text.empty() ? key : "; ") + what + ": " + std::to_string(count);
  };
  const std::uint64_t bulges = all.not_searched(Unsearched::Bulges);
  const bool requested = meshing.search.value_or(false) && all.pieces + all.undecided + bulges > 0;
  add(requested || all.pieces > 0, "pieces of surfaces between the nodes of the lattice, found and added to the meshes of all frames", all.pieces);
  add(requested || all.undecided > 0, "undecided cells, where a piece may be missing", all.undecided);
  add(requested || bulges > 0, "meshes of bodies that bulge, which are not searched", bulges);
  for (const auto& [why, what] : {std::pair{Unsearched::Undecided, "meshes that auto does not search, as cells along blends by gradients or tight bends would stay undecided"},
                                  std::pair{Unsearched::Cost, "meshes that auto does not search, as that would cost far more than meshing"}}) {
    add(all.not_searched(why) > 0, what, all.not_searched(why));
  }
  if (!text.empty()) warnings.push_back(std::move(text));
  if (all.crossings > 0) {
    warnings.push_back(crossing + "pairs of triangles that intersect where bodies touch: " + std::to_string(all.crossings) +
                       "; a smaller distance may separate them");
  }
  if (!all.blunt.empty()) {
    std::string cells;
    for (const auto& [object, count] : all.blunt) cells += (cells.empty() ? "" : ", ") + std::to_string(count) + " of '" + object + '\'';
    warnings.push_back(blunt + ", as triangles with vertices on it would intersect, in the meshes of all frames: " + cells + "; smaller cells resolve more of it");
  }
  for (const auto& [object, around] : all.short_bulges) {
    for (const auto& [body, lacking] : around) {
      std::array<char, 160> numbers{};
      std::snprintf(numbers.data(), numbers.size(), " holds %.3g of the displaced volume at t = %.6g s, and %llu in all frames hold too little",
                    lacking.held, lacking.time, static_cast<unsigned long long>(lacking.count));
      warnings.push_back(bulging + "the bulge of '" + object + "' around '" + body + '\'' + numbers.data() +
                         "; 'bulge_width' and the reach of the fields beyond the surfaces limit its height");
    }
  }
}

}  // namespace supple::scenes
