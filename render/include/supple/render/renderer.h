/// @file supple/render/renderer.h
/// Off-screen pictures of meshes by OpenGL 4.5 core: physically based shading in linear light with a filmic tone curve,
/// soft shadows, ambient occlusion on the ground, multisampling. The context comes from OSMesa (no display, no GPU) or
/// EGL surfaceless; the drawing code is the same.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "supple/render/view.h"

namespace supple::render {

enum class ContextKind : std::uint8_t { Auto, OSMesa, Egl };

struct RenderSettings {
  int width = 1280;               ///< [pixel], 1 .. 16384
  int height = 720;               ///< [pixel], 1 .. 16384
  int samples = 4;                ///< multisampling: 1, 2, 4 or 8 (reduced to what the driver offers)
  int shadow_size = 2048;         ///< shadow map edge [texel]; 0 switches shadows off
  double shadow_softness = 0.03;  ///< angular radius of the light [rad]
  ContextKind context = ContextKind::Auto;  ///< Auto: OSMesa
};

/// CPU seconds of the process, threads of the driver included, since the renderer was made.
struct RenderTimes {
  double context = 0.0;    ///< making the OpenGL context
  double shaders = 0.0;    ///< building programs; a software driver compiles them with the first pixels, so those too
  double upload = 0.0;     ///< packing and handing over vertices, hierarchies of boxes
  double draw = 0.0;
  double read_back = 0.0;
};

class Renderer {
 public:
  virtual ~Renderer() = default;
  /// One picture. The same inputs give the same bytes, whatever was drawn before and whatever the thread count (the
  /// software driver reads its own, LP_NUM_THREADS, once in a process).
  /// @pre meshes with one normal a vertex, finite positions and valid indices
  /// @throws Error{Usage} for a camera that looks nowhere, Error{Limit} when the driver is out of memory
  [[nodiscard]] virtual Image render(const View& view, std::span<const Item> items) = 0;
  /// e.g. "OSMesa, llvmpipe (LLVM 15.0.6, 256 bits), OpenGL 4.5"
  [[nodiscard]] virtual std::string description() const = 0;
  [[nodiscard]] virtual RenderTimes times() const = 0;
};

/// @throws Error{Usage} for sizes out of range, Error{Io} when the context cannot be made (naming the library looked for).
/// A renderer is used by the thread that made it.
[[nodiscard]] std::unique_ptr<Renderer> make_renderer(const RenderSettings& settings);

}  // namespace supple::render
