#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "gl/gl_renderer.h"
#include "gl/shaders.h"
#include "image/process_time.h"

namespace supple::render {
namespace {

constexpr int kMapTexels = 256;

GLuint make_map_texture(const Gl& gl) {
  std::vector<float> rgb;
  for (std::size_t map = 0; map < kColourMapNames.size(); ++map)
    for (int i = 0; i < kMapTexels; ++i) {
      const Eigen::Vector3f c =
          linear_colour(colour_of(static_cast<ColourMap>(map), static_cast<double>(i) / (kMapTexels - 1)));
      rgb.insert(rgb.end(), c.data(), c.data() + 3);
    }
  GLuint texture = 0;
  gl.GenTextures(1, &texture);
  gl.ActiveTexture(GL_TEXTURE0 + kColourMaps);
  gl.BindTexture(GL_TEXTURE_2D, texture);
  gl.TexImage2D(GL_TEXTURE_2D, 0, GL_RGB32F, kMapTexels, static_cast<GLsizei>(kColourMapNames.size()), 0, GL_RGB, GL_FLOAT,
                rgb.data());
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  return texture;
}

GLuint make_picture_texture(const Gl& gl, const Image& image) {
  GLuint texture = 0;
  gl.GenTextures(1, &texture);
  gl.ActiveTexture(GL_TEXTURE0 + kUploads);
  gl.BindTexture(GL_TEXTURE_2D, texture);
  // Upside down, so that v grows upward.
  const std::size_t row = 3 * static_cast<std::size_t>(image.width);
  std::vector<std::uint8_t> flipped(image.pixels.size());
  for (std::size_t y = 0; y < static_cast<std::size_t>(image.height); ++y)
    std::copy_n(&image.pixels[row * y], row, &flipped[row * (static_cast<std::size_t>(image.height) - 1 - y)]);
  gl.PixelStorei(GL_UNPACK_ALIGNMENT, 1);
  gl.TexImage2D(GL_TEXTURE_2D, 0, GL_SRGB8, image.width, image.height, 0, GL_RGB, GL_UNSIGNED_BYTE, flipped.data());
  gl.PixelStorei(GL_UNPACK_ALIGNMENT, 4);
  gl.GenerateMipmap(GL_TEXTURE_2D);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR_MIPMAP_LINEAR);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  return texture;
}

}  // namespace

GlRenderer::Painting::Painting(const Gl& gl, const Target& first, int samples)
    : geometry(gl, shaders::painted_surface(), shaders::painted_geometry()),
      target(add_colour(gl, first, {.colour = GL_RGBA8, .samples = samples})),
      maps(make_map_texture(gl)) {
  gl.GenBuffers(1, &buffer);
}

void GlRenderer::make_painting() {
  if (painting_) return;
  const CpuClock clock(times_.shaders);
  gl_.ActiveTexture(GL_TEXTURE0 + kPaints);
  painting_ = std::make_unique<Painting>(gl_, geometry_, samples_);
  bind(kPaints, painting_->target.colour, samples_ > 1 ? GL_TEXTURE_2D_MULTISAMPLE : GL_TEXTURE_2D);
  gl_.BindVertexArray(item_array_);
  gl_.BindBuffer(GL_ARRAY_BUFFER, painting_->buffer);
  gl_.EnableVertexAttribArray(2);
  gl_.VertexAttribPointer(2, 3, GL_FLOAT, GL_FALSE, 3 * sizeof(float), nullptr);
}

void GlRenderer::upload_pictures(const View& view, std::span<const Item> items) {
  std::set<std::shared_ptr<const Image>> shown;
  const auto add = [&](const Paint& paint) {
    if (paint.kind == PaintKind::Picture) shown.insert(paint.picture);
  };
  for (const Item& item : items) add(item.paint);
  if (view.ground) add(view.ground->paint);
  // A picture lives as long as someone shows it.
  for (auto at = pictures_.begin(); at != pictures_.end();) {
    const bool stays = shown.contains(at->first);
    if (!stays) gl_.DeleteTextures(1, &at->second);
    at = stays ? std::next(at) : pictures_.erase(at);
  }
  for (const auto& picture : shown)
    if (!pictures_.contains(picture)) pictures_[picture] = make_picture_texture(gl_, *picture);
}

void GlRenderer::set_paint(const Program& program, const Item& item) const {
  const Paint& paint = item.paint;
  program.set("paint", static_cast<int>(paint.kind));
  program.set("first", linear_colour(item.colour));
  program.set("second", linear_colour(paint.colour));
  program.set("paint_axis", Eigen::Vector3f(paint.axis.normalized().cast<float>()));
  program.set("value_range", Eigen::Vector2f(static_cast<float>(paint.lower), static_cast<float>(paint.upper)));
  program.set("map_row", (static_cast<float>(paint.map) + 0.5F) / static_cast<float>(kColourMapNames.size()));
  if (paint.kind != PaintKind::Picture) return;
  program.set("picture_aspect", static_cast<float>(paint.picture->width) / static_cast<float>(paint.picture->height));
  bind(kPicture, pictures_.at(paint.picture), GL_TEXTURE_2D);
}

/// Which faces, and which samples of a pixel: an item of opacity a takes a share a of them, each item others first.
void GlRenderer::set_cover(const Item& item, std::size_t index) const {
  if (item.two_sided)
    gl_.Disable(GL_CULL_FACE);
  else
    gl_.Enable(GL_CULL_FACE);
  const int taken = std::clamp(static_cast<int>(std::lround(item.opacity * samples_)), 1, samples_);
  if (taken == samples_) {
    gl_.Disable(GL_SAMPLE_MASK);
    return;
  }
  GLbitfield mask = 0;
  for (int k = 0; k < taken; ++k) mask |= 1u << ((index + static_cast<std::size_t>(k)) % static_cast<std::size_t>(samples_));
  gl_.Enable(GL_SAMPLE_MASK);
  gl_.SampleMaski(0, mask);
}

void GlRenderer::draw_wires(const DrawRange& range, const Item& item) const {
  const Program& program = painting_->geometry;
  program.set("paint", static_cast<int>(PaintKind::Plain));
  program.set("first", Eigen::Vector3f(linear_colour(item.colour) * (item.surface ? 0.08F : 1.0F)));
  gl_.Disable(GL_CULL_FACE);
  gl_.PolygonMode(GL_FRONT_AND_BACK, GL_LINE);
  if (item.surface) {
    gl_.Enable(GL_CULL_FACE);
    gl_.Enable(GL_POLYGON_OFFSET_LINE);
    gl_.PolygonOffset(1.0F, 2.0F);
  }
  draw_range(range);
  gl_.Disable(GL_POLYGON_OFFSET_LINE);
  gl_.PolygonMode(GL_FRONT_AND_BACK, GL_FILL);
  gl_.Enable(GL_CULL_FACE);
}

void GlRenderer::draw_painted_geometry(const CameraMatrices& camera, std::span<const Item> items) const {
  begin_geometry(painting_->target);
  const Program& program = painting_->geometry;
  program.use();
  program.set("to_clip", camera.view_projection);
  program.set("picture", kPicture);
  program.set("maps", kColourMaps);
  gl_.BindVertexArray(item_array_);
  for (const DrawRange& range : list_.ranges) {
    const Item& item = items[range.item];
    program.set("id", geometry_id(item, range.item));
    set_cover(item, range.item);
    if (item.surface) {
      set_paint(program, item);
      draw_range(range);
    }
    if (item.wireframe) draw_wires(range, item);
  }
  end_geometry();
}

}  // namespace supple::render
