/// @file surface.h
/// What CGAL does for data: meshes read and mended, exact distances to them.
#pragma once

#include <filesystem>
#include <memory>

#include "supple/core/executor.h"
#include "supple/fit/fit.h"

namespace supple::fit {

/// The surface of data of any kind: a closed mesh without vertex normals, oriented outwards. @throws as `fit`
[[nodiscard]] Mesh read_surface(const std::filesystem::path& file, const FitOptions& options, Repair& repair, const Executor& executor);

/// Distances to a closed mesh, by a tree of its triangles.
class SurfaceTree {
 public:
  explicit SurfaceTree(const Mesh& mesh);
  ~SurfaceTree();
  SurfaceTree(const SurfaceTree&) = delete;
  SurfaceTree& operator=(const SurfaceTree&) = delete;

  [[nodiscard]] double distance(const Vec3& point) const;
  /// Less than 0 inside.
  [[nodiscard]] double signed_distance(const Vec3& point) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace supple::fit
