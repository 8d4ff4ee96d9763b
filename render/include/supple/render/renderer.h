/// @file supple/render/renderer.h
/// Off-screen pictures of meshes by OpenGL 4.5 core: physically based shading in linear light with a filmic tone curve,
/// soft shadows, ambient occlusion on the ground, multisampling. The context comes from OSMesa (no display, no GPU) or
/// EGL surfaceless; the drawing code is the same.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "supple/core/mesh.h"
#include "supple/core/types.h"
#include "supple/render/image.h"

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

struct Camera {
  Vec3 from = Vec3(0, -4, 2);     ///< [m]
  Vec3 look_at = Vec3::Zero();    ///< [m]
  Vec3 up = Vec3::UnitZ();        ///< looking along it, y is up in the picture
  double field_of_view = 0.61;    ///< vertical [rad], in (0, pi)
};

struct Light {
  Vec3 direction = Vec3(-0.45, 0.35, -1.0);  ///< the way the light travels
  double intensity = 3.0;                    ///< relative to the sky
};

struct Ground {
  double height = 0.0;                       ///< z [m]
  Vec3 colour = Vec3(0.80, 0.80, 0.78);      ///< sRGB, fades to the background with distance
};

struct Item {
  const Mesh* mesh = nullptr;                ///< may be empty
  Vec3 colour = Vec3(0.8, 0.8, 0.8);         ///< sRGB in [0, 1]
  double roughness = 0.45;                   ///< (0, 1]
  bool two_sided = false;                    ///< draws back faces, too: for surfaces that are not closed
};

struct View {
  Camera camera;
  Light light;
  std::optional<Ground> ground;
  Vec3 background_top = Vec3(0.62, 0.71, 0.82);     ///< sRGB
  Vec3 background_bottom = Vec3(0.93, 0.94, 0.95);  ///< sRGB
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
};

/// @throws Error{Usage} for sizes out of range, Error{Io} when the context cannot be made (naming the library looked for).
/// A renderer is used by the thread that made it.
[[nodiscard]] std::unique_ptr<Renderer> make_renderer(const RenderSettings& settings);

}  // namespace supple::render
