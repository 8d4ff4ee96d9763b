/// @file gl_renderer.h
/// The renderer by OpenGL: its targets, programs and passes, in the order of one picture.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "gl/gl.h"
#include "gl/shaders.h"
#include "picture/draw_list.h"
#include "picture/lighting.h"
#include "supple/render/renderer.h"

namespace supple::render {

// Texture units: one for each map, for the lifetime of the context.
enum Unit : int {
  kShadowDepth, kShadowCompare, kHeights, kGroundOcclusion, kGeometry, kDepths, kOcclusion, kBlurred, kMaterials,
  kPaints, kPicture, kColourMaps, kAreaDepth, kAreaCompare, kGroundPicture, kGlassDepth, kGlassPassed, kUploads
};
inline constexpr int kHeightMapSize = 256;
inline constexpr int kGroundOcclusionSize = 96, kSmallGroundOcclusionSize = 48;  // with shadow maps of small pictures
// Materials lie in double rows of this many items; the shader uses the constants 4095 and 12.
inline constexpr std::size_t kMaterialRow = 4096;
// Of the ids of the geometry buffer; the shaders use the constant 0x40000000.
inline constexpr int kFixedId = 1 << 30;
inline constexpr std::size_t kAreaLights = 4;
inline constexpr int kAreaMapSize = 1024;  // of each of the four, two by two

class GlRenderer final : public Renderer {
 public:
  explicit GlRenderer(const RenderSettings& settings);
  using Renderer::render;
  Image render(const View& view, std::span<const Item> items, LinearImage* linear) override;
  [[nodiscard]] std::string description() const override { return description_; }
  [[nodiscard]] RenderTimes times() const override { return times_; }

 private:
  struct Programs;
  /// Programs and textures for painted items, made with the first of them.
  struct Painting {
    Painting(const Gl& gl, const Target& geometry, int samples);
    Program geometry;
    Target target;
    GLuint buffer = 0;
    GLuint maps = 0;
  };
  /// Program and maps for what glass lets through from the sun, made with the first glass.
  struct Glass {
    Glass(const Gl& gl, int map_size);
    Program passed;
    Target nearest;  // depth of the first glass along the light
    Target light;    // share of the light that comes through all of it
  };
  struct LightPrograms;
  /// Data for drawing the lit picture again.
  struct Shot {
    CameraMatrices camera;
    std::optional<MapFit> shadow;
    bool glass = false;  // stands in the shadow map
    std::optional<MapFit> heights;
    std::vector<AreaMap> area;  // of each area light
    float radius = 0.0F;        // of ambient occlusion
  };

  void make_targets();
  void make_vertex_arrays();
  void bind_textures();
  void bind(int unit, GLuint texture, GLenum kind) const;
  void make_painting();
  void prime();
  void upload(const View& view, std::span<const Item> items);
  void upload_materials(std::span<const Item> items);
  void upload_pictures(const View& view, std::span<const Item> items);
  [[nodiscard]] shaders::Lighting lighting(const View& view, std::span<const Item> items, bool scene_linear) const;
  [[nodiscard]] const LightPrograms& light_programs(const shaders::Lighting& lighting);
  void draw_range(const DrawRange& range) const;
  void draw_items(std::span<const Item> items, bool glass) const;
  void draw_cover() const;
  void begin(const Target& target, bool depth) const;
  void begin_geometry(const Target& target) const;
  void end_geometry() const;

  [[nodiscard]] Shot draw(const LocalView& local, std::span<const Item> items);
  [[nodiscard]] std::vector<AreaMap> draw_area_maps(const View& view, std::span<const Item> items);
  void draw_shadow_map(const MapFit& fit, std::span<const Item> items) const;
  void draw_glass_maps(const MapFit& fit, const Light& light, std::span<const Item> items);
  void draw_ground_occlusion(const MapFit& fit, float ground_height);
  void draw_geometry(const CameraMatrices& camera, std::span<const Item> items) const;
  void draw_painted_geometry(const CameraMatrices& camera, std::span<const Item> items) const;
  void draw_wires(const DrawRange& range, const Item& item) const;
  void set_paint(const Program& program, const Item& item) const;
  void set_cover(const Item& item, std::size_t index) const;
  void draw_screen_occlusion(const CameraMatrices& camera, const View& view, float radius) const;
  void draw_picture(const Target& target, const LightPrograms& programs, const Shot& shot, const View& view) const;
  void set_geometry(const Program& program, const CameraMatrices& camera, const View& view) const;
  void set_background(const Program& program, const View& view) const;
  void set_light(const Program& program, const Shot& shot, const View& view) const;
  void set_area_lights(const Program& program, const Shot& shot, const View& view) const;
  void set_ground(const Program& program, const View& view) const;
  [[nodiscard]] Image read_back();
  void read_linear(LinearImage& image);
  void check_error() const;

  RenderSettings settings_;
  RenderTimes times_;
  std::unique_ptr<GlContext> context_;
  std::unique_ptr<CurrentContext> current_;  // while the members below are made
  Gl gl_;
  int samples_;
  std::vector<Eigen::Vector2f> sample_at_;  // of the geometry buffer, within a pixel
  std::string description_;
  std::unique_ptr<Programs> programs_;
  std::unique_ptr<Painting> painting_;
  std::unique_ptr<Glass> glass_;
  std::map<shaders::Lighting, std::unique_ptr<LightPrograms>> light_programs_;
  std::map<std::shared_ptr<const Image>, GLuint> pictures_;  // those that the last picture showed
  bool painted_ = false;  // the items of this picture
  bool priming_ = false;

  Target shadow_;
  Target ground_occlusion_;
  Target geometry_;
  Target occlusion_;
  Target blurred_;
  Target output_;
  std::optional<Target> linear_;     // made for the first scene-linear picture
  std::optional<Target> area_maps_;  // and for the first one with area lights
  GLuint item_array_ = 0;
  GLuint empty_array_ = 0;
  GLuint vertex_buffer_ = 0;
  GLuint index_buffer_ = 0;
  GLuint materials_ = 0;
  GLuint heights_ = 0;
  GLuint compare_sampler_ = 0;
  DrawList list_;
  Vec3 pattern_origin_ = Vec3::Zero();  // of the ground
  std::vector<float> material_values_;
  std::vector<float> height_values_;
  std::vector<std::uint8_t> rgba_;

 public:
  ~GlRenderer() override;
};

struct GlRenderer::Programs {
  Programs(const Gl& gl, int samples);
  Program depth;
  Program ground_occlusion;
  Program geometry;
  Program occlusion;
  Program blur;
};

struct GlRenderer::LightPrograms {
  LightPrograms(const Gl& gl, const shaders::Lighting& lighting);
  Program classify;
  Program ground;
  Program items;
};

/// Of an item in the geometry buffer.
[[nodiscard]] inline int geometry_id(const Item& item, std::size_t index) { return static_cast<int>(index + 1) | (item.fixed ? kFixedId : 0); }

[[nodiscard]] std::unique_ptr<Renderer> make_gl_renderer(const RenderSettings& settings);

}  // namespace supple::render
