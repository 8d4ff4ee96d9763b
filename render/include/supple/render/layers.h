/// @file supple/render/layers.h
/// Layers for compositing programs: depth, normals, velocities and object numbers, and OpenEXR files that
/// contain them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "supple/render/renderer.h"

namespace supple::render {

/// First hit of the ray through the centre of each pixel; rows from top to bottom.
struct Layers {
  int width = 0;
  int height = 0;
  std::vector<float> depth;           ///< along the line of sight [m]; infinite without a hit, shape [height][width]
  std::vector<float> normal;          ///< unit, world, towards the eye's side; 0 without a hit, shape [height][width][3]
  std::vector<float> velocity;        ///< of the surface, by the columns velocity_x, _y, _z [m/s], shape [height][width][3]
  std::vector<std::uint32_t> object;  ///< 0: nothing, k: items[k - 1], items.size() + 1: the ground, shape [height][width]
};

class LayerRenderer {
 public:
  virtual ~LayerRenderer() = default;
  /// @pre as Renderer::render  @throws as Renderer::render
  [[nodiscard]] virtual Layers render(const View& view, std::span<const Item> items) = 0;
};

/// Uses width, height and context of the settings. @throws as make_renderer
[[nodiscard]] std::unique_ptr<LayerRenderer> make_layer_renderer(const RenderSettings& settings);

/// OpenEXR, ZIP-compressed scan lines: R, G, B, A (half, scene-linear: LinearImage), N.X, N.Y, N.Z (half),
/// velocity.X, .Y, .Z, Z (float), id (uint). The header has `objects`, the names of the numbers, `exposure`, by which
/// pictures multiply the light before their tone curve, and `fingerprint` unless empty.
/// @pre picture and layers of equal size  @throws Error{Io}
void write_exr(const std::filesystem::path& path, const LinearImage& picture, const Layers& layers,
               std::span<const std::string> objects, std::string_view fingerprint = {});
/// The fingerprint of a file of `write_exr`; empty for any other, or none.
[[nodiscard]] std::string exr_fingerprint(const std::filesystem::path& path);

}  // namespace supple::render
