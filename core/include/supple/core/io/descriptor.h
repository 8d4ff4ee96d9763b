/// @file supple/core/io/descriptor.h
/// Descriptors of the operating system. A call that a signal breaks off is made again. Those that are opened here are closed
/// on exec and never 0, 1 or 2: what a library prints to standard error must not land in a file of ours.
#pragma once

#include <sys/types.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <filesystem>
#include <span>
#include <utility>

namespace supple::io {

/// Makes a call of the system, which gives -1 and errno on failure, again for as long as signals break it off.
template <class Call>
auto retried(const Call& call) {
  for (;;) {
    const auto result = call();
    if (result != -1 || errno != EINTR) return result;
  }
}

/// Owns a descriptor, or none (-1). Closed on every way out.
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
  /// 0 on success, errno otherwise. Linux closes it in both cases, also where a signal breaks the call off.
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

/// For the start of a program: what is closed of standard input, output and error is opened on /dev/null, so that no file gets
/// its number; output and error for reading only, so that what is printed there fails as before.
/// @return which of the three were closed
std::array<bool, 3> occupy_standard_descriptors();

}  // namespace supple::io
