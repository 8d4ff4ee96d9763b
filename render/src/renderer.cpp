#include "supple/render/renderer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "draw_list.h"
#include "gl.h"
#include "shaders.h"
#include "supple/core/error.h"

namespace supple::render {
namespace {

constexpr int kHeightMapSize = 256;
constexpr int kGroundOcclusionSize = 96;
constexpr float kExposure = 0.42F;
// Shares of the distance between camera and point looked at, so that a still camera gives still looks.
constexpr double kOcclusionRadius = 0.07;
constexpr double kRegion = 3.0;

// Texture units: one for each map, for the whole life of the context.
enum Unit : int {
  kShadowDepth, kShadowCompare, kHeights, kGroundOcclusion, kGeometry, kDepths, kOcclusion, kBlurred, kMaterials
};
// Materials lie in rows of this many items; the shader knows it as 4095 and 12.
constexpr std::size_t kMaterialRow = 4096;

void check_settings(const RenderSettings& settings) {
  const auto refuse = [](const char* key, const std::string& expected, const std::string& found) {
    throw Error(ErrorKind::Usage, Fault{.place = {}, .key = key, .expected = expected, .found = found, .hint = {}});
  };
  const auto check_size = [&refuse](const char* key, int value, int lowest) {
    if (value < lowest || value > 16384)
      refuse(key, "expected " + std::to_string(lowest) + " to 16384 pixels", std::to_string(value));
  };
  check_size("render.width", settings.width, 1);
  check_size("render.height", settings.height, 1);
  check_size("render.shadow_size", settings.shadow_size, 0);
  const int samples = settings.samples;
  if (samples != 1 && samples != 2 && samples != 4 && samples != 8)
    refuse("render.samples", "expected 1, 2, 4 or 8", std::to_string(samples));
  if (!(settings.shadow_softness >= 0.0 && settings.shadow_softness <= 0.5))
    refuse("render.shadow_softness", "expected an angle of 0 to 0.5 [rad]", std::to_string(settings.shadow_softness));
}

class GlRenderer final : public Renderer {
 public:
  explicit GlRenderer(const RenderSettings& settings)
      : settings_(settings),
        context_(make_gl_context(settings.context)),
        current_(std::make_unique<CurrentContext>(*context_)),
        gl_(*context_),
        samples_(std::min(settings.samples, std::max(1, gl_.integer(GL_MAX_SAMPLES)))),
        description_(context_->name() + ", " + gl_.text(GL_RENDERER) + ", OpenGL " +
                     std::to_string(gl_.integer(GL_MAJOR_VERSION)) + '.' +
                     std::to_string(gl_.integer(GL_MINOR_VERSION))),
        depth_program_(gl_, shaders::position_only(), shaders::nothing()),
        height_program_(gl_, shaders::position_only(), shaders::height_range()),
        ground_occlusion_program_(gl_, shaders::whole_picture(), shaders::ground_occlusion()),
        geometry_program_(gl_, shaders::surface(), shaders::geometry()),
        occlusion_program_(gl_, shaders::whole_picture(), shaders::screen_occlusion(samples_)),
        blur_program_(gl_, shaders::whole_picture(), shaders::occlusion_blur()),
        classify_program_(gl_, shaders::whole_picture(), shaders::classify(samples_)),
        ground_program_(gl_, shaders::whole_picture(), shaders::lit_ground()),
        item_program_(gl_, shaders::whole_picture(), shaders::lit_items(samples_)) {
    make_targets();
    make_vertex_arrays();
    bind_textures();
    current_.reset();
  }

  Image render(const View& view, std::span<const Item> items) override;
  std::string description() const override { return description_; }

 private:
  void make_targets();
  void make_vertex_arrays();
  void bind_textures();
  void upload(std::span<const Item> items);
  void draw_range(const DrawRange& range) const;
  void draw_all_items() const;
  void draw_cover() const;
  void begin(const Target& target, bool depth) const;

  void draw_shadow_map(const MapFit& fit) const;
  void draw_ground_occlusion(const MapFit& fit, float ground_height) const;
  void draw_geometry(const CameraMatrices& camera, std::span<const Item> items) const;
  void draw_screen_occlusion(const CameraMatrices& camera, const View& view, float radius) const;
  void draw_picture(const CameraMatrices& camera, const View& view, const MapFit* shadow, const MapFit* heights,
                    float radius) const;
  void set_geometry(const Program& program, const CameraMatrices& camera, const View& view) const;
  void set_background(const Program& program, const View& view) const;
  void set_light(const Program& program, const CameraMatrices& camera, const View& view, const MapFit* shadow,
                 const MapFit* heights) const;
  [[nodiscard]] Image read_back();

  RenderSettings settings_;
  std::unique_ptr<GlContext> context_;
  std::unique_ptr<CurrentContext> current_;  // while the members below are made
  Gl gl_;
  int samples_;
  std::string description_;
  Program depth_program_;
  Program height_program_;
  Program ground_occlusion_program_;
  Program geometry_program_;
  Program occlusion_program_;
  Program blur_program_;
  Program classify_program_;
  Program ground_program_;
  Program item_program_;

  Target shadow_;
  Target heights_;
  Target ground_occlusion_;
  Target geometry_;
  Target occlusion_;
  Target blurred_;
  Target output_;
  GLuint item_array_ = 0;
  GLuint empty_array_ = 0;
  GLuint vertex_buffer_ = 0;
  GLuint index_buffer_ = 0;
  GLuint materials_ = 0;
  DrawList list_;
  std::vector<float> material_values_;
  std::vector<std::uint8_t> rgba_;
};

void GlRenderer::make_targets() {
  const int width = settings_.width;
  const int height = settings_.height;
  const int half_width = (width + 1) / 2;
  const int half_height = (height + 1) / 2;
  const int shadow_size = std::max(1, settings_.shadow_size);
  shadow_ = make_target(gl_, shadow_size, shadow_size, {.colour = 0, .depth = true});
  heights_ = make_target(gl_, kHeightMapSize, kHeightMapSize, {.colour = GL_RG32F});
  ground_occlusion_ =
      make_target(gl_, kGroundOcclusionSize, kGroundOcclusionSize, {.colour = GL_R32F, .filter = GL_LINEAR});
  geometry_ = make_target(gl_, width, height, {.colour = GL_RG32UI, .depth = true, .samples = samples_});
  occlusion_ = make_target(gl_, half_width, half_height, {.colour = GL_RG32F});
  blurred_ = make_target(gl_, half_width, half_height, {.colour = GL_RG32F});
  output_ = make_target(gl_, width, height, {.colour = GL_RGBA8, .depth = true});
}

void GlRenderer::make_vertex_arrays() {
  gl_.GenVertexArrays(1, &item_array_);
  gl_.GenVertexArrays(1, &empty_array_);
  gl_.GenBuffers(1, &vertex_buffer_);
  gl_.GenBuffers(1, &index_buffer_);
  gl_.BindVertexArray(item_array_);
  gl_.BindBuffer(GL_ARRAY_BUFFER, vertex_buffer_);
  gl_.BindBuffer(GL_ELEMENT_ARRAY_BUFFER, index_buffer_);
  for (GLuint attribute = 0; attribute < 2; ++attribute) {
    gl_.EnableVertexAttribArray(attribute);
    gl_.VertexAttribPointer(attribute, 3, GL_FLOAT, GL_FALSE, 6 * sizeof(float),
                            reinterpret_cast<const void*>(attribute * 3 * sizeof(float)));
  }
  gl_.BindVertexArray(empty_array_);
}

void GlRenderer::bind_textures() {
  const auto bind = [this](int unit, GLuint texture, GLenum kind) {
    gl_.ActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
    gl_.BindTexture(kind, texture);
  };
  bind(kShadowDepth, shadow_.depth, GL_TEXTURE_2D);
  bind(kShadowCompare, shadow_.depth, GL_TEXTURE_2D);
  bind(kHeights, heights_.colour, GL_TEXTURE_2D);
  bind(kGroundOcclusion, ground_occlusion_.colour, GL_TEXTURE_2D);
  const GLenum kind = samples_ > 1 ? GL_TEXTURE_2D_MULTISAMPLE : GL_TEXTURE_2D;
  bind(kGeometry, geometry_.colour, kind);
  bind(kDepths, geometry_.depth, kind);
  bind(kOcclusion, occlusion_.colour, GL_TEXTURE_2D);
  bind(kBlurred, blurred_.colour, GL_TEXTURE_2D);
  gl_.GenTextures(1, &materials_);
  bind(kMaterials, materials_, GL_TEXTURE_2D);
  gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);

  // The shadow map is read twice: as numbers, and as comparisons filtered over two by two texels.
  GLuint sampler = 0;
  gl_.GenSamplers(1, &sampler);
  gl_.SamplerParameteri(sampler, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  gl_.SamplerParameteri(sampler, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  gl_.SamplerParameteri(sampler, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  gl_.SamplerParameteri(sampler, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  gl_.SamplerParameteri(sampler, GL_TEXTURE_COMPARE_MODE, GL_COMPARE_REF_TO_TEXTURE);
  gl_.SamplerParameteri(sampler, GL_TEXTURE_COMPARE_FUNC, GL_LEQUAL);
  gl_.BindSampler(kShadowCompare, sampler);
}

void GlRenderer::upload(std::span<const Item> items) {
  gl_.BindVertexArray(item_array_);
  gl_.BindBuffer(GL_ARRAY_BUFFER, vertex_buffer_);
  gl_.BufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(list_.vertices.size() * sizeof(float)),
                 list_.vertices.data(), GL_STREAM_DRAW);
  gl_.BufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(list_.indices.size() * sizeof(std::uint32_t)),
                 list_.indices.data(), GL_STREAM_DRAW);

  const std::size_t columns = std::min(items.size(), kMaterialRow);
  const std::size_t rows = (items.size() + columns - 1) / columns;
  material_values_.assign(4 * columns * rows, 0.0F);
  for (std::size_t i = 0; i < items.size(); ++i) {
    const Eigen::Vector3f albedo = linear_colour(items[i].colour);
    for (int k = 0; k < 3; ++k) material_values_[4 * i + static_cast<std::size_t>(k)] = albedo[k];
    material_values_[4 * i + 3] = static_cast<float>(std::clamp(items[i].roughness, 0.02, 1.0));
  }
  gl_.ActiveTexture(GL_TEXTURE0 + kMaterials);
  gl_.TexImage2D(GL_TEXTURE_2D, 0, GL_RGBA32F, static_cast<GLsizei>(columns), static_cast<GLsizei>(rows), 0, GL_RGBA,
                 GL_FLOAT, material_values_.data());
}

void GlRenderer::draw_range(const DrawRange& range) const {
  gl_.DrawElements(GL_TRIANGLES, static_cast<GLsizei>(range.count), GL_UNSIGNED_INT,
                   reinterpret_cast<const void*>(range.first * sizeof(std::uint32_t)));
}

void GlRenderer::draw_all_items() const {
  gl_.BindVertexArray(item_array_);
  draw_range({.first = 0, .count = list_.indices.size(), .item = 0});
}

void GlRenderer::draw_cover() const {
  gl_.BindVertexArray(empty_array_);
  gl_.DrawArrays(GL_TRIANGLES, 0, 3);
}

void GlRenderer::begin(const Target& target, bool depth) const {
  gl_.BindFramebuffer(GL_FRAMEBUFFER, target.framebuffer);
  gl_.Viewport(0, 0, target.width, target.height);
  if (depth)
    gl_.Enable(GL_DEPTH_TEST);
  else
    gl_.Disable(GL_DEPTH_TEST);
}

void GlRenderer::draw_shadow_map(const MapFit& fit) const {
  begin(shadow_, true);
  gl_.Clear(GL_DEPTH_BUFFER_BIT);
  depth_program_.use();
  depth_program_.set("to_clip", fit.to_clip);
  draw_all_items();
}

void GlRenderer::draw_ground_occlusion(const MapFit& fit, float ground_height) const {
  begin(heights_, false);
  gl_.ClearColor(-1e30F, -1e30F, 0.0F, 0.0F);
  gl_.Clear(GL_COLOR_BUFFER_BIT);
  gl_.Enable(GL_BLEND);
  gl_.BlendEquation(GL_MAX);
  height_program_.use();
  height_program_.set("to_clip", fit.to_clip);
  height_program_.set("ground_height", ground_height);
  draw_all_items();
  gl_.Disable(GL_BLEND);

  begin(ground_occlusion_, false);
  ground_occlusion_program_.use();
  ground_occlusion_program_.set("heights", kHeights);
  ground_occlusion_program_.set("map_size", fit.extent.x());
  ground_occlusion_program_.set("target_size", static_cast<float>(kGroundOcclusionSize));
  draw_cover();
}

void GlRenderer::draw_geometry(const CameraMatrices& camera, std::span<const Item> items) const {
  begin(geometry_, true);
  constexpr std::array<GLuint, 4> no_item{};
  gl_.ClearBufferuiv(GL_COLOR, 0, no_item.data());
  gl_.Clear(GL_DEPTH_BUFFER_BIT);
  geometry_program_.use();
  geometry_program_.set("to_clip", camera.view_projection);
  gl_.BindVertexArray(item_array_);
  for (const DrawRange& range : list_.ranges) {
    if (items[range.item].two_sided) gl_.Disable(GL_CULL_FACE);
    geometry_program_.set("id", static_cast<int>(range.item + 1));
    draw_range(range);
    gl_.Enable(GL_CULL_FACE);
  }
}

void GlRenderer::set_geometry(const Program& program, const CameraMatrices& camera, const View& view) const {
  program.set("geometry", kGeometry);
  program.set("depths", kDepths);
  program.set("half_extent", camera.half_extent);
  program.set("picture_size",
              Eigen::Vector2f(static_cast<float>(settings_.width), static_cast<float>(settings_.height)));
  program.set("depth_range", camera.depth_range);
  program.set("view", camera.view);
  program.set("eye_height", view.ground ? static_cast<float>(view.camera.from.z() - view.ground->height) : -1.0F);
}

void GlRenderer::draw_screen_occlusion(const CameraMatrices& camera, const View& view, float radius) const {
  begin(occlusion_, false);
  occlusion_program_.use();
  set_geometry(occlusion_program_, camera, view);
  occlusion_program_.set("radius", radius);
  draw_cover();

  begin(blurred_, false);
  blur_program_.use();
  blur_program_.set("occlusion", kOcclusion);
  blur_program_.set("radius", radius);
  blur_program_.set("nowhere", 2.0F * camera.depth_range.y());
  draw_cover();
}

void GlRenderer::set_background(const Program& program, const View& view) const {
  program.set("background_top", linear_colour(view.background_top));
  program.set("background_bottom", linear_colour(view.background_bottom));
}

void GlRenderer::set_light(const Program& program, const CameraMatrices& camera, const View& view,
                           const MapFit* shadow, const MapFit* heights) const {
  const Eigen::Vector3f to_light = -view.light.direction.normalized().cast<float>();
  const Eigen::Vector3f sun = static_cast<float>(view.light.intensity) * Eigen::Vector3f(1.0F, 0.965F, 0.91F);
  const Eigen::Vector3f sky(0.93F, 1.0F, 1.10F);
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
  program.set("shadow_texels", shadow == nullptr ? 0.0F : static_cast<float>(settings_.shadow_size));
  if (shadow != nullptr) {
    program.set("shadow_to_unit", shadow->to_unit);
    program.set("shadow_axes", shadow->axes);
    program.set("shadow_extent", shadow->extent);
  }
  program.set("eye", camera.eye);
  program.set("ground_albedo", linear_colour(view.ground ? view.ground->colour : Vec3(Vec3::Zero())));
  program.set("camera_distance", static_cast<float>(camera.distance));
  program.set("ground_visibility", kGroundOcclusion);
  program.set("ground_occluded", heights == nullptr ? 0.0F : 1.0F);
  if (heights != nullptr) program.set("ground_to_unit", heights->to_unit);
}

void GlRenderer::draw_picture(const CameraMatrices& camera, const View& view, const MapFit* shadow,
                              const MapFit* heights, float radius) const {
  begin(output_, true);
  gl_.DepthFunc(GL_ALWAYS);
  classify_program_.use();
  set_geometry(classify_program_, camera, view);
  set_background(classify_program_, view);
  draw_cover();
  gl_.DepthMask(GL_FALSE);

  // Between the depths that `classify` writes: .3 is behind the ground's .1 alone, .7 before the items' .9 alone.
  if (view.ground) {
    gl_.DepthFunc(GL_GREATER);
    ground_program_.use();
    ground_program_.set("plane", 2.0F * 0.3F - 1.0F);
    set_geometry(ground_program_, camera, view);
    set_background(ground_program_, view);
    set_light(ground_program_, camera, view, shadow, heights);
    draw_cover();
  }
  if (!list_.ranges.empty()) {
    gl_.DepthFunc(GL_LESS);
    item_program_.use();
    item_program_.set("plane", 2.0F * 0.7F - 1.0F);
    set_geometry(item_program_, camera, view);
    set_background(item_program_, view);
    set_light(item_program_, camera, view, shadow, heights);
    item_program_.set("materials", kMaterials);
    item_program_.set("occlusion", kBlurred);
    item_program_.set("occlusion_radius", radius);
    item_program_.set("contact_taps", list_.ranges.size() > 1 ? 8 : 0);
    draw_cover();
  }
  gl_.DepthMask(GL_TRUE);
  gl_.DepthFunc(GL_LEQUAL);
}

Image GlRenderer::read_back() {
  const auto width = static_cast<std::size_t>(settings_.width);
  const auto height = static_cast<std::size_t>(settings_.height);
  rgba_.resize(4 * width * height);
  gl_.PixelStorei(GL_PACK_ALIGNMENT, 4);
  gl_.ReadPixels(0, 0, settings_.width, settings_.height, GL_RGBA, GL_UNSIGNED_BYTE, rgba_.data());
  if (const GLenum code = gl_.GetError(); code != GL_NO_ERROR) {
    const bool memory = code == GL_OUT_OF_MEMORY;
    throw Error(memory ? ErrorKind::Limit : ErrorKind::Internal,
                Fault{.place = "render",
                      .key = {},
                      .expected = memory ? "the driver has no memory for the picture"
                                         : "OpenGL reports error " + std::to_string(code),
                      .found = {},
                      .hint = {}});
  }
  Image image{.width = settings_.width, .height = settings_.height, .pixels = {}};
  image.pixels.resize(3 * width * height);
  std::uint8_t* out = image.pixels.data();
  for (std::size_t y = 0; y < height; ++y) {
    const std::uint8_t* row = &rgba_[4 * width * (height - 1 - y)];
    for (std::size_t x = 0; x < width; ++x, out += 3) std::memcpy(out, row + 4 * x, 3);
  }
  return image;
}

Image GlRenderer::render(const View& view, std::span<const Item> items) {
  SUPPLE_EXPECTS(view.light.direction.norm() > 0.0);
  const CurrentContext current(*context_);
  const Vec3& origin = view.camera.look_at;
  pack(items, origin, list_);
  const CameraMatrices camera =
      camera_matrices(view.camera, static_cast<double>(settings_.width) / settings_.height, list_.bounds);

  gl_.Disable(GL_BLEND);
  gl_.Disable(GL_DITHER);
  gl_.DepthFunc(GL_LEQUAL);
  gl_.Enable(GL_CULL_FACE);
  gl_.CullFace(GL_BACK);

  // Maps cover what is near the picture; something that flew away does not coarsen them.
  const Vec3 reach = Vec3::Constant(kRegion * camera.distance);
  const Box region = list_.bounds.intersection({-reach, reach});
  const bool has_items = !list_.indices.empty();
  const bool has_region = has_items && !region.empty();
  if (has_items) upload(items);

  std::optional<MapFit> shadow;
  if (has_region && settings_.shadow_size > 0 && view.light.intensity > 0.0) {
    // The side of a closed surface that faces the light is all of its shadow.
    if (std::any_of(items.begin(), items.end(), [](const Item& item) { return item.two_sided; }))
      gl_.Disable(GL_CULL_FACE);
    shadow = fit_map(region, view.light.direction, settings_.shadow_size);
    draw_shadow_map(*shadow);
  }
  std::optional<MapFit> heights;
  gl_.Disable(GL_CULL_FACE);  // lowest and highest points are on different sides
  if (has_region && view.ground) {
    const double ground = view.ground->height - origin.z();
    const double above = region.upper.z() - ground;
    if (above > 0.0) {
      const double margin = std::min(1.5 * above, 0.5 * kRegion * camera.distance);
      const double half = 0.5 * std::max(region.extent().x(), region.extent().y()) + margin;
      const Vec3 spread(half, half, 0.5 * region.extent().z());
      heights = fit_map({region.centre() - spread, region.centre() + spread}, Vec3(0, 0, -1), kHeightMapSize);
      draw_ground_occlusion(*heights, static_cast<float>(ground));
    }
  }
  gl_.Enable(GL_CULL_FACE);

  const auto radius = static_cast<float>(kOcclusionRadius * camera.distance);
  draw_geometry(camera, items);
  if (has_items) draw_screen_occlusion(camera, view, radius);
  draw_picture(camera, view, shadow ? &*shadow : nullptr, heights ? &*heights : nullptr, radius);
  return read_back();
}

}  // namespace

std::unique_ptr<Renderer> make_renderer(const RenderSettings& settings) {
  check_settings(settings);
  return std::make_unique<GlRenderer>(settings);
}

}  // namespace supple::render
