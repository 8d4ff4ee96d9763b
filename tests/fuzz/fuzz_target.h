/// @file tests/fuzz/fuzz_target.h
/// Common code of the fuzz targets. A target takes any bytes and must either use or refuse them: an Error is a refusal; what else
/// escapes, a crash, or a report of a sanitizer is a fault.
#pragma once

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <span>
#include <stdexcept>
#include <string>
#include <system_error>

#include "supple/core/error.h"

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

/// Writes the bytes to a file of the scratch folder. @return its path
inline std::filesystem::path as_file(const char* name, std::span<const std::uint8_t> bytes) {
  std::filesystem::path path = scratch() / name;
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!file.flush()) throw std::runtime_error("cannot write " + path.string());
  return path;
}

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
