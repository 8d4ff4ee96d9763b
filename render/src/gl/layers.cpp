#include "supple/render/layers.h"

#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "gl/gl.h"
#include "gl/shader_parts.h"
#include "picture/draw_list.h"
#include "supple/core/error.h"

namespace supple::render {
namespace {

const char* const kVertex = R"(
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 velocity;
uniform mat4 to_clip;
uniform mat4 view;
out vec3 world_normal;
out vec3 surface_velocity;
out float depth;
void main() {
  world_normal = normal;
  surface_velocity = velocity;
  depth = -(view * vec4(position, 1.0)).z;
  gl_Position = to_clip * vec4(position, 1.0);
})";

const char* const kFragment = R"(
in vec3 world_normal;
in vec3 surface_velocity;
in float depth;
uniform int id;
layout(location = 0) out vec4 normal_and_depth;
layout(location = 1) out vec4 velocity_and_id;
void main() {
  vec3 n = normalize(world_normal);
  normal_and_depth = vec4(gl_FrontFacing ? n : -n, depth);
  velocity_and_id = vec4(surface_velocity, float(id));
})";

constexpr std::array<const char*, 3> kVelocity = {"velocity_x", "velocity_y", "velocity_z"};

/// Velocities of all vertices in the order of the draw list, 0 where a mesh has none.
std::vector<float> velocities(std::span<const Item> items) {
  std::vector<float> out;
  for (const Item& item : items) {
    const Mesh& mesh = *item.mesh;
    if (mesh.triangle.empty()) continue;
    const std::size_t first = out.size();
    out.resize(first + 3 * mesh.vertex_count(), 0.0F);
    for (const Mesh::Column& column : mesh.columns) {
      for (std::size_t k = 0; k < 3; ++k) {
        if (column.name != kVelocity[k]) continue;
        for (std::size_t i = 0; i < mesh.vertex_count(); ++i) out[first + 3 * i + k] = static_cast<float>(column.values[i]);
      }
    }
  }
  return out;
}

/// Numbers of items are floats on their way.
constexpr std::size_t kMostItems = std::size_t{1} << 24;

class GlLayerRenderer final : public LayerRenderer {
 public:
  explicit GlLayerRenderer(const RenderSettings& settings)
      : width_(settings.width),
        height_(settings.height),
        context_(make_gl_context(settings.context)),
        current_(std::make_unique<CurrentContext>(*context_)),
        gl_(*context_),
        program_(gl_, std::string(shaders::kVersion) + kVertex, std::string(shaders::kVersion) + kFragment),
        first_(make_target(gl_, width_, height_, {.colour = GL_RGBA32F, .depth = true})),
        second_(add_colour(gl_, first_, {.colour = GL_RGBA32F})) {
    gl_.GenVertexArrays(1, &array_);
    gl_.GenBuffers(1, &vertices_);
    gl_.GenBuffers(1, &velocities_);
    gl_.GenBuffers(1, &indices_);
    gl_.BindVertexArray(array_);
    gl_.BindBuffer(GL_ELEMENT_ARRAY_BUFFER, indices_);
    for (GLuint attribute = 0; attribute < 3; ++attribute) {
      const GLsizei stride = (attribute < 2 ? 6 : 3) * static_cast<GLsizei>(sizeof(float));
      gl_.BindBuffer(GL_ARRAY_BUFFER, attribute < 2 ? vertices_ : velocities_);
      gl_.EnableVertexAttribArray(attribute);
      gl_.VertexAttribPointer(attribute, 3, GL_FLOAT, GL_FALSE, stride,
                              reinterpret_cast<const void*>(attribute == 1 ? 3 * sizeof(float) : 0));
    }
    current_.reset();
  }

  Layers render(const View& view, std::span<const Item> items) override {
    SUPPLE_EXPECTS(items.size() < kMostItems);
    const CurrentContext current(*context_);
    const LocalView local = localised(view, items);
    pack(items, local.space, list_);
    const CameraMatrices camera = camera_matrices(local.view.camera, static_cast<double>(width_) / height_, list_.bounds);
    draw(camera, items);
    Layers layers = read_back();
    if (view.ground) add_ground(local.view, camera, static_cast<std::uint32_t>(items.size() + 1), layers);
    for (float& depth : layers.depth) depth = static_cast<float>(depth / local.space.per_metre);
    return layers;
  }

 private:
  template <class T>
  void upload(GLenum kind, GLuint buffer, const std::vector<T>& values) const {
    gl_.BindBuffer(kind, buffer);
    gl_.BufferData(kind, static_cast<GLsizeiptr>(values.size() * sizeof(T)), values.data(), GL_STREAM_DRAW);
  }

  void draw(const CameraMatrices& camera, std::span<const Item> items) const {
    gl_.BindVertexArray(array_);
    upload(GL_ARRAY_BUFFER, vertices_, list_.vertices);
    upload(GL_ARRAY_BUFFER, velocities_, velocities(items));
    upload(GL_ELEMENT_ARRAY_BUFFER, indices_, list_.indices);
    gl_.BindFramebuffer(GL_FRAMEBUFFER, second_.framebuffer);
    gl_.Viewport(0, 0, width_, height_);
    gl_.Disable(GL_BLEND);
    gl_.Disable(GL_DITHER);
    gl_.Enable(GL_DEPTH_TEST);
    gl_.ClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);  // depths are largest at the near plane
    gl_.DepthFunc(GL_GEQUAL);
    gl_.ClearDepth(0.0);
    gl_.CullFace(GL_BACK);
    gl_.ClearColor(0.0F, 0.0F, 0.0F, 0.0F);
    gl_.Clear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
    program_.use();
    program_.set("to_clip", camera.view_projection);
    program_.set("view", camera.view);
    for (const DrawRange& range : list_.ranges) {
      if (items[range.item].two_sided) {
        gl_.Disable(GL_CULL_FACE);
      } else {
        gl_.Enable(GL_CULL_FACE);
      }
      program_.set("id", static_cast<int>(range.item + 1));
      gl_.DrawElements(GL_TRIANGLES, static_cast<GLsizei>(range.count), GL_UNSIGNED_INT,
                       reinterpret_cast<const void*>(range.first * sizeof(std::uint32_t)));
    }
    gl_.Finish();
  }

  [[nodiscard]] Layers read_back() const {
    const std::size_t count = static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
    std::array<std::vector<float>, 2> rgba;
    for (std::size_t k = 0; k < 2; ++k) {
      rgba[k].resize(4 * count);
      gl_.ReadBuffer(k == 0 ? GL_COLOR_ATTACHMENT0 : GL_COLOR_ATTACHMENT1);
      gl_.ReadPixels(0, 0, width_, height_, GL_RGBA, GL_FLOAT, rgba[k].data());
    }
    if (const GLenum code = gl_.GetError(); code != GL_NO_ERROR) {
      throw Error(code == GL_OUT_OF_MEMORY ? ErrorKind::Limit : ErrorKind::Internal,
                  Fault{.place = "render",
                        .key = {},
                        .expected = "OpenGL reports error " + std::to_string(code),
                        .found = {},
                        .hint = {}});
    }
    Layers out{.width = width_, .height = height_, .depth = {}, .normal = {}, .velocity = {}, .object = {}};
    out.depth.assign(count, std::numeric_limits<float>::infinity());
    out.normal.assign(3 * count, 0.0F);
    out.velocity.assign(3 * count, 0.0F);
    out.object.assign(count, 0);
    const auto columns = static_cast<std::size_t>(width_);
    for (std::size_t pixel = 0; pixel < count; ++pixel) {
      const std::size_t from = 4 * ((static_cast<std::size_t>(height_) - 1 - pixel / columns) * columns + pixel % columns);
      const float id = rgba[1][from + 3];
      if (id == 0.0F) continue;
      out.object[pixel] = static_cast<std::uint32_t>(id);
      out.depth[pixel] = rgba[0][from + 3];
      for (std::size_t k = 0; k < 3; ++k) {
        out.normal[3 * pixel + k] = rgba[0][from + k];
        out.velocity[3 * pixel + k] = rgba[1][from + k];
      }
    }
    return out;
  }

  /// The ground is a plane, seen where nothing is before it.
  void add_ground(const View& view, const CameraMatrices& camera, std::uint32_t id, Layers& out) const {
    const double eye_height = view.camera.from.z() - view.ground->height;
    for (std::size_t pixel = 0; pixel < out.depth.size(); ++pixel) {
      const auto x = static_cast<double>(pixel % static_cast<std::size_t>(width_));
      const auto y = static_cast<double>(pixel / static_cast<std::size_t>(width_));
      const Eigen::Vector3f ray(static_cast<float>(2.0 * (x + 0.5) / width_ - 1.0) * camera.half_extent.x(),
                                static_cast<float>(1.0 - 2.0 * (y + 0.5) / height_) * camera.half_extent.y(), -1.0F);
      const double slope = camera.view.block<3, 1>(0, 2).cast<double>().dot(ray.cast<double>());
      const double depth = -eye_height / slope;
      if (!(depth > 0.0 && depth < out.depth[pixel])) continue;
      out.depth[pixel] = static_cast<float>(depth);
      out.object[pixel] = id;
      for (std::size_t k = 0; k < 3; ++k) out.normal[3 * pixel + k] = out.velocity[3 * pixel + k] = 0.0F;
      out.normal[3 * pixel + 2] = eye_height > 0.0 ? 1.0F : -1.0F;
    }
  }

  int width_;
  int height_;
  std::unique_ptr<GlContext> context_;
  std::unique_ptr<CurrentContext> current_;  // while the members below are made
  Gl gl_;
  Program program_;
  Target first_;
  Target second_;
  GLuint array_ = 0;
  GLuint vertices_ = 0;
  GLuint velocities_ = 0;
  GLuint indices_ = 0;
  DrawList list_;
};

}  // namespace

std::unique_ptr<LayerRenderer> make_layer_renderer(const RenderSettings& settings) {
  SUPPLE_EXPECTS(settings.width > 0 && settings.height > 0);
  return std::make_unique<GlLayerRenderer>(settings);
}

}  // namespace supple::render
