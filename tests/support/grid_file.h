#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "supple/core/types.h"

namespace supple {

/// A grid of a .vdb file as OpenVDB alone reads it.
class GridOfFile {
 public:
  /// Reads the grid of that name; without one `found` is false.
  GridOfFile(const std::filesystem::path& file, const std::string& name);
  [[nodiscard]] bool found() const { return grid_ != nullptr; }
  [[nodiscard]] std::string content_hash() const;  ///< as the file states it
  [[nodiscard]] double interpolate(const Vec3& world) const;  ///< trilinear

 private:
  std::shared_ptr<const void> grid_;
};

}  // namespace supple
