// Stage 9: from fields and the contact surface to meshes.
#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <utility>

#include "file/read_scene_faults.h"
#include "file/scene_places.h"
#include "output/meshes/look_columns.h"
#include "output/meshes/mesh_sizes.h"
#include "output/meshes/search_choice.h"
#include "simulation/frame.h"
#include "simulation/kept_budget.h"
#include "simulation/surface_motion.h"
#include "supple/collision/deformed_field.h"
#include "supple/core/error.h"
#include "supple/core/parts.h"
#include "supple/implicit/creases.h"
#include "supple/implicit/mesh_limits.h"
#include "supple/implicit/mesh_routes.h"
#include "supple/implicit/missed_pieces.h"
#include "supple/implicit/polygonise.h"
#include "supple/implicit/surface_grid.h"

namespace supple::scenes {
namespace {

/// Bodies that are divided on one lattice.
struct DivisionGroup {
  std::vector<std::size_t> member;      ///< of Division::body, ascending
  const ObjectModel* finest = nullptr;  ///< whose cell it is
  const ObjectModel* strictest = nullptr;  ///< the object that gives the error; null: none is given
};

/// Error 0: none is given.
std::pair<double, double> cell_and_error(const DivisionGroup& group) {
  return {group.finest->cell, group.strictest != nullptr ? *group.strictest->mesh_error : 0.0};
}

/// For bodies that touch, directly or through others, the smallest cell and error apply to all of them. Bodies with the same
/// cell and error are meshed together, whether they touch or not.
std::vector<DivisionGroup> groups_of(const Model& model, const std::vector<Body>& bodies, const Division& division) {
  const std::vector<std::uint32_t>& all = division.body;
  std::vector<std::size_t> root(all.size());
  std::iota(root.begin(), root.end(), std::size_t{0});
  const auto root_of = [&](std::uint32_t body) {
    auto k = static_cast<std::size_t>(std::lower_bound(all.begin(), all.end(), body) - all.begin());
    while (root[k] != k) k = root[k] = root[root[k]];
    return k;
  };
  for (const collision::BodyPair& pair : division.pair) {
    const std::size_t a = root_of(pair.a), b = root_of(pair.b);
    root[std::max(a, b)] = std::min(a, b);
  }
  std::vector<DivisionGroup> parts(all.size());
  for (std::size_t k = 0; k < all.size(); ++k) {
    const ObjectModel& object = model.objects[bodies[all[k]].object];
    DivisionGroup& part = parts[root_of(all[k])];
    if (part.finest == nullptr || object.cell < part.finest->cell) part.finest = &object;
    const bool strict = object.mesh_error && (part.strictest == nullptr || *object.mesh_error < *part.strictest->mesh_error);
    if (strict) part.strictest = &object;
  }
  std::vector<DivisionGroup> groups;
  for (std::size_t k = 0; k < all.size(); ++k) {
    const DivisionGroup& part = parts[root_of(all[k])];
    auto group = std::find_if(groups.begin(), groups.end(), [&](const DivisionGroup& g) { return cell_and_error(g) == cell_and_error(part); });
    if (group == groups.end()) group = groups.insert(groups.end(), part);
    group->member.push_back(k);
  }
  return groups;
}

implicit::DelaunayOptions delaunay_options(const StageContext& context, const implicit::Lattice& lattice) {
  const MeshingDesc& d = context.model.meshing;
  const double size = d.size.value_or(2.0 * lattice.cell);
  return {.angle = d.angle, .size = size, .distance = d.distance.value_or(0.1 * size), .cell = lattice.cell, .interrupt = context.interrupt};
}

/// Version numbers of the deformed pressures of a division, by their inputs. Meshers of lattices that the last frame did not use are removed.
std::vector<std::uint64_t> versions_of(const StageContext& context, const Division& division, Frame& frame) {
  DivisionMeshers& dividing = frame.dividing;
  std::erase_if(dividing.mesher, [](const auto& on) { return !on.used; });
  for (auto& on : dividing.mesher) on.used = false;
  dividing.fields.begin_frame();
  dividing.pressures.begin_frame();
  std::vector<std::optional<std::uint64_t>> field(division.placed.size());
  const auto field_of = [&](std::uint32_t body) {
    if (field[body]) return *field[body];
    ContentWords words;
    add_field_content(context.bodies, frame, body, words);
    return *(field[body] = dividing.fields.of(words.view()));
  };
  std::vector<std::uint64_t> version;
  ContentWords words;
  for (const collision::DeformedPressure& pressure : division.pressure) {
    words.clear();
    pressure.add_content(field_of, words);
    version.push_back(dividing.pressures.of(words.view()));
  }
  return version;
}

DivisionMeshers::OnLattice& mesher_of(const DivisionGroup& group, DivisionMeshers& dividing) {
  const auto wanted = cell_and_error(group);
  auto on = std::find_if(dividing.mesher.begin(), dividing.mesher.end(), [&](const auto& m) { return std::pair(m.cell, m.error) == wanted; });
  if (on == dividing.mesher.end()) on = dividing.mesher.insert(on, DivisionMeshers::OnLattice{.cell = wanted.first, .error = wanted.second});
  on->used = true;
  return *on;
}

/// The deformed pressures of some bodies, and the mesher of their lattice.
struct Pressures {
  std::vector<implicit::FieldView> view;
  std::vector<std::uint64_t> version;
  DivisionMeshers::OnLattice* mesher = nullptr;  ///< null: nothing is kept
};

/// Where the search for a lattice that meets the group's error begins. @pre group.strictest is not null
std::pair<implicit::Lattice, implicit::PartitionError> to_error(const DivisionGroup& group, std::span<const implicit::FieldView> views,
                                                                const implicit::Lattice& lattice) {
  double feature = std::numeric_limits<double>::infinity();
  for (const implicit::FieldView& view : views) feature = std::min(feature, view.feature_size());
  const bool stated = group.finest->cell_is_stated && lattice.cell <= 0.5 * feature;
  return {{.origin = lattice.origin, .cell = stated ? lattice.cell : 0.5 * feature},
          {.largest = *group.strictest->mesh_error, .cell_is_stated = stated}};
}

/// The meshes of bodies that touch, within the bounds of the scene.
std::vector<Mesh> divide(const StageContext& context, const DivisionGroup& group, const Pressures& pressures, const implicit::Lattice& lattice,
                         implicit::PolygoniseCounts& counts, SearchCounts& missed) {
  const std::vector<implicit::FieldView>& views = pressures.view;
  const Executor& executor = context.executor;
  if (context.model.meshing.method == MeshingName::Delaunay) {
    implicit::DelaunayReport report;
    std::vector<Mesh> meshes = implicit::delaunay_partition(views, delaunay_options(context, lattice), executor, &report);
    counts.blocks_visited = counts.blocks_present = report.seeds + report.inserted;
    missed.crossings += report.crossings;
    return meshes;
  }
  if (group.strictest == nullptr) {
    return pressures.mesher != nullptr ? pressures.mesher->mesher.make(views, pressures.version, lattice, executor, &counts)
                                    : implicit::polygonise_partition(views, lattice, executor, &counts);
  }
  const auto [coarsest, error] = to_error(group, views, lattice);
  return pressures.mesher != nullptr ? pressures.mesher->error_mesher.make(views, pressures.version, coarsest, error, executor, &counts)
                                  : implicit::polygonise_partition_within(views, coarsest, error, executor, &counts);
}

/// The cell follows from a thin surface, given by the object's iso value or its skeleton.
void name_thin_surface(const Model& model, Fault& fault) {
  const ObjectModel& thin = model.objects[*model.thinnest];
  fault.key = "objects." + thin.name + (thin.skeleton.iso > ObjectDesc{}.iso ? ".iso" : ".skeleton");
  fault.found += ", " + short_text(kCellsAcross) + " across a surface " + short_text(kCellsAcross * model.cell) + " m thick";
  fault.hint += " in output.cell, or make the surface thicker";
}

/// Bodies in mirror image of each other meet in planes of a lattice about the origin, where triangles have no area. [cells]
const Vec3 kOffPlanes(0.382, 0.236, 0.447);

/// Books a mesh that is not searched.
void leave_unsearched(const StageContext& context, std::uint32_t body, Unsearched why, SearchCounts& counts) {
  ++counts.unsearched[context.model.objects[context.bodies[body].object].name][static_cast<std::size_t>(why)];
}

void add_found(const implicit::MissedPieces& found, SearchCounts& counts) {
  counts.pieces += found.pieces;
  counts.undecided += found.undecided;
}

/// The pairs of a group that touch or overlap, each once, by place in it.
std::vector<std::array<std::size_t, 2>> pairs_within(const Division& division, const DivisionGroup& group) {
  const auto place = [&](std::uint32_t body) {
    const auto k = static_cast<std::size_t>(std::lower_bound(division.body.begin(), division.body.end(), body) - division.body.begin());
    const auto at = std::lower_bound(group.member.begin(), group.member.end(), k);
    return at != group.member.end() && *at == k ? static_cast<std::size_t>(at - group.member.begin()) : group.member.size();
  };
  std::vector<std::array<std::size_t, 2>> pairs;
  for (const collision::BodyPair& pair : division.pair) {
    const std::size_t a = place(pair.a), b = place(pair.b);
    if (std::max(a, b) < group.member.size()) pairs.push_back({std::min(a, b), std::max(a, b)});
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

/// Why the bodies of a group are not searched: bulges are not part of their fields, and neither is the region they lose to bodies that they pass through.
std::optional<Unsearched> why_unsearched(const StageContext& context, const Division& division, const DivisionGroup& group,
                                         const Frame& frame, double cell) {
  const MeshingDesc& d = context.model.meshing;
  const collision::BulgeSettings& bulge = context.model.bulge;
  if (d.method != MeshingName::Auto && d.method != MeshingName::Cubes) return Unsearched::Mesher;
  const bool passes = std::any_of(group.member.begin(), group.member.end(), [&](std::size_t k) { return division.passes(k); });
  if (bulge.attenuation > 0.0 || bulge.keep_volume || passes) return Unsearched::Bulges;
  if (d.search) return std::nullopt;
  std::vector<implicit::DividingBody> bodies;
  for (const std::size_t k : group.member) {
    const std::uint32_t i = division.body[k];
    bodies.push_back({&context.bodies[i].skeleton, frame.placed[i].support});
  }
  return why_left_out(implicit::estimate_search(bodies, pairs_within(division, group), cell), 1);
}

/// Adds pieces that the lattice misses of bodies that touch.
void search_between(const StageContext& context, const Division& division, const DivisionGroup& group, const implicit::Lattice& lattice,
                    Frame& frame, std::span<Mesh> meshes) {
  if (search_is_off(context.model.meshing)) return;
  if (const auto why = why_unsearched(context, division, group, frame, lattice.cell)) {
    for (const std::size_t k : group.member) leave_unsearched(context, division.body[k], *why, frame.missed);
    return;
  }
  std::vector<implicit::SearchedBody> bodies;
  for (const std::size_t k : group.member) {
    const std::uint32_t i = division.body[k];
    bodies.push_back({&frame.field[i], division.placed[i].material.modulus});
  }
  add_found(implicit::add_missed_pieces(bodies, lattice, context.executor, meshes), frame.missed);
}

/// The surfaces of some bodies of a group, in their order. @param lattice  whose cell becomes the one that was used
std::vector<Mesh> divide_some(const StageContext& context, const DivisionGroup& group, const Pressures& pressures, implicit::Lattice& lattice,
                              StageProfile& profile, SearchCounts& missed) {
  implicit::PolygoniseCounts counts;
  std::vector<Mesh> parts = divide(context, group, pressures, lattice, counts, missed);
  lattice.cell = counts.cell;
  profile.visited += counts.blocks_visited;
  profile.present += counts.blocks_present;
  return parts;
}

/// The bodies that touch, and versions of their fields.
struct DividedBodies {
  const Division& division;
  std::span<const std::uint64_t> version;
};

/// The surfaces of the bodies of a group: all together, except those that pass through another one.
void mesh_group(const StageContext& context, const DividedBodies& bodies, const DivisionGroup& group, StageProfile& profile, Frame& frame,
                std::vector<Mesh>& surfaces) {
  const auto& [division, version] = bodies;
  const double cell = group.finest->cell;
  const implicit::Lattice lattice{.origin = cell * kOffPlanes, .cell = cell};
  implicit::Lattice used = lattice;
  Pressures pressures;
  for (const std::size_t k : group.member) {
    pressures.view.emplace_back(division.pressure[k]);
    pressures.version.push_back(version[k]);
  }
  if (context.model.meshing.method != MeshingName::Delaunay) pressures.mesher = &mesher_of(group, frame.dividing);
  std::vector<Mesh> parts = divide_some(context, group, pressures, used, profile, frame.missed);
  search_between(context, division, group, used, frame, parts);
  for (std::size_t n = 0; n < parts.size(); ++n) {
    const std::size_t k = group.member[n];
    if (division.passes(k)) {
      Pressures some;
      some.view.emplace_back(division.pressure[k]);
      for (const std::size_t j : division.others_of(k)) {
        if (std::binary_search(group.member.begin(), group.member.end(), j)) some.view.emplace_back(division.pressure[j]);
      }
      implicit::Lattice own = lattice;
      parts[n] = std::move(divide_some(context, group, some, own, profile, frame.missed).front());
    }
    surfaces[division.body[k]] = std::move(parts[n]);
  }
}

/// The surfaces of bodies that touch, by body. They are divided together, those that share a lattice; the ground divides
/// nothing, it is flat and opaque. Pieces of one object are divided where they still overlap.
void mesh_divided(const StageContext& context, const Division& division, StageProfile& profile, Frame& frame, std::vector<Mesh>& surfaces) {
  const std::vector<std::uint64_t> version = versions_of(context, division, frame);
  for (const DivisionGroup& group : groups_of(context.model, context.bodies, division)) {
    try {
      mesh_group(context, {division, version}, group, profile, frame, surfaces);
    } catch (const Error& failure) {
      throw with_keys_of(context.model, failure, group.finest, group.strictest);
    }
  }
}

/// The surface of a body that touches no other, by a mesher other than marching cubes.
/// @pre method is not cubes
Mesh mesh_otherwise(const StageContext& context, std::size_t i, const implicit::Lattice& lattice, StageProfile& profile, Frame& frame) {
  const MeshingDesc& d = context.model.meshing;
  const implicit::Field& field = frame.field[i];
  if (!search_is_off(d)) leave_unsearched(context, static_cast<std::uint32_t>(i), Unsearched::Mesher, frame.missed);
  if (d.method == MeshingName::Tetrahedra) {
    implicit::PolygoniseCounts counts;
    Mesh mesh = implicit::polygonise(field, lattice, context.executor, &counts);
    profile.visited += counts.blocks_visited;
    profile.present += counts.blocks_present;
    return mesh;
  }
  if (d.method == MeshingName::Delaunay) {
    implicit::DelaunayReport report;
    Mesh mesh = (*context.delaunay)(field, delaunay_options(context, lattice), &report);
    profile.visited += report.seeds + report.inserted;
    profile.present += report.seeds + report.inserted;
    return mesh;
  }
  return implicit::mesh_of(implicit::make_surface_grid(field, {.lattice = lattice}, context.executor), field, context.executor);
}

/// Adds pieces that the lattice misses of a body that touches no other. @param bodies  number of bodies of its object
void search_alone(const StageContext& context, std::size_t i, double cell, std::size_t bodies, Frame& frame, Mesh& mesh) {
  const MeshingDesc& d = context.model.meshing;
  if (search_is_off(d)) return;
  std::optional<Unsearched> why;
  if (!d.search) why = why_left_out(implicit::estimate_search(context.bodies[i].skeleton, frame.placed[i].support, cell), bodies);
  if (why) {
    leave_unsearched(context, static_cast<std::uint32_t>(i), *why, frame.missed);
  } else {
    add_found(implicit::add_missed_pieces(frame.field[i], {.origin = Vec3::Zero(), .cell = cell}, context.executor, mesh), frame.missed);
  }
}

/// Whether a body that touches no other is meshed by marching cubes.
bool takes_cubes(const MeshingDesc& d, const ObjectModel& object, const implicit::Skeleton& skeleton, std::span<const Box> supports) {
  if (d.method != MeshingName::Auto || object.mesh_error) return d.method == MeshingName::Auto || d.method == MeshingName::Cubes;
  return d.search.value_or(false) || implicit::estimate_routes(skeleton, supports, object.cell).prefers_cubes();
}

/// The lattice and error of marching cubes for a body of an object.
implicit::MarchOptions march_options(const ObjectModel& object, bool skip) {
  implicit::MarchOptions options{.lattice = {.origin = Vec3::Zero(), .cell = object.cell}, .error = object.mesh_error.value_or(0.0), .skip = skip};
  if (object.mesh_error && !object.cell_is_stated) options.lattice.cell = 0.0;
  return options;
}

bool takes_creases(const MeshingDesc& d, const implicit::Field& field) { return d.method == MeshingName::Auto && implicit::has_creases(field); }

/// The surface of a body that touches no other. @param bodies  number of bodies of its object
Mesh mesh_alone(const StageContext& context, std::size_t i, std::size_t bodies, KeptBudget& budget, StageProfile& profile, Frame& frame) {
  const Model& model = context.model;
  const MeshingDesc& d = model.meshing;
  const ObjectModel& object = model.objects[context.bodies[i].object];
  const implicit::Lattice lattice{.origin = Vec3::Zero(), .cell = object.cell};
  const implicit::Field& field = frame.field[i];
  try {
    if (!takes_cubes(d, object, context.bodies[i].skeleton, frame.placed[i].support)) return mesh_otherwise(context, i, lattice, profile, frame);
    implicit::MarchCounts marched;
    const implicit::MarchOptions options = march_options(object, context.skip);
    const auto make = [&](auto& mesher) -> const Mesh& { return mesher.make(field, options, context.executor, &marched); };
    Mesh mesh = takes_creases(d, field) ? budget.use(frame.creases[i], make) : budget.use(frame.mesher[i], make);
    if (marched.blunt_cells > 0) frame.missed.blunt[object.name] += marched.blunt_cells;
    search_alone(context, i, marched.cell, bodies, frame, mesh);
    profile.visited += marched.tiles;
    profile.present += 64 * marched.blocks;
    return mesh;
  } catch (const Error& failure) {
    throw with_keys_of(model, failure, &object, &object);
  }
}

/// @throws Error{Limit} as mesh_alone would for the size of the body
void expect_size_alone(const MeshingDesc& d, const ObjectModel& object, const implicit::Skeleton& skeleton, std::span<const Box> supports,
                       const implicit::FieldView& field, const Executor& executor) {
  const implicit::Lattice lattice{.origin = Vec3::Zero(), .cell = object.cell};
  if (takes_cubes(d, object, skeleton, supports)) {
    implicit::expect_marchable(field, lattice, executor);
  } else if (d.method == MeshingName::Tetrahedra) {
    implicit::expect_divisible({&field, 1}, lattice, executor);
  } else {
    implicit::expect_griddable(field, {.lattice = lattice}, executor);
  }
}

/// @throws Error{Limit} as mesh_alone would for the given error, as far as meshes of about a second of work show
/// @param bodies  that share some ten seconds
void expect_error_alone(const MeshingDesc& d, const ObjectModel& object, const implicit::Field& field, std::size_t bodies, const Executor& executor) {
  constexpr std::uint64_t kTrianglesASecond = 200'000, kSeconds = 10;
  const std::uint64_t most = std::min(kTrianglesASecond, kSeconds * kTrianglesASecond / bodies);
  if (takes_creases(d, field)) {
    implicit::CreaseMesher().expect_error(field, march_options(object, true), executor, most);
  } else {
    implicit::CubeMesher().expect_error(field, march_options(object, true), executor, most);
  }
}

}  // namespace

void add_field_content(const std::vector<Body>& bodies, const Frame& frame, std::uint32_t body, ContentWords& words) {
  const std::size_t moving = bodies.size();
  words.add(body < moving);
  if (body < moving) {
    implicit::add_content(bodies[body].skeleton, frame.placed[body], words);
  } else {  // fixed bodies change by their position only
    words.add(body - moving);
    words.add(frame.led[body - moving].pose);
  }
}

std::vector<Mesh> polygonise_objects(const StageContext& context, const Division& division, const State& state, const core::Interactions& laws,
                                     Frame& frame) {
  const Model& model = context.model;
  const core::ParticleState& particles = state.particles;
  const std::vector<Body>& bodies = context.bodies;
  StageProfile& profile = context.profile[static_cast<std::size_t>(Stage::Polygonise)];
  std::vector<Mesh> surfaces(surface_count(bodies));
  frame.missed = {};
  mesh_divided(context, division, profile, frame, surfaces);
  std::vector<std::size_t> pieces(model.objects.size());
  for (std::size_t i = 0; i < surfaces.size(); ++i) ++pieces[bodies[i].object];
  KeptBudget budget(context.most_kept);
  for (const implicit::CubeMesher& mesher : frame.mesher) budget.add(mesher);
  for (const implicit::CreaseMesher& mesher : frame.creases) budget.add(mesher);
  for (std::uint32_t i = 0; i < surfaces.size(); ++i) {
    if (bodies[i].skeleton.primitive.empty() || std::binary_search(division.body.begin(), division.body.end(), i)) continue;
    if (!is_there(model, bodies[i].object, context.time)) continue;
    if (context.shown != nullptr && !(*context.shown)(frame.field[i].surface_box())) {
      profile.present += 1;
    } else {
      surfaces[i] = mesh_alone(context, i, pieces[bodies[i].object], budget, profile, frame);
    }
  }
  for (std::uint32_t i = 0; i < surfaces.size() && model.meshing.motion; ++i) {
    if (surfaces[i].position.empty()) continue;
    core::gather_motion(model.particles, particles, bodies[i].particle, frame.velocity[i], frame.spin[i]);
    add_surface_motion(context, state, i, frame, surfaces[i]);
  }
  for (std::uint32_t i = 0; i < surfaces.size(); ++i) {
    if (surfaces[i].position.empty()) continue;
    add_look_columns(model, {bodies[i], particles, laws, frame.field[i], frame.pose[i]}, context.executor, surfaces[i]);
    if (model.objects[bodies[i].object].look.colour_by == ColourByName::Pressure) {
      add_pressure(frame.bodies, frame.surface, i, context.executor, surfaces[i]);
    }
  }
  std::vector<Mesh> meshes(model.objects.size());
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    Mesh& mesh = meshes[bodies[i].object];
    if (mesh.position.empty()) {
      mesh = std::move(surfaces[i]);
    } else {
      append(mesh, surfaces[i]);
    }
  }
  return meshes;
}

void expect_mesh_sizes(Simulation& simulation, const std::function<bool(const Box&)>& shown, const Executor& executor) try {
  const Model& model = simulation.model();
  const MeshingDesc& d = model.meshing;
  if (d.method == MeshingName::Delaunay) return;
  const std::vector<Body>& bodies = simulation.bodies();
  const std::vector<implicit::Field>& fields = simulation.fields();
  const Division& division = simulation.division();
  for (const DivisionGroup& group : groups_of(model, bodies, division)) {
    constexpr std::uint64_t kBlocksASecond = 1000;
    std::vector<implicit::FieldView> views;
    for (const std::size_t k : group.member) views.emplace_back(division.pressure[k]);
    const implicit::Lattice lattice{.origin = group.finest->cell * kOffPlanes, .cell = group.finest->cell};
    try {
      if (group.strictest == nullptr) {
        implicit::expect_divisible(views, lattice, executor);
      } else {
        const auto [coarsest, error] = to_error(group, views, lattice);
        implicit::expect_divisible_within(views, coarsest, error, executor, kBlocksASecond);
      }
    } catch (const Error& failure) {
      throw with_keys_of(model, failure, group.finest, group.strictest);
    }
  }
  std::vector<Pose> pose;
  implicit::PlacedSkeleton placed;
  for (std::uint32_t i = 0; i < surface_count(bodies); ++i) {
    const ObjectModel& object = model.objects[bodies[i].object];
    if (bodies[i].skeleton.primitive.empty()) continue;
    if (std::binary_search(division.body.begin(), division.body.end(), i) || (shown && !shown(fields[i].surface_box()))) continue;
    core::gather_poses(simulation.state().particles, bodies[i].particle, pose);
    implicit::place_skeleton(bodies[i].skeleton, pose, placed);
    try {
      if (object.mesh_error && takes_cubes(d, object, bodies[i].skeleton, placed.support)) {
        expect_error_alone(d, object, fields[i], surface_count(bodies), executor);
      } else if (!object.mesh_error) {
        expect_size_alone(d, object, bodies[i].skeleton, placed.support, fields[i], executor);
      }
    } catch (const Error& failure) {
      throw with_keys_of(model, failure, &object, &object);
    }
  }
} catch (const Error& failure) {
  rethrow_with_places(simulation.scene(), failure);
}

Error with_keys_of(const Model& model, const Error& failure, const ObjectModel* cell, const ObjectModel* error) {
  std::vector<Fault> faults = failure.faults();
  for (Fault& fault : faults) {
    if (fault.key == "lattice.cell") {
      if (cell != nullptr && cell->own_cell) {
        fault.key = "objects." + cell->name + ".meshing.cell";
      } else if (model.thinnest) {
        name_thin_surface(model, fault);
      } else {
        fault.key = "output.cell";
      }
    }
    if (fault.key == "mesh.error") {
      const bool own = error != nullptr && error->own_error;
      fault.key = own ? "objects." + error->name + ".meshing.error" : "output.meshing.error";
    }
    if (fault.key == "mesh.distance") fault.key = "output.meshing.distance";
    if (fault.key == "mesh.cell" && cell != nullptr) {  // of one body
      const std::string own = "objects." + cell->name + ".meshing.cell";
      fault.found += " on '" + cell->name + '\'';
      fault.key = cell->own_cell ? own : "output.cell";
      if (!cell->own_cell) fault.hint += ", for this object alone in " + own;
    }
    if (fault.key == "mesh.size") fault.key = "output.meshing.size";
    if (fault.key == "mesh.angle") fault.key = "output.meshing.angle_deg";
  }
  return {failure.kind(), std::move(faults)};
}

}  // namespace supple::scenes
