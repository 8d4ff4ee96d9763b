/// @file supple/core/io/usd_file.h
/// A whole animation of surfaces as one USD file (ASCII) with time samples, also where the topology changes.
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "supple/core/mesh.h"

namespace supple::io {

/// A mesh of the animation, the same object in every frame.
struct UsdObject {
  std::string name;                          ///< becomes a USD name: letters, digits and '_'
  Vec3 colour = Vec3(0.8, 0.8, 0.8);         ///< sRGB in [0, 1]
  double roughness = 0.45;                   ///< [0, 1]
};

struct UsdCamera {
  std::string name = "camera";
  Vec3 from = Vec3(0, -4, 2);                ///< [m]
  Vec3 look_at = Vec3::Zero();               ///< [m]
  Vec3 up = Vec3::UnitZ();
  double field_of_view = 0.61;               ///< vertical [rad]
  double aspect = 16.0 / 9.0;                ///< width over height
};

/// Collects frames in unnamed files beside the target; the target appears when it is complete. Units are metres,
/// z is up, time code n is frame n. Each object is a Mesh with points, normals, counts and indices, a preview material,
/// `velocities` [m/s] where the columns velocity_x, velocity_y, velocity_z are present, and the other columns as primvars.
/// Unchanged arrays are written once.
class UsdAnimation {
 public:
  /// @throws Error{Io}
  UsdAnimation(std::filesystem::path path, double frame_rate, std::span<const UsdObject> objects);
  ~UsdAnimation();
  UsdAnimation(const UsdAnimation&) = delete;
  UsdAnimation& operator=(const UsdAnimation&) = delete;

  /// @param meshes   by object, with one normal per vertex; an empty one is absent in this frame
  /// @param cameras  the same cameras in every frame
  /// @pre frames ascend  @throws Error{Io}
  void add_frame(int frame, std::span<const Mesh* const> meshes, std::span<const UsdCamera> cameras = {});
  /// @throws Error{Io}
  void finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace supple::io
