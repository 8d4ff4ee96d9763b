#include "supple/core/io/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <string>
#include <system_error>
#include <utility>

#include "supple/core/error.h"

namespace supple::io {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& what, int code) {
  throw Error(ErrorKind::Io, Fault{.place = path.string(),
                                   .key = {},
                                   .expected = what + ": " + std::system_category().message(code),
                                   .found = {},
                                   .hint = {}});
}

/// A file descriptor that is closed on every way out.
class Descriptor {
 public:
  explicit Descriptor(int value) : value_(value) {}
  ~Descriptor() {
    if (value_ >= 0) ::close(value_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  [[nodiscard]] int get() const { return value_; }

 private:
  int value_;
};

std::filesystem::path temporary_name(const std::filesystem::path& path) {
  static std::atomic<unsigned> counter{0};
  return path.parent_path() / ('.' + path.filename().string() + '.' + std::to_string(::getpid()) + '.' +
                               std::to_string(counter.fetch_add(1)) + ".tmp");
}

/// 0 on success, errno otherwise.
int write_all(int descriptor, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written < 0) {
      if (errno == EINTR) continue;
      return errno;
    }
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  return 0;
}

/// Makes the rename itself durable; a file system that cannot do it still has the file.
void sync_folder(const std::filesystem::path& folder) {
  const Descriptor descriptor(::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (descriptor.get() >= 0) static_cast<void>(::fsync(descriptor.get()));
}

}  // namespace

AtomicFile::AtomicFile(std::filesystem::path path) : path_(std::move(path)), temporary_(temporary_name(path_)), open_(temporary_.c_str()) {
  descriptor_ = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (descriptor_ < 0) fail(path_, "cannot be written", errno);
}

AtomicFile::~AtomicFile() {
  if (descriptor_ < 0) return;
  ::close(descriptor_);
  ::unlink(temporary_.c_str());
}

void AtomicFile::write(std::span<const std::byte> bytes) {
  if (const int code = write_all(descriptor_, bytes)) fail(path_, "cannot be written", code);
}

void AtomicFile::append(std::span<const std::byte> bytes) {
  constexpr std::size_t kBuffer = std::size_t{1} << 16;
  if (buffer_.size() + bytes.size() > kBuffer) {
    write(buffer_);
    buffer_.clear();
  }
  if (bytes.size() > kBuffer) {
    write(bytes);
  } else {
    buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  }
}

void AtomicFile::append(std::string_view text) { append(std::as_bytes(std::span<const char>(text))); }

void AtomicFile::commit() {
  SUPPLE_EXPECTS(descriptor_ >= 0);
  write(buffer_);
  buffer_.clear();
  int code = ::fsync(descriptor_) != 0 ? errno : 0;
  if (::close(descriptor_) != 0 && code == 0) code = errno;
  descriptor_ = -1;
  if (code == 0 && ::rename(temporary_.c_str(), path_.c_str()) != 0) code = errno;
  if (code != 0) {
    ::unlink(temporary_.c_str());
    fail(path_, "cannot be written", code);
  }
  sync_folder(path_.parent_path());
}

void write_atomically(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  AtomicFile file(path);
  file.append(bytes);
  file.commit();
}

void write_atomically(const std::filesystem::path& path, std::string_view text) {
  write_atomically(path, std::as_bytes(std::span<const char>(text)));
}

std::vector<std::byte> read_file(const std::filesystem::path& path, std::size_t limit) {
  const Descriptor descriptor(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (descriptor.get() < 0) fail(path, "cannot be read", errno);
  struct stat status {};
  if (::fstat(descriptor.get(), &status) != 0) fail(path, "cannot be read", errno);
  if (S_ISDIR(status.st_mode)) fail(path, "cannot be read", EISDIR);
  const auto refuse = [&](std::size_t size) {
    throw Error(ErrorKind::Limit, Fault{.place = path.string(),
                                        .key = {},
                                        .expected = "expected at most " + std::to_string(limit) + " bytes",
                                        .found = std::to_string(size),
                                        .hint = {}});
  };
  const auto size = static_cast<std::size_t>(status.st_size);
  if (size > limit) refuse(size);

  // The size is a hint only: pipes report 0, and a file may grow while it is read.
  std::vector<std::byte> bytes(size);
  std::size_t used = 0;
  for (;;) {
    if (used == bytes.size()) bytes.resize(used + 4096);
    const ssize_t count = ::read(descriptor.get(), bytes.data() + used, bytes.size() - used);
    if (count < 0) {
      if (errno == EINTR) continue;
      fail(path, "cannot be read", errno);
    }
    if (count == 0) break;
    used += static_cast<std::size_t>(count);
    if (used > limit) refuse(used);
  }
  bytes.resize(used);
  return bytes;
}

void make_writable_folder(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) fail(path, "cannot be made a folder", error.value());
  const std::filesystem::path probe = temporary_name(path / "probe");
  {
    const Descriptor descriptor(::open(probe.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
    if (descriptor.get() < 0) fail(path, "files cannot be made in this folder", errno);
  }
  ::unlink(probe.c_str());
}

}  // namespace supple::io
