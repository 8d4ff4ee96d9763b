#pragma once

#include <filesystem>

#include "supple/core/io/descriptor.h"

namespace supple::scenes {

/// Locks a folder for one process; a second run in the same folder is refused.
class FolderLock {
 public:
  /// @throws Error{Io}
  explicit FolderLock(const std::filesystem::path& folder);

 private:
  io::Descriptor file_;
};

}  // namespace supple::scenes
