#include "gl/gl_renderer.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "image/process_time.h"
#include "picture/height_map.h"
#include "supple/core/error.h"

namespace supple::render {
namespace {

// Shares of the distance between camera and look_at, so that a fixed camera gives fixed looks.
constexpr double kOcclusionRadius = 0.07;
constexpr double kRegion = 3.0;

bool is_glass(const Item& item) { return item.inside.kind == InsideKind::Glass; }

}  // namespace

void GlRenderer::draw_range(const DrawRange& range) const {
  gl_.DrawElements(GL_TRIANGLES, static_cast<GLsizei>(range.count), GL_UNSIGNED_INT,
                   reinterpret_cast<const void*>(range.first * sizeof(std::uint32_t)));
}

/// Those of glass, or all others.
void GlRenderer::draw_items(std::span<const Item> items, bool glass) const {
  gl_.BindVertexArray(item_array_);
  for (const DrawRange& range : list_.ranges) {
    if (is_glass(items[range.item]) == glass) draw_range(range);
  }
}

void GlRenderer::draw_cover() const {
  gl_.BindVertexArray(empty_array_);
  gl_.DrawArrays(GL_TRIANGLES, 0, 3);
}

void GlRenderer::begin(const Target& target, bool depth) const {
  gl_.BindFramebuffer(GL_FRAMEBUFFER, target.framebuffer);
  gl_.Viewport(0, 0, priming_ ? 1 : target.width, priming_ ? 1 : target.height);
  if (depth)
    gl_.Enable(GL_DEPTH_TEST);
  else
    gl_.Disable(GL_DEPTH_TEST);
}

void GlRenderer::draw_shadow_map(const MapFit& fit, std::span<const Item> items) const {
  begin(shadow_, true);
  gl_.Clear(GL_DEPTH_BUFFER_BIT);
  programs_->depth.use();
  programs_->depth.set("to_clip", fit.to_clip);
  draw_items(items, false);
}

void GlRenderer::draw_ground_occlusion(const MapFit& fit, float ground_height) {
  fill_heights(list_, fit, ground_height, kHeightMapSize, height_values_);
  gl_.ActiveTexture(GL_TEXTURE0 + kHeights);
  gl_.TexImage2D(GL_TEXTURE_2D, 0, GL_RG32F, kHeightMapSize, kHeightMapSize, 0, GL_RG, GL_FLOAT, height_values_.data());

  begin(ground_occlusion_, false);
  programs_->ground_occlusion.use();
  programs_->ground_occlusion.set("heights", kHeights);
  programs_->ground_occlusion.set("map_size", fit.extent.x());
  programs_->ground_occlusion.set("target_size", static_cast<float>(ground_occlusion_.width));
  draw_cover();
}

/// Depths of geometry are largest at the near plane; those of maps and of draw_picture are least where they are nearest.
void GlRenderer::begin_geometry(const Target& target) const {
  begin(target, true);
  gl_.ClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
  gl_.DepthFunc(GL_GEQUAL);
  gl_.ClearDepth(0.0);
  gl_.Clear(GL_DEPTH_BUFFER_BIT);
}

void GlRenderer::end_geometry() const {
  gl_.ClipControl(GL_LOWER_LEFT, GL_NEGATIVE_ONE_TO_ONE);
  gl_.DepthFunc(GL_LEQUAL);
  gl_.ClearDepth(1.0);
  gl_.Enable(GL_CULL_FACE);
  gl_.Disable(GL_SAMPLE_MASK);
}

void GlRenderer::draw_geometry(const CameraMatrices& camera, std::span<const Item> items) const {
  if (painted_) {
    draw_painted_geometry(camera, items);
    return;
  }
  begin_geometry(geometry_);
  programs_->geometry.use();
  programs_->geometry.set("to_clip", camera.view_projection);
  gl_.BindVertexArray(item_array_);
  for (const DrawRange& range : list_.ranges) {
    set_cover(items[range.item], range.item);
    programs_->geometry.set("id", geometry_id(items[range.item], range.item));
    draw_range(range);
  }
  end_geometry();
}

void GlRenderer::set_geometry(const Program& program, const CameraMatrices& camera, const View& view) const {
  program.set("geometry", kGeometry);
  program.set("depths", kDepths);
  program.set("sample_at", std::span<const Eigen::Vector2f>(sample_at_));
  program.set("half_extent", camera.half_extent);
  program.set("picture_size",
              Eigen::Vector2f(static_cast<float>(settings_.width), static_cast<float>(settings_.height)));
  program.set("depth_range", camera.depth_range);
  program.set("view", camera.view);
  program.set("eye_height", view.ground ? static_cast<float>(view.camera.from.z() - view.ground->height) : -1.0F);
}

void GlRenderer::draw_screen_occlusion(const CameraMatrices& camera, const View& view, float radius) const {
  begin(occlusion_, false);
  programs_->occlusion.use();
  set_geometry(programs_->occlusion, camera, view);
  programs_->occlusion.set("radius", radius);
  draw_cover();

  begin(blurred_, false);
  programs_->blur.use();
  programs_->blur.set("occlusion", kOcclusion);
  programs_->blur.set("radius", radius);
  programs_->blur.set("nowhere", 2.0F * camera.depth_range.y());
  draw_cover();
}

void GlRenderer::set_background(const Program& program, const View& view) const {
  program.set("background_top", linear_colour(view.background_top));
  program.set("background_bottom", linear_colour(view.background_bottom));
}

void GlRenderer::set_light(const Program& program, const Shot& shot, const View& view) const {
  const Eigen::Vector3f to_light = -view.light.direction.normalized().cast<float>();
  const Eigen::Vector3f sun = sun_colour(view.light);
  const Eigen::Vector3f sky = sky_colour();
  // The ground sends back what falls on it, less the shade that items cast over it; without one, half a sky.
  Eigen::Vector3f bounce = 0.5F * sky;
  if (view.ground)
    bounce = 0.45F * linear_colour(view.ground->colour).cwiseProduct(sky + std::max(to_light.z(), 0.0F) * sun);
  program.set("to_light", to_light);
  program.set("sun", sun);
  program.set("sky", sky);
  program.set("bounce", bounce);
  program.set("exposure", kExposure);
  program.set("light_tangent", static_cast<float>(std::tan(settings_.shadow_softness)));
  program.set("shadow_depth", kShadowDepth);
  program.set("shadow_compare", kShadowCompare);
  program.set("shadow_texels", shot.shadow ? static_cast<float>(settings_.shadow_size) : 0.0F);
  program.set("glass_depth", kGlassDepth);
  program.set("glass_passed", kGlassPassed);
  program.set("has_glass", shot.glass ? 1 : 0);
  if (shot.shadow) {
    program.set("shadow_to_unit", shot.shadow->to_unit);
    program.set("shadow_axes", shot.shadow->axes);
    program.set("shadow_extent", shot.shadow->extent);
  }
  program.set("eye", shot.camera.eye);
  program.set("camera_distance", static_cast<float>(shot.camera.distance));
  program.set("ground_visibility", kGroundOcclusion);
  program.set("ground_occluded", shot.heights ? 1.0F : 0.0F);
  if (shot.heights) program.set("ground_to_unit", shot.heights->to_unit);
  set_ground(program, view);
  if (!view.area_lights.empty()) set_area_lights(program, shot, view);
}

void GlRenderer::set_ground(const Program& program, const View& view) const {
  if (!view.ground) return;
  const Paint& paint = view.ground->paint;
  program.set("ground_albedo", linear_colour(view.ground->colour));
  if (paint.kind == PaintKind::Plain) return;
  program.set("ground_paint", static_cast<int>(paint.kind));
  program.set("ground_second", linear_colour(paint.colour));
  program.set("ground_paint_size", static_cast<float>(paint.size));
  program.set("ground_axis", Eigen::Vector2f(paint.axis.normalized().head<2>().cast<float>()));
  program.set("ground_origin", Eigen::Vector2f(pattern_origin_.head<2>().cast<float>()));
  if (paint.kind != PaintKind::Picture) return;
  program.set("ground_picture", kGroundPicture);
  program.set("ground_aspect", static_cast<float>(paint.picture->width) / static_cast<float>(paint.picture->height));
  bind(kGroundPicture, pictures_.at(paint.picture), GL_TEXTURE_2D);
}

void GlRenderer::set_area_lights(const Program& program, const Shot& shot, const View& view) const {
  const std::size_t count = std::min(view.area_lights.size(), kAreaLights);
  std::array<std::array<Eigen::Vector3f, kAreaLights>, 6> area;
  for (std::size_t i = 0; i < count; ++i) {
    const RectangleEdges edges = rectangle_edges(view.area_lights[i]);
    area[0][i] = view.area_lights[i].at.cast<float>();
    area[1][i] = edges.u.cast<float>();
    area[2][i] = edges.v.cast<float>();
    area[3][i] = static_cast<float>(view.area_lights[i].radiance) * linear_colour(view.area_lights[i].colour);
    area[4][i] = shot.area[i].lower;
    area[5][i] = shot.area[i].extent;
  }
  constexpr std::array<const char*, 6> kNames = {"area_centre", "area_u", "area_v", "area_radiance", "area_lower", "area_extent"};
  for (std::size_t k = 0; k < kNames.size(); ++k) program.set(kNames[k], std::span<const Eigen::Vector3f>(area[k]).first(count));
  program.set("area_lights", static_cast<int>(count));
  program.set("area_depth", kAreaDepth);
  program.set("area_compare", kAreaCompare);
  program.set("area_texels", static_cast<float>(kAreaMapSize));
}

void GlRenderer::draw_picture(const Target& target, const LightPrograms& programs, const Shot& shot, const View& view) const {
  begin(target, true);
  gl_.DepthFunc(GL_ALWAYS);
  programs.classify.use();
  set_geometry(programs.classify, shot.camera, view);
  set_background(programs.classify, view);
  draw_cover();
  gl_.DepthMask(GL_FALSE);

  // Between the depths that `classify` writes: .3 is behind the ground's .1 alone, .7 before the items' .9 alone.
  if (view.ground) {
    gl_.DepthFunc(GL_GREATER);
    programs.ground.use();
    programs.ground.set("plane", 2.0F * 0.3F - 1.0F);
    set_geometry(programs.ground, shot.camera, view);
    set_background(programs.ground, view);
    set_light(programs.ground, shot, view);
    draw_cover();
  }
  if (!list_.ranges.empty()) {
    gl_.DepthFunc(GL_LESS);
    const Program& program = programs.items;
    program.use();
    program.set("plane", 2.0F * 0.7F - 1.0F);
    set_geometry(program, shot.camera, view);
    set_background(program, view);
    set_light(program, shot, view);
    program.set("materials", kMaterials);
    program.set("paints", kPaints);
    program.set("occlusion", kBlurred);
    program.set("occlusion_radius", shot.radius);
    program.set("contact_taps", list_.ranges.size() > 1 ? 8 : 0);
    draw_cover();
  }
  gl_.DepthMask(GL_TRUE);
  gl_.DepthFunc(GL_LEQUAL);
}

void GlRenderer::check_error() const {
  const GLenum code = gl_.GetError();
  if (code == GL_NO_ERROR) return;
  const bool memory = code == GL_OUT_OF_MEMORY;
  throw Error(memory ? ErrorKind::Limit : ErrorKind::Internal,
              Fault{.place = "render",
                    .key = {},
                    .expected = memory ? "the driver has no memory for the picture"
                                       : "OpenGL reports error " + std::to_string(code),
                    .found = {},
                    .hint = {}});
}

void GlRenderer::read_linear(LinearImage& image) {
  const std::size_t row = 4 * static_cast<std::size_t>(settings_.width), rows = static_cast<std::size_t>(settings_.height);
  image.width = settings_.width;
  image.height = settings_.height;
  image.rgba.resize(row * rows);
  gl_.ReadPixels(0, 0, settings_.width, settings_.height, GL_RGBA, GL_FLOAT, image.rgba.data());
  check_error();
  for (std::size_t y = 0; y < rows / 2; ++y)
    std::swap_ranges(&image.rgba[row * y], &image.rgba[row * y] + row, &image.rgba[row * (rows - 1 - y)]);
}

Image GlRenderer::read_back() {
  const auto width = static_cast<std::size_t>(settings_.width);
  const auto height = static_cast<std::size_t>(settings_.height);
  rgba_.resize(4 * width * height);
  gl_.PixelStorei(GL_PACK_ALIGNMENT, 4);
  gl_.ReadPixels(0, 0, settings_.width, settings_.height, GL_RGBA, GL_UNSIGNED_BYTE, rgba_.data());
  check_error();
  Image image{.width = settings_.width, .height = settings_.height, .pixels = {}};
  image.pixels.resize(3 * width * height);
  std::uint8_t* out = image.pixels.data();
  for (std::size_t y = 0; y < height; ++y) {
    const std::uint8_t* row = &rgba_[4 * width * (height - 1 - y)];
    for (std::size_t x = 0; x < width; ++x, out += 3) std::memcpy(out, row + 4 * x, 3);
  }
  return image;
}

/// Depths that area lights see, two by two in one texture.
std::vector<AreaMap> GlRenderer::draw_area_maps(const View& view, std::span<const Item> items) {
  std::vector<AreaMap> maps;
  if (!area_maps_) {
    gl_.ActiveTexture(GL_TEXTURE0 + kAreaDepth);
    area_maps_ = make_target(gl_, 2 * kAreaMapSize, 2 * kAreaMapSize, {.colour = 0, .depth = true});
    bind(kAreaDepth, area_maps_->depth, GL_TEXTURE_2D);
    bind(kAreaCompare, area_maps_->depth, GL_TEXTURE_2D);
    gl_.BindSampler(kAreaCompare, compare_sampler_);
  }
  begin(*area_maps_, true);
  gl_.Clear(GL_DEPTH_BUFFER_BIT);
  programs_->depth.use();
  for (std::size_t i = 0; i < std::min(view.area_lights.size(), kAreaLights); ++i) {
    maps.push_back(fit_area_map(view.area_lights[i], list_.vertices, kAreaMapSize));
    if (maps.back().extent.z() == 0.0F) continue;
    gl_.Viewport(static_cast<int>(i & 1) * kAreaMapSize, static_cast<int>(i >> 1) * kAreaMapSize, kAreaMapSize, kAreaMapSize);
    programs_->depth.set("to_clip", maps.back().to_clip);
    draw_items(items, false);
  }
  return maps;
}

GlRenderer::Shot GlRenderer::draw(const LocalView& local, std::span<const Item> items) {
  const View& view = local.view;
  pattern_origin_ = local.pattern_origin;
  {
    const CpuClock clock(times_.upload);
    pack(items, local.space, list_);
  }
  painted_ = !list_.paint.empty();
  if (painted_) make_painting();
  Shot shot;
  shot.camera = camera_matrices(view.camera, static_cast<double>(settings_.width) / settings_.height, list_.bounds);
  shot.radius = static_cast<float>(kOcclusionRadius * shot.camera.distance);

  gl_.Disable(GL_BLEND);
  gl_.Disable(GL_DITHER);
  gl_.DepthFunc(GL_LEQUAL);
  gl_.Enable(GL_CULL_FACE);
  gl_.CullFace(GL_BACK);

  // Maps cover the surroundings of the picture; a distant item does not make them coarser.
  const Vec3 reach = Vec3::Constant(kRegion * shot.camera.distance);
  const Box region = list_.bounds.intersection({-reach, reach});
  const bool has_items = !list_.indices.empty();
  const bool has_region = has_items && !region.empty();
  {
    const CpuClock clock(times_.upload);
    upload(view, items);
  }
  const CpuClock clock(times_.draw);

  // The side of a closed surface that faces the light is all of its shadow.
  if (std::any_of(items.begin(), items.end(), [](const Item& item) { return item.two_sided; })) gl_.Disable(GL_CULL_FACE);
  if (has_region && settings_.shadow_size > 0 && view.light.intensity > 0.0) {
    shot.shadow = fit_map(region, view.light.direction, settings_.shadow_size);
    draw_shadow_map(*shot.shadow, items);
    shot.glass = std::any_of(items.begin(), items.end(), is_glass);
    if (shot.glass) draw_glass_maps(*shot.shadow, view.light, items);
  }
  if (!view.area_lights.empty()) shot.area = draw_area_maps(view, items);
  if (has_region && view.ground) {
    const double ground = view.ground->height;
    const double above = region.upper.z() - ground;
    if (above > 0.0) {
      const double margin = std::min(1.5 * above, 0.5 * kRegion * shot.camera.distance);
      const double half = 0.5 * std::max(region.extent().x(), region.extent().y()) + margin;
      const Vec3 spread(half, half, 0.5 * region.extent().z());
      shot.heights = fit_map({region.centre() - spread, region.centre() + spread}, Vec3(0, 0, -1), kHeightMapSize);
      draw_ground_occlusion(*shot.heights, static_cast<float>(ground));
    }
  }
  gl_.Enable(GL_CULL_FACE);

  draw_geometry(shot.camera, items);
  if (has_items) draw_screen_occlusion(shot.camera, view, shot.radius);
  draw_picture(output_, light_programs(lighting(view, items, false)), shot, view);
  gl_.Finish();
  return shot;
}

Image GlRenderer::render(const View& view, std::span<const Item> items, LinearImage* linear) {
  SUPPLE_EXPECTS(view.light.direction.norm() > 0.0);
  const CurrentContext current(*context_);
  const LocalView local = localised(view, items);
  const Shot shot = draw(local, items);
  Image image;
  {
    const CpuClock clock(times_.read_back);
    image = read_back();
  }
  if (linear == nullptr) return image;
  {
    const CpuClock clock(times_.draw);
    gl_.ActiveTexture(GL_TEXTURE0 + kUploads);
    if (!linear_) linear_ = make_target(gl_, settings_.width, settings_.height, {.colour = GL_RGBA32F, .depth = true});
    draw_picture(*linear_, light_programs(lighting(view, items, true)), shot, local.view);
    gl_.Finish();
  }
  const CpuClock clock(times_.read_back);
  read_linear(*linear);
  return image;
}

}  // namespace supple::render
