#include <algorithm>

#include "gl/gl_renderer.h"
#include "gl/shaders.h"
#include "image/process_time.h"

namespace supple::render {

GlRenderer::Programs::Programs(const Gl& gl, int samples)
    : depth(gl, shaders::position_only(), shaders::nothing()),
      ground_occlusion(gl, shaders::whole_picture(), shaders::ground_occlusion()),
      geometry(gl, shaders::surface(), shaders::geometry()),
      occlusion(gl, shaders::whole_picture(), shaders::screen_occlusion(samples)),
      blur(gl, shaders::whole_picture(), shaders::occlusion_blur()) {}

GlRenderer::Glass::Glass(const Gl& gl, int map_size)
    : passed(gl, shaders::surface(), shaders::passed_by_glass()),
      nearest(make_target(gl, map_size, map_size, {.colour = 0, .depth = true})),
      light(make_target(gl, map_size, map_size, {.colour = GL_RGBA8})) {}

GlRenderer::LightPrograms::LightPrograms(const Gl& gl, const shaders::Lighting& lighting)
    : classify(gl, shaders::whole_picture(), shaders::classify(lighting)),
      ground(gl, shaders::whole_picture(), shaders::lit_ground(lighting)),
      items(gl, shaders::whole_picture(), shaders::lit_items(lighting)) {}

shaders::Lighting GlRenderer::lighting(const View& view, std::span<const Item> items, bool scene_linear) const {
  return {.samples = samples_,
          .painted = painted_,
          .area_lights = !view.area_lights.empty(),
          .ground_paint = view.ground && view.ground->paint.kind != PaintKind::Plain,
          .inside = std::any_of(items.begin(), items.end(), [](const Item& item) { return item.inside.kind != InsideKind::Opaque; }),
          .scene_linear = scene_linear};
}

const GlRenderer::LightPrograms& GlRenderer::light_programs(const shaders::Lighting& lighting) {
  std::unique_ptr<LightPrograms>& programs = light_programs_[lighting];
  if (!programs) programs = std::make_unique<LightPrograms>(gl_, lighting);
  return *programs;
}

GlRenderer::GlRenderer(const RenderSettings& settings)
    : settings_(settings),
      times_{.context = -process_cpu_seconds()},
      context_(make_gl_context(settings.context)),
      current_(std::make_unique<CurrentContext>(*context_)),
      gl_(*context_),
      samples_(std::min(settings.samples, std::max(1, gl_.integer(GL_MAX_SAMPLES)))),
      description_(context_->name() + ", " + gl_.text(GL_RENDERER) + ", OpenGL " +
                   std::to_string(gl_.integer(GL_MAJOR_VERSION)) + '.' +
                   std::to_string(gl_.integer(GL_MINOR_VERSION))) {
  times_.context += process_cpu_seconds();
  const CpuClock clock(times_.shaders);
  programs_ = std::make_unique<Programs>(gl_, samples_);
  make_targets();
  make_vertex_arrays();
  bind_textures();
  prime();
  current_.reset();
}

GlRenderer::~GlRenderer() = default;

/// A software driver compiles a program when its first pixel is drawn: one triangle in a picture of one pixel.
void GlRenderer::prime() {
  Mesh mesh;
  mesh.position = {Vec3(-1, 0, -1), Vec3(1, 0, -1), Vec3(0, 0, 1)};
  mesh.normal.assign(3, Vec3(0, -1, 0));
  mesh.triangle = {{0, 1, 2}};
  const std::array<Item, 2> items = {Item{.mesh = &mesh}, Item{.mesh = &mesh}};
  View view;
  view.camera = {.from = Vec3(0, -4, 0), .look_at = Vec3::Zero()};
  view.ground = Ground{.height = -0.5};
  priming_ = true;
  static_cast<void>(draw(localised(view, items), items));
  priming_ = false;
}

void GlRenderer::make_targets() {
  const int width = settings_.width;
  const int height = settings_.height;
  const int half_width = (width + 1) / 2;
  const int half_height = (height + 1) / 2;
  const int shadow_size = std::max(1, settings_.shadow_size);
  shadow_ = make_target(gl_, shadow_size, shadow_size, {.colour = 0, .depth = true});
  constexpr int kSmallShadowMap = 512;
  const bool small = settings_.shadow_size > 0 && settings_.shadow_size <= kSmallShadowMap;
  const int occlusion_size = small ? kSmallGroundOcclusionSize : kGroundOcclusionSize;
  ground_occlusion_ = make_target(gl_, occlusion_size, occlusion_size, {.colour = GL_R32F, .filter = GL_LINEAR});
  geometry_ = make_target(gl_, width, height, {.colour = GL_RG32UI, .depth = true, .samples = samples_});
  sample_at_.assign(static_cast<std::size_t>(samples_), Eigen::Vector2f::Constant(0.5F));
  for (std::size_t s = 0; samples_ > 1 && s < sample_at_.size(); ++s) gl_.GetMultisamplefv(GL_SAMPLE_POSITION, static_cast<GLuint>(s), sample_at_[s].data());
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

void GlRenderer::bind(int unit, GLuint texture, GLenum kind) const {
  gl_.ActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
  gl_.BindTexture(kind, texture);
}

void GlRenderer::bind_textures() {
  bind(kShadowDepth, shadow_.depth, GL_TEXTURE_2D);
  bind(kShadowCompare, shadow_.depth, GL_TEXTURE_2D);
  bind(kGroundOcclusion, ground_occlusion_.colour, GL_TEXTURE_2D);
  const GLenum kind = samples_ > 1 ? GL_TEXTURE_2D_MULTISAMPLE : GL_TEXTURE_2D;
  bind(kGeometry, geometry_.colour, kind);
  bind(kDepths, geometry_.depth, kind);
  bind(kOcclusion, occlusion_.colour, GL_TEXTURE_2D);
  bind(kBlurred, blurred_.colour, GL_TEXTURE_2D);
  const auto make_table = [this](int unit, GLuint& texture) {
    gl_.GenTextures(1, &texture);
    bind(unit, texture, GL_TEXTURE_2D);
    gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  };
  make_table(kMaterials, materials_);
  make_table(kHeights, heights_);
  gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);

  // The shadow map is read twice: as numbers, and as comparisons filtered over two by two texels.
  gl_.GenSamplers(1, &compare_sampler_);
  gl_.SamplerParameteri(compare_sampler_, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  gl_.SamplerParameteri(compare_sampler_, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  gl_.SamplerParameteri(compare_sampler_, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  gl_.SamplerParameteri(compare_sampler_, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  gl_.SamplerParameteri(compare_sampler_, GL_TEXTURE_COMPARE_MODE, GL_COMPARE_REF_TO_TEXTURE);
  gl_.SamplerParameteri(compare_sampler_, GL_TEXTURE_COMPARE_FUNC, GL_LEQUAL);
  gl_.BindSampler(kShadowCompare, compare_sampler_);
}

void GlRenderer::upload(const View& view, std::span<const Item> items) {
  upload_pictures(view, items);
  if (list_.indices.empty()) return;
  gl_.BindVertexArray(item_array_);
  gl_.BindBuffer(GL_ARRAY_BUFFER, vertex_buffer_);
  gl_.BufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(list_.vertices.size() * sizeof(float)),
                 list_.vertices.data(), GL_STREAM_DRAW);
  gl_.BufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(list_.indices.size() * sizeof(std::uint32_t)),
                 list_.indices.data(), GL_STREAM_DRAW);
  upload_materials(items);
  if (!painted_) return;
  gl_.BindVertexArray(item_array_);
  gl_.BindBuffer(GL_ARRAY_BUFFER, painting_->buffer);
  gl_.BufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(list_.paint.size() * sizeof(float)), list_.paint.data(),
                 GL_STREAM_DRAW);
}

namespace {

double least_extent(const Item& item) {
  Box box;
  for (const Vec3& p : item.mesh->position) box.include(p);
  return box.empty() ? 0.0 : box.extent().minCoeff();
}

/// For the shaders: -index of glass; above 0, mean free path over half the least extent of what scatters.
float inside_number(const Item& item) {
  constexpr double kMost = 4.0;
  if (item.inside.kind == InsideKind::Opaque) return 0.0F;
  if (item.inside.kind == InsideKind::Glass) return static_cast<float>(-item.inside.index);
  const double half = 0.5 * least_extent(item);
  return static_cast<float>(half > 0.0 ? std::min(item.inside.depth / half, kMost) : kMost);
}

/// Its colour, or what glass lets through along its least extent.
Eigen::Vector3f shown_colour(const Item& item) {
  const Eigen::Vector3f colour = linear_colour(item.colour);
  if (item.inside.kind != InsideKind::Glass) return colour;
  if (!(item.inside.depth > 0.0)) return Eigen::Vector3f::Ones();
  return colour.cwiseMax(1e-3F).array().pow(static_cast<float>(least_extent(item) / item.inside.depth)).matrix();
}

}  // namespace

void GlRenderer::draw_glass_maps(const MapFit& fit, const Light& light, std::span<const Item> items) {
  if (!glass_) {
    gl_.ActiveTexture(GL_TEXTURE0 + kUploads);
    glass_ = std::make_unique<Glass>(gl_, shadow_.width);
    bind(kGlassDepth, glass_->nearest.depth, GL_TEXTURE_2D);
    bind(kGlassPassed, glass_->light.colour, GL_TEXTURE_2D);
  }
  begin(glass_->nearest, true);
  gl_.Clear(GL_DEPTH_BUFFER_BIT);
  programs_->depth.use();
  programs_->depth.set("to_clip", fit.to_clip);
  draw_items(items, true);

  begin(glass_->light, false);
  gl_.ClearColor(1.0F, 1.0F, 1.0F, 1.0F);
  gl_.Clear(GL_COLOR_BUFFER_BIT);
  gl_.Disable(GL_CULL_FACE);
  gl_.Enable(GL_BLEND);
  gl_.BlendFunc(GL_DST_COLOR, GL_ZERO);  // faces multiply
  glass_->passed.use();
  glass_->passed.set("to_clip", fit.to_clip);
  glass_->passed.set("to_light", Eigen::Vector3f(-light.direction.normalized().cast<float>()));
  gl_.BindVertexArray(item_array_);
  for (const DrawRange& range : list_.ranges) {
    const Item& item = items[range.item];
    if (item.inside.kind != InsideKind::Glass) continue;
    const double share = (item.inside.index - 1.0) / (item.inside.index + 1.0);
    glass_->passed.set("tint", shown_colour(item));
    glass_->passed.set("reflectance", static_cast<float>(share * share));
    draw_range(range);
  }
  gl_.Disable(GL_BLEND);
}

void GlRenderer::upload_materials(std::span<const Item> items) {
  const std::size_t columns = std::min(items.size(), kMaterialRow);
  const std::size_t rows = 2 * ((items.size() + columns - 1) / columns);
  material_values_.assign(4 * columns * rows, 0.0F);
  for (std::size_t i = 0; i < items.size(); ++i) {
    float* out = &material_values_[4 * (i % kMaterialRow + 2 * columns * (i / kMaterialRow))];
    const Eigen::Vector3f albedo = shown_colour(items[i]);
    for (int k = 0; k < 3; ++k) out[k] = albedo[k];
    out[3] = static_cast<float>(std::clamp(items[i].roughness, 0.02, 1.0));
    out[4 * columns] = static_cast<float>(std::clamp(items[i].metallic, 0.0, 1.0));
    out[4 * columns + 1] = is_painted(items[i]) ? 1.0F : 0.0F;
    out[4 * columns + 2] = static_cast<float>(std::clamp(items[i].reflectance, 0.0, 1.0));
    out[4 * columns + 3] = inside_number(items[i]);
  }
  gl_.ActiveTexture(GL_TEXTURE0 + kMaterials);
  gl_.TexImage2D(GL_TEXTURE_2D, 0, GL_RGBA32F, static_cast<GLsizei>(columns), static_cast<GLsizei>(rows), 0, GL_RGBA,
                 GL_FLOAT, material_values_.data());
}

std::unique_ptr<Renderer> make_gl_renderer(const RenderSettings& settings) {
  return std::make_unique<GlRenderer>(settings);
}

}  // namespace supple::render
