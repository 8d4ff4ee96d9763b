/// @file tests/fuzz/fuzz_target.h
/// Common code of the fuzz targets. A target takes any bytes and must either use or refuse them: an Error is a refusal; what else
/// escapes, a crash, or a report of a sanitizer is a fault.
#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <stdexcept>
#include <string>
#include <system_error>

#include "supple/core/error.h"
#include "supple/core/io/descriptor.h"

/// Called by libFuzzer, or by replay.cpp in programs without it.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace supple::fuzz {

/// A folder of this process, removed at its end; in memory where the system has such a place, as a file on a disk takes longer than its reading.
inline const std::filesystem::path& scratch() {
  struct Folder {
    static std::filesystem::path place() { return ::access("/dev/shm", W_OK) == 0 ? "/dev/shm" : std::filesystem::temp_directory_path(); }
    std::filesystem::path path = place() / ("supple_fuzz_" + std::to_string(::getpid()));
    Folder() { std::filesystem::create_directories(path); }
    ~Folder() {
      std::error_code ignored;
      std::filesystem::remove_all(path, ignored);
    }
  };
  static const Folder folder;
  return folder.path;
}

/// A file that stays open from input to input: to create and to close it takes longer than to read it.
class InputFile {
 public:
  /// @param name  of a file in the scratch folder, or its whole path
  explicit InputFile(const std::filesystem::path& name) : path_(scratch() / name), descriptor_(io::open_file(path_, O_RDWR | O_CREAT | O_TRUNC)) {}
  /// @return its path, with these bytes as its content
  const std::filesystem::path& with(std::span<const std::uint8_t> bytes) {
    const bool written = io::write_all_at(descriptor_.get(), std::as_bytes(bytes), 0) == 0;
    if (!written || ::ftruncate(descriptor_.get(), static_cast<off_t>(bytes.size())) != 0) throw std::runtime_error("cannot write " + path_.string());
    return path_;
  }

 private:
  std::filesystem::path path_;
  io::Descriptor descriptor_;
};

/// Calls `use`. @throws whatever is no refusal
template <class Use>
int used_or_refused(const Use& use) {
  try {
    use();
  } catch (const Error& error) {
    if (error.kind() == ErrorKind::Internal) throw;
  }
  return 0;
}

}  // namespace supple::fuzz
