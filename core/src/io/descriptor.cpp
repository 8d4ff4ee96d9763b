#include "supple/core/io/descriptor.h"

#include <fcntl.h>
#include <unistd.h>

namespace supple::io {
namespace {

constexpr int kFirstFree = STDERR_FILENO + 1;

/// 0 when `transfer(bytes, done)`, which gives how many it took, took all; errno otherwise, EIO where it takes none.
template <class Bytes, class Transfer>
int all(Bytes bytes, const Transfer& transfer) {
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t count = retried([&] { return transfer(bytes.subspan(done), static_cast<off_t>(done)); });
    if (count <= 0) return count < 0 ? errno : EIO;
    done += static_cast<std::size_t>(count);
  }
  return 0;
}

}  // namespace

int Descriptor::close() {
  const int value = std::exchange(value_, -1);
  return value < 0 || ::close(value) == 0 || errno == EINTR ? 0 : errno;
}

Descriptor above_standard(int descriptor) {
  Descriptor held(descriptor);
  if (descriptor < 0 || descriptor >= kFirstFree) return held;
  return Descriptor(retried([&] { return ::fcntl(descriptor, F_DUPFD_CLOEXEC, kFirstFree); }));
}

Descriptor open_file(const std::filesystem::path& path, int flags, mode_t mode) {
  return above_standard(retried([&] { return ::open(path.c_str(), flags | O_CLOEXEC, mode); }));
}

int write_all(int descriptor, std::span<const std::byte> bytes) {
  return all(bytes, [&](std::span<const std::byte> left, off_t /*done*/) { return ::write(descriptor, left.data(), left.size()); });
}

int write_all_at(int descriptor, std::span<const std::byte> bytes, off_t offset) {
  return all(bytes, [&](std::span<const std::byte> left, off_t done) { return ::pwrite(descriptor, left.data(), left.size(), offset + done); });
}

int read_all_at(int descriptor, std::span<std::byte> bytes, off_t offset) {
  return all(bytes, [&](std::span<std::byte> left, off_t done) { return ::pread(descriptor, left.data(), left.size(), offset + done); });
}

std::array<bool, 3> occupy_standard_descriptors() {
  std::array<bool, 3> closed{};
  for (int k = STDIN_FILENO; k < kFirstFree; ++k) {
    if (::fcntl(k, F_GETFD) != -1 || errno != EBADF) continue;
    closed[static_cast<std::size_t>(k)] = true;
    // Lower numbers are open, so this gets number k.
    (void)retried([] { return ::open("/dev/null", O_RDONLY); });
  }
  return closed;
}

}  // namespace supple::io
