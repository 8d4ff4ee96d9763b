/// @file supple/render/renderer.h
/// Off-screen pictures of meshes in linear light with a filmic tone curve, by OpenGL 4.5 core or by path tracing.
/// OpenGL: physically based shading, soft shadows, ambient occlusion on the ground, multisampling; the context comes from
/// OSMesa (no display, no GPU) or EGL surfaceless, the drawing code is the same. Path tracer (builds with Embree 3): indirect
/// light, shadows and reflections of everything, depth of field, motion blur.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "supple/render/view.h"

namespace supple::render {

enum class RendererKind : std::uint8_t { Gl, Path };
enum class ContextKind : std::uint8_t { Auto, OSMesa, Egl };

struct RenderSettings {
  int width = 1280;               ///< [pixel], 1 .. 16384
  int height = 720;               ///< [pixel], 1 .. 16384
  int samples = 4;                ///< multisampling: 1, 2, 4 or 8 (reduced to the maximum of the driver)
  int shadow_size = 2048;         ///< shadow map edge [texel]; 0 switches shadows off
  double shadow_softness = 0.03;  ///< angular radius of the light [rad]
  ContextKind context = ContextKind::Auto;  ///< Auto: OSMesa
  RendererKind kind = RendererKind::Gl;
  // Path tracer only:
  int threads = 1;                ///< 0: all of the machine
  double noise = 0.1;             ///< standard error of a pixel over its brightness, before the filter; 0: most_samples
  int most_samples = 256;         ///< per pixel, a power of two up to 65536
  bool denoise = true;            ///< filter guided by normals, positions and colours
  bool exact = true;              ///< rays intersect Item::field
  double shutter = 0.0;           ///< exposure [s]; vertices move by their columns velocity_x, velocity_y, velocity_z
};

/// CPU seconds of the process, threads of the driver included, since the renderer was made.
struct RenderTimes {
  double context = 0.0;    ///< making the OpenGL context
  double shaders = 0.0;    ///< building programs; a software driver compiles them with the first pixels, which are included
  double upload = 0.0;     ///< packing and transfer of vertices, hierarchies of boxes
  double draw = 0.0;
  double read_back = 0.0;
  /// Adds a share of other times.
  void add(const RenderTimes& other, double share) {
    context += share * other.context;
    shaders += share * other.shaders;
    upload += share * other.upload;
    draw += share * other.draw;
    read_back += share * other.read_back;
  }
};

class Renderer {
 public:
  virtual ~Renderer() = default;
  /// One picture. The same inputs give the same bytes, independent of earlier pictures and of the number of threads (the
  /// software driver reads its own, LP_NUM_THREADS, once per process).
  /// @pre meshes with one normal per vertex, finite positions and valid indices
  /// @throws Error{Usage} for a camera without a direction, Error{Limit} when the driver is out of memory
  [[nodiscard]] Image render(const View& view, std::span<const Item> items) { return render(view, items, nullptr); }
  /// The same, and its linear light before exposure and tone curve unless `linear` is null.
  [[nodiscard]] virtual Image render(const View& view, std::span<const Item> items, LinearImage* linear) = 0;
  /// e.g. "OSMesa, llvmpipe (LLVM 15.0.6, 256 bits), OpenGL 4.5"
  [[nodiscard]] virtual std::string description() const = 0;
  [[nodiscard]] virtual RenderTimes times() const = 0;
};

/// Whether this build has a path tracer.
[[nodiscard]] bool has_path_tracer();

/// @throws Error{Usage} for sizes out of range or a path tracer that this build does not have, Error{Io} when the context cannot be made (naming the missing library).
/// A renderer is used by the thread that made it.
[[nodiscard]] std::unique_ptr<Renderer> make_renderer(const RenderSettings& settings);

}  // namespace supple::render
