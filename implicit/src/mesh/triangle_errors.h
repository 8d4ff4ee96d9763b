/// @file triangle_errors.h
/// Errors of the triangles of meshes that are made again and again.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "supple/core/executor.h"
#include "supple/core/mesh.h"
#include "supple/implicit/field_view.h"

namespace supple::implicit {

class TriangleErrors {
 public:
  /// centroid_error of a mesh. A triangle whose corners are bit for bit those of one of the last mesh, in that order, keeps its error where
  /// the field is unchanged.
  /// @param last     the mesh of the last call
  /// @param nothing  of the last call is valid
  /// @param differs  whether the field, not its feature size, may have other values in a box than in the last call
  [[nodiscard]] double measure(const FieldView& field, const Mesh& mesh, const Mesh& last, bool nothing,
                               const std::function<bool(const Box&)>& differs, const Executor& executor);
  [[nodiscard]] std::uint64_t bytes() const { return found_.capacity() * sizeof(Found) + wide_.capacity() * sizeof(Box); }

 private:
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};
  struct Found {
    double error = 0.0;          ///< [m]
    std::uint32_t wide = kNone;  ///< index in wide_ of the box in which the field was evaluated, if not at the centroid alone
  };
  std::vector<Found> found_;  ///< by triangle of the last mesh
  std::vector<Box> wide_;
};

}  // namespace supple::implicit
