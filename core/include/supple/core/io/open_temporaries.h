/// @file supple/core/io/open_temporaries.h
/// Temporary files and folders of this process, so that a program that ends without unwinding leaves none behind.
#pragma once

namespace supple::io {

/// A temporary file or folder that is known while this exists. Paths that are too long, or too many at once, are not.
class OpenTemporary {
 public:
  /// @param path  absolute, or relative to a working folder that stays
  explicit OpenTemporary(const char* path) noexcept;
  ~OpenTemporary();
  OpenTemporary(const OpenTemporary&) = delete;
  OpenTemporary& operator=(const OpenTemporary&) = delete;

 private:
  int slot_ = -1;
};

/// Removes the files that are known, then the folders, if nothing else is in them. Safe in signal and terminate handlers: neither allocates nor locks.
void remove_open_temporaries() noexcept;

}  // namespace supple::io
