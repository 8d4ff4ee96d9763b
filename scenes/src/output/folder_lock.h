#pragma once

#include <filesystem>

#include "supple/core/io/descriptor.h"

namespace supple::scenes {

/// Holds a folder for one process; a second run of the same folder is told so.
class FolderLock {
 public:
  /// @throws Error{Io}
  explicit FolderLock(const std::filesystem::path& folder);

 private:
  io::Descriptor file_;
};

}  // namespace supple::scenes
