/// @file supple/core/io/open_temporaries.h
/// Temporary files and folders of this process, so that a program that ends without unwinding can remove them.
#pragma once

namespace supple::io {

/// Registers a temporary file or folder for its lifetime. Paths that are too long, or too many at a time, are not registered.
class OpenTemporary {
 public:
  /// @param path  absolute, or relative to a working folder that does not change
  explicit OpenTemporary(const char* path) noexcept;
  ~OpenTemporary();
  OpenTemporary(const OpenTemporary&) = delete;
  OpenTemporary& operator=(const OpenTemporary&) = delete;

 private:
  int slot_ = -1;
};

/// Removes the registered files, then the folders that are empty. Safe in signal and terminate handlers: neither allocates nor locks.
void remove_open_temporaries() noexcept;

}  // namespace supple::io
