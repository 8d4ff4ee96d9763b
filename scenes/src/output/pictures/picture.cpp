#include "output/pictures/picture.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "file/scene_places.h"
#include "output/meshes/look_columns.h"
#include "output/pictures/even_surface.h"
#include "output/pictures/smooth_normals.h"
#include "supple/collision/sleep.h"
#include "supple/render/glyphs.h"

namespace supple::scenes {
namespace {

/// Mesh of an obstacle for pictures.
Mesh obstacle_mesh(const ObstacleDesc& d, const FixedBody& body) {
  constexpr int kFiner = 4;  // facets along a cell of the heights
  if (const auto* box = std::get_if<implicit::SolidBox>(&body.solid)) return box->mesh();
  if (const auto* heights = std::get_if<implicit::HeightField>(&body.solid)) return heights->mesh(kFiner);
  if (const auto* solid = std::get_if<implicit::MeshSolid>(&body.solid)) {
    Mesh mesh = solid->mesh();
    smooth_normals(d.smooth, mesh);
    return mesh;
  }
  if (const auto* primitives = std::get_if<FixedBody::Primitives>(&body.solid)) {
    constexpr double kAcross = 24.0;  // cells of a feature of the field
    implicit::MarchOptions options;
    options.lattice.cell = (*primitives)->feature_size() / kAcross;
    return implicit::march_cubes(**primitives, options, Executor(1));
  }
  const Vec3 normal = d.normal.normalized(), u = d.extent * normal.unitOrthogonal(), v = normal.cross(u);
  Mesh mesh;
  add_quadrangle(mesh, d.at - u - v, d.at + u - v, d.at + u + v, d.at - u + v);
  return mesh;
}

/// Places in the axes of an obstacle, a little inside of it: its faces may lie between two cubes of a pattern.
void add_own_places(const ObstacleDesc& d, Mesh& mesh) {
  const double inside = 1e-3 * d.texture->size;
  const Quat to_own(Eigen::AngleAxisd(-d.turn, d.turn_axis.normalized()));
  std::array<std::vector<double>, 3> places;
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
    const Vec3 p = to_own * Vec3(mesh.position[v] - inside * mesh.normal[v] - d.at);
    for (std::size_t k = 0; k < 3; ++k) places[k].push_back(p[static_cast<Eigen::Index>(k)]);
  }
  constexpr std::array kNames = {"rest_x", "rest_y", "rest_z"};
  for (std::size_t k = 0; k < 3; ++k) mesh.columns.push_back({.name = kNames[k], .values = std::move(places[k])});
}

/// A mesh about the origin to its place.
void lead(const SolidPlace& place, Mesh& mesh) {
  for (const char axis : {'x', 'y', 'z'}) mesh.columns.push_back({std::string("velocity_") + axis, {}});
  for (Vec3& x : mesh.position) {
    const Vec3 arm = place.pose.orientation * x;
    const Vec3 velocity = place.velocity + place.spin.cross(arm);
    for (Eigen::Index axis = 0; axis < 3; ++axis) mesh.columns[mesh.columns.size() - 3 + static_cast<std::size_t>(axis)].values.push_back(velocity[axis]);
    x = place.pose.position + arm;
  }
  for (Vec3& n : mesh.normal) n = place.pose.orientation * n;
}

render::RenderSettings settings_of(const Scene& scene, render::ContextKind context, int threads) {
  render::RenderSettings settings;
  if (scene.output.images) {
    settings.width = scene.output.images->size.at(0);
    settings.height = scene.output.images->size.at(1);
    settings.samples = scene.output.images->samples;
  }
  // Edges of shadows as fine as the pixels that show them: the map costs as much as a small picture.
  constexpr std::size_t kTexelsAPixel = 2, kLeastMap = 256, kLargestMap = 2048;
  const auto edge = static_cast<std::size_t>(std::max(settings.width, settings.height));
  settings.shadow_size = static_cast<int>(std::clamp(std::bit_ceil(kTexelsAPixel * edge) / 2, kLeastMap, kLargestMap));
  settings.shadow_softness = scene.light.softness;
  settings.context = context;
  settings.kind = scene.render.renderer == RendererName::Path ? render::RendererKind::Path : render::RendererKind::Gl;
  settings.threads = threads;
  settings.noise = scene.render.noise;
  settings.most_samples = scene.render.most_samples;
  settings.denoise = scene.render.denoise;
  settings.exact = scene.render.exact_surface;
  settings.shutter = scene.render.shutter / scene.frame_rate;
  return settings;
}

/// Reads the picture of a texture that has one. @throws Error{Io}
render::Paint paint_of(const std::optional<TextureDesc>& texture, const FileAccess& files) {
  render::Paint paint;
  if (!texture) return paint;
  constexpr std::array kKinds = {render::PaintKind::Checker, render::PaintKind::Stripes, render::PaintKind::Picture};
  paint.kind = kKinds[static_cast<std::size_t>(texture->pattern)];
  paint.colour = texture->colour;
  paint.size = texture->size;
  paint.axis = texture->axis;
  if (texture->pattern == PatternName::Picture) paint.picture = std::make_shared<const render::Image>(render::read_png(named_file(files, texture->file)));
  return paint;
}

render::View view_of(const Scene& scene) {
  render::View view;
  view.light = {.direction = scene.light.direction, .intensity = scene.light.intensity};
  if (scene.ground && scene.ground->visible) {
    view.ground = render::Ground{scene.ground->height, scene.ground->colour, paint_of(scene.ground->texture, files_of(scene))};
  }
  view.background_top = scene.background.top;
  view.background_bottom = scene.background.bottom;
  for (const AreaLightDesc& d : scene.lights) {
    view.area_lights.push_back({.at = d.at, .facing = d.facing, .half_sizes = d.half_sizes.head<2>(), .colour = d.colour,
                                .radiance = d.intensity});
  }
  return view;
}

/// @param thickness  the smallest one of the object [m]
render::Inside inside_of(const LookDesc& look, double thickness) {
  constexpr double kFreePath = 0.2;  // over the thickness
  switch (look.body) {
    case BodyName::Translucent: return {.kind = render::InsideKind::Scatter, .depth = look.depth.value_or(kFreePath * thickness)};
    case BodyName::Glass: return {.kind = render::InsideKind::Glass, .index = look.index, .depth = look.depth.value_or(thickness)};
    case BodyName::Opaque: break;
  }
  return {};
}

struct Quantity {
  const char* column;
  const char* title;
};

/// The column of `colour_by`, and the label of its scale bar.
Quantity quantity_of(ColourByName by) {
  switch (by) {
    case ColourByName::Pressure: return {"pressure", "pressure [Pa]"};
    case ColourByName::Stretch: return {"stretch", "stretch"};
    case ColourByName::Speed: return {"speed", "speed [m/s]"};
    case ColourByName::Colour:
    case ColourByName::Normals: break;
  }
  return {"", ""};
}

render::Paint paint_of(const LookDesc& look, const FileAccess& files) {
  render::Paint paint = paint_of(look.texture, files);
  if (look.colour_by == ColourByName::Normals) paint.kind = render::PaintKind::Normals;
  const Quantity quantity = quantity_of(look.colour_by);
  if (*quantity.column != '\0') {
    paint.kind = render::PaintKind::Values;
    paint.column = quantity.column;
    paint.map = static_cast<render::ColourMap>(look.map);
    paint.lower = look.range.x();
    paint.upper = look.range.y();
  }
  return paint;
}

/// One bar for each quantity, map and range that is shown.
std::vector<render::ScaleBar> bars_of(const Scene& scene) {
  std::vector<render::ScaleBar> bars;
  for (const ObjectDesc& object : scene.objects) {
    const Quantity quantity = quantity_of(object.look.colour_by);
    if (*quantity.column == '\0' || !object.look.scale_bar) continue;
    const render::ScaleBar bar{.map = static_cast<render::ColourMap>(object.look.map), .lower = object.look.range.x(),
                               .upper = object.look.range.y(), .title = quantity.title};
    if (std::find(bars.begin(), bars.end(), bar) == bars.end()) bars.push_back(bar);
  }
  return bars;
}

std::vector<render::Camera> cameras_at(const Scene& scene, const Model& model, double time) {
  std::vector<render::Camera> cameras;
  for (const CameraDesc& desc : model.cameras) cameras.push_back(camera_at(desc, time, scene.duration));
  return cameras;
}

/// Width and height [pixel].
std::vector<int> picture_size_of(const Scene& scene) { return scene.output.images ? scene.output.images->size : ImagesDesc{}.size; }

}  // namespace

void check_pictures(const Scene& scene) {
  std::vector<Fault> faults;
  const auto check = [&](const std::optional<TextureDesc>& texture, const std::string& owner) {
    try {
      read_for(owner + "texture.file", [&] { return paint_of(texture, files_of(scene)); });
    } catch (const Error& error) {
      faults.insert(faults.end(), error.faults().begin(), error.faults().end());
    }
  };
  for (const ObjectDesc& object : scene.objects) check(object.look.texture, "objects." + object.name + ".look.");
  for (const ObstacleDesc& obstacle : scene.obstacles) check(obstacle.texture, "obstacles." + obstacle.name + '.');
  if (scene.ground) check(scene.ground->texture, "ground.");
  if (!faults.empty()) throw Error(ErrorKind::Io, std::move(faults));
  if (scene.render.renderer == RendererName::Path && !render::has_path_tracer()) {
    static_cast<void>(render::make_renderer({.kind = render::RendererKind::Path}));  // throws for absent files
  }
}

std::vector<Mesh> obstacle_meshes(const Scene& scene, const Model& model, double time) {
  std::vector<Mesh> meshes;
  for (std::size_t i = 0; i < scene.obstacles.size(); ++i) {
    const FixedBody& body = model.fixed[model.fixed.size() - scene.obstacles.size() + i];
    meshes.push_back(scene.obstacles[i].visible ? obstacle_mesh(scene.obstacles[i], body) : Mesh());
    if (scene.obstacles[i].texture) add_own_places(scene.obstacles[i], meshes.back());
    if (body.led()) lead(place_at(body.motion, time), meshes.back());
  }
  return meshes;
}

ScenePictures::ScenePictures(const Scene& scene, const Model& model, render::ContextKind context, int threads)
    : scene_(scene), view_(view_of(scene)), bars_(bars_of(scene)), settings_(settings_of(scene, context, threads)), cell_(model.cell) {
  for (const ObjectDesc& object : scene.objects) paints_.push_back(paint_of(object.look, files_of(scene)));
  for (const ObstacleDesc& obstacle : scene.obstacles) obstacle_paints_.push_back(paint_of(obstacle.texture, files_of(scene)));
  obstacles_ = obstacle_meshes(scene, model, 0.0);
  renderer_ = render::make_renderer(settings_);
}

void ScenePictures::add(render::Item item, std::string name) {
  items_.push_back(std::move(item));
  item_names_.push_back(std::move(name));
}

std::function<bool(const Box&)> shown_by_cameras(const Scene& scene, const Model& model, double time) {
  if (scene.render.renderer != RendererName::Gl) return {};
  return [cameras = cameras_at(scene, model, time), aspect = aspect_of(scene), light = scene.light](const Box& box) {
    return std::any_of(cameras.begin(), cameras.end(), [&](const render::Camera& camera) {
      return may_show(camera, aspect, light.direction, light.softness, box);
    });
  };
}

void ScenePictures::limit_meshes(Simulation& simulation) const {
  if (auto shown = shown_by_cameras(scene_, simulation.model(), simulation.time())) simulation.set_shown(std::move(shown));
  const std::vector<render::Camera> cameras = cameras_at(scene_, simulation.model(), simulation.time());
  const std::vector<int> size = picture_size_of(scene_);
  if (!scene_.render.pixel_error || scene_.output.cell) return;
  constexpr double kFiner = 8.0, kCoarser = 4.0;
  double cell = kCoarser * cell_;
  const core::ParticleState& state = simulation.state().particles;
  for (const ObjectModel& object : simulation.model().objects) {
    if (!(object.iso_radius > 0.0) || object.own_cell) continue;
    for (const render::Camera& camera : cameras) {
      double nearest = std::numeric_limits<double>::infinity();
      for (std::uint32_t p = object.first; p < object.last; ++p)
        nearest = std::min(nearest, (state.position[p] - camera.from).norm());
      const double distance = std::max(nearest - object.iso_radius, object.iso_radius);
      const double pixel = 2.0 * std::tan(0.5 * camera.field_of_view) / size.at(1);
      cell = std::min(cell, cell_for(*scene_.render.pixel_error, pixel, distance, object.iso_radius));
    }
  }
  simulation.set_cell(std::max(cell, cell_ / kFiner));
}

void ScenePictures::warn_inside(Simulation& simulation, std::size_t camera) {
  const std::vector<Body>& bodies = simulation.bodies();
  for (std::size_t i = 0; i < surface_count(bodies); ++i) {
    if (bodies[i].skeleton.primitive.empty() || !(implicit::FieldView(simulation.fields()[i]).value(view_.camera.from) > 0.0)) continue;
    const std::string& name = cameras_of(scene_)[camera].name;
    const std::string text = "camera" + (name.empty() ? "" : " '" + name + "'") + " is inside '" +
                             scene_.objects[bodies[i].object].name + "', which is therefore invisible";
    if (std::find(warnings_.begin(), warnings_.end(), text) == warnings_.end()) warnings_.push_back(text);
  }
}

const Mesh& ScenePictures::shown_mesh(const std::vector<Mesh>& meshes, std::size_t object) {
  const double width = scene_.objects[object].look.smooth;
  if (width == 0.0) return meshes[object];
  Mesh& even = even_meshes_.emplace_back(meshes[object]);
  even_surface(width, shared_vertices(meshes, object), even);
  return even;
}

void ScenePictures::add_objects(Simulation& simulation) {
  const std::vector<Mesh>& meshes = simulation.meshes();
  even_meshes_.clear();
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    const ObjectDesc& d = scene_.objects[i];
    if (!d.look.surface && !d.look.wireframe) continue;
    add({.mesh = &shown_mesh(meshes, i), .colour = d.colour, .roughness = d.roughness, .metallic = d.look.metallic,
         .opacity = d.look.opacity, .paint = paints_[i], .surface = d.look.surface,
         .reflectance = d.look.reflectance, .inside = inside_of(d.look, 2.0 * simulation.model().objects[i].iso_radius), .wireframe = d.look.wireframe},
        d.name);
  }
  if (scene_.render.renderer == RendererName::Path && scene_.render.exact_surface) add_fields(simulation);
  for (std::size_t i = 0; i < obstacles_.size(); ++i) {
    const ObstacleDesc& d = scene_.obstacles[i];
    if (!d.visible) continue;
    add({.mesh = &obstacles_[i], .colour = d.colour, .roughness = d.roughness, .two_sided = d.shape != ObstacleName::Box,
         .paint = obstacle_paints_[i], .fixed = true}, d.name);
  }
}

namespace {

/// The surface of a body: F, or F~ = (p - max(p_j, 0)) / P of the deformed pressures p where it touches others.
struct Piece {
  struct Other {
    implicit::FieldView pressure;
    Box positive;
  };
  implicit::FieldView own;
  double scale = 1.0;
  std::vector<Other> others;

  double value(const Vec3& at, Vec3& gradient) const {
    double value = own.value(at, gradient), taken = 0.0;
    Vec3 slope = Vec3::Zero();
    for (const Other& other : others) {
      if (!other.positive.contains(at)) continue;
      Vec3 steepness;
      const double pressure = other.pressure.value(at, steepness);
      if (pressure <= taken) continue;
      taken = pressure;
      slope = steepness;
    }
    gradient = scale * (gradient - slope);
    return scale * (value - taken);
  }
};

/// The bodies of an object: the largest F~ of those whose surface may be within reach.
struct Pieces {
  std::vector<Piece> piece;
  collision::BoxTree near;

  void find_boxes(double reach) {
    std::vector<Box> boxes(piece.size());
    std::vector<std::uint32_t> all(piece.size());
    for (std::uint32_t k = 0; k < piece.size(); ++k) {
      boxes[k] = piece[k].own.surface_box().inflated(reach);
      all[k] = k;
    }
    near.build(boxes, all);
  }
  void evaluate(std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) const {
    thread_local std::vector<std::uint32_t> found;
    for (std::size_t i = 0; i < points.size(); ++i) {
      found.clear();
      near.find({points[i], points[i]}, found);
      std::sort(found.begin(), found.end());  // of equal ones the first
      values[i] = -std::numeric_limits<double>::infinity();
      gradients[i] = Vec3::Zero();
      for (const std::uint32_t k : found) {
        Vec3 gradient;
        const double value = piece[k].value(points[i], gradient);
        if (value <= values[i]) continue;
        values[i] = value;
        gradients[i] = gradient;
      }
    }
  }
};

}  // namespace

/// Zero where the mesh of an object should be.
void ScenePictures::add_fields(Simulation& simulation) {
  const std::vector<Body>& bodies = simulation.bodies();
  const std::vector<implicit::Field>& fields = simulation.fields();
  const Division& division = simulation.division();
  std::vector<Pieces> pieces(scene_.objects.size());
  for (std::uint32_t i = 0; i < surface_count(bodies); ++i) {
    if (bodies[i].skeleton.primitive.empty()) continue;
    std::vector<Piece>& of_object = pieces[bodies[i].object].piece;
    const auto at = std::lower_bound(division.body.begin(), division.body.end(), i);
    if (at == division.body.end() || *at != i) {
      of_object.push_back({.own = fields[i], .scale = 1.0, .others = {}});
      continue;
    }
    const auto k = static_cast<std::size_t>(at - division.body.begin());
    Piece piece{.own = division.pressure[k], .scale = 1.0 / division.placed[i].material.modulus, .others = {}};
    for (const std::size_t j : division.others_of(k)) {
      const implicit::FieldView pressure = division.pressure[j];
      piece.others.push_back({pressure, pressure.surface_box()});
    }
    of_object.push_back(std::move(piece));
  }
  const std::vector<Mesh>& meshes = simulation.meshes();
  for (render::Item& item : items_) {
    const auto object = static_cast<std::size_t>(item.mesh - meshes.data());
    if (item.mesh < meshes.data() || object >= meshes.size() || pieces[object].piece.empty()) continue;
    item.field_reach = simulation.model().objects[object].cell;
    pieces[object].find_boxes(2.0 * item.field_reach);  // from a hit's triangle to the surface, and as far again
    item.field = [parts = std::move(pieces[object])](std::span<const Vec3> points, std::span<double> values, std::span<Vec3> gradients) {
      parts.evaluate(points, values, gradients);
    };
  }
}

void ScenePictures::add_glyphs(const Simulation& simulation) {
  glyphs_.clear();
  const core::ParticleState& state = simulation.state().particles;
  for (std::size_t i = 0; i < scene_.objects.size(); ++i) {
    const LookDesc& look = scene_.objects[i].look;
    const ObjectModel& object = simulation.model().objects[i];
    if (!is_there(simulation.model(), static_cast<std::uint32_t>(i), simulation.time())) continue;
    if (look.frames > 0.0) {
      std::vector<Pose> poses;
      for (std::uint32_t p = object.first; p < object.last; ++p) poses.push_back({state.position[p], state.orientation[p]});
      const std::array<Vec3, 3> colours = {Vec3(0.85, 0.16, 0.12), Vec3(0.15, 0.62, 0.20), Vec3(0.13, 0.32, 0.85)};
      std::array<Mesh, 3> axes = render::frame_glyphs(poses, look.frames);
      for (std::size_t k = 0; k < 3; ++k) {
        add({.mesh = &glyphs_.emplace_back(std::move(axes[k])), .colour = colours[k]}, object.name + ".frames");
      }
    }
    if (look.bonds > 0.0) {
      Mesh& mesh = glyphs_.emplace_back();
      for (const auto& [a, b] : core::bonded_pairs(simulation.laws())) {
        if (a >= object.first && a < object.last) render::add_rod(mesh, state.position[a], state.position[b], look.bonds);
      }
      for (std::uint32_t p = object.first; p < object.last; ++p) render::add_ball(mesh, state.position[p], 1.8 * look.bonds);
      add({.mesh = &mesh, .colour = Vec3(0.30, 0.30, 0.33), .roughness = 0.35}, object.name + ".bonds");
    }
  }
}

render::Image ScenePictures::draw(Simulation& simulation, std::size_t camera, render::LinearImage* linear) {
  view_.camera = camera_at(simulation.model().cameras[camera], simulation.time(), scene_.duration);
  warn_inside(simulation, camera);
  const std::vector<FixedBody>& fixed = simulation.model().fixed;
  const bool led = std::any_of(fixed.begin(), fixed.end(), [](const FixedBody& body) { return body.led(); });
  if (led) obstacles_ = obstacle_meshes(scene_, simulation.model(), simulation.time());
  items_.clear();
  item_names_.clear();
  add_objects(simulation);
  add_glyphs(simulation);
  render::Image image = renderer_->render(view_, items_, linear);
  render::draw_scale_bars(image, bars_);
  if (view_.ground) item_names_.emplace_back("ground");
  return image;
}

render::Layers ScenePictures::layers() {
  if (!layer_renderer_) layer_renderer_ = render::make_layer_renderer(settings_);
  return layer_renderer_->render(view_, items_);
}

}  // namespace supple::scenes
