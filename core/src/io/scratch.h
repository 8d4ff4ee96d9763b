/// Bytes without a name in the file system, for files whose parts are collected in another order than they are written.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <filesystem>
#include <string_view>

#include "supple/core/io/atomic_file.h"
#include "supple/core/io/descriptor.h"

namespace supple::io {

/// A stretch of a Scratch.
struct Piece {
  off_t at = 0;
  std::size_t size = 0;
};

class Scratch {
 public:
  /// @param beside  a file in whose folder the bytes are kept   @throws Error{Io}
  explicit Scratch(const std::filesystem::path& beside);

  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(size_); }
  [[nodiscard]] Piece append(std::string_view bytes);          ///< @throws Error{Io}
  void copy_to(AtomicFile& out, const Piece& piece);           ///< @throws Error{Io}

 private:
  std::filesystem::path path_;
  Descriptor file_;
  off_t size_ = 0;
};

}  // namespace supple::io
