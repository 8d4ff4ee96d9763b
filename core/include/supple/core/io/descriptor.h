/// @file supple/core/io/descriptor.h
/// File descriptors of the operating system. Calls interrupted by a signal are repeated. Descriptors opened here are closed
/// on exec and never 0, 1 or 2: text that a library prints to standard error must not get into an output file.
#pragma once

#include <sys/types.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <filesystem>
#include <span>
#include <utility>

namespace supple::io {

/// Calls a system function, which returns -1 and errno on failure, again as long as signals interrupt it.
template <class Call>
auto retried(const Call& call) {
  for (;;) {
    const auto result = call();
    if (result != -1 || errno != EINTR) return result;
  }
}

/// Owns a descriptor, or none (-1). The destructor closes it.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int value) : value_(value) {}
  ~Descriptor() { (void)close(); }
  Descriptor(Descriptor&& other) noexcept : value_(std::exchange(other.value_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(value_, other.value_);
    return *this;
  }

  [[nodiscard]] int get() const { return value_; }
  [[nodiscard]] bool is_open() const { return value_ >= 0; }
  /// 0 on success, errno otherwise. Linux closes it in both cases, also where a signal interrupts the call.
  int close();

 private:
  int value_ = -1;
};

/// Takes over a descriptor (-1: none, with errno); one below 3 is moved above. None, with errno, on failure.
[[nodiscard]] Descriptor above_standard(int descriptor);
/// open(2), closed on exec and above 2. None, with errno, on failure.
[[nodiscard]] Descriptor open_file(const std::filesystem::path& path, int flags, mode_t mode = 0666);

/// 0 on success, errno otherwise.
[[nodiscard]] int write_all(int descriptor, std::span<const std::byte> bytes);
[[nodiscard]] int write_all_at(int descriptor, std::span<const std::byte> bytes, off_t offset);
/// 0 on success, errno otherwise, EIO where the file ends before.
[[nodiscard]] int read_all_at(int descriptor, std::span<std::byte> bytes, off_t offset);

/// For the start of a program: closed ones of standard input, output and error are opened on /dev/null, so that no file gets
/// their numbers; output and error for reading only, so that printing fails as on a closed descriptor.
/// @return which of the three were closed
std::array<bool, 3> occupy_standard_descriptors();

}  // namespace supple::io
