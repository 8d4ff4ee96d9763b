/// @file supple/core/io/gltf_file.h
/// A whole animation of surfaces as one binary glTF 2.0 file (.glb; Khronos 2021), also where the topology changes.
#pragma once

#include <filesystem>
#include <memory>
#include <span>

#include "supple/core/io/usd_file.h"
#include "supple/core/mesh.h"

namespace supple::io {

/// Collects frames in an unnamed file beside the target; the target appears when it is complete. Units are metres; a root node turns z up
/// into the y up of glTF. Each frame of an object is a node with a mesh of its own, which the animation shows by its scale (1 in its
/// frame, 0 in others); frames with the same mesh share a node, and meshes with the same triangles share these. Numbers are single precision. asset.extras has
/// frame_rate, first_frame and last_frame.
class GltfAnimation {
 public:
  /// @throws Error{Io}
  GltfAnimation(std::filesystem::path path, double frame_rate, std::span<const UsdObject> objects);
  ~GltfAnimation();
  GltfAnimation(const GltfAnimation&) = delete;
  GltfAnimation& operator=(const GltfAnimation&) = delete;

  /// @param meshes   by object, with one normal per vertex; an empty one is absent in this frame
  /// @param cameras  the same cameras in every frame
  /// @pre frames ascend
  /// @throws Error{Io}; Error{Limit} where the file would exceed the 4 GB that its format allows
  void add_frame(int frame, std::span<const Mesh* const> meshes, std::span<const UsdCamera> cameras = {});
  /// @throws Error{Io}
  void finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace supple::io
