#include "supple/core/io/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <random>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "supple/core/error.h"
#include "supple/core/nearest_word.h"

namespace supple::io {
namespace {

constexpr std::size_t kMostNames = 10000;  // of a folder that are compared

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& what, int code, std::string hint = {}) {
  throw Error(ErrorKind::Io, Fault{.place = path.string(),
                                   .key = {},
                                   .expected = what + ": " + std::system_category().message(code),
                                   .found = {},
                                   .hint = std::move(hint)});
}

[[noreturn]] void fail_to_read(const std::filesystem::path& path, int code) { fail(path, "cannot be read", code, code == ENOENT || code == ENOTDIR ? hint_of_absent(path) : ""); }

/// @throws Error{Io} where what is open is neither a regular file nor a folder, whose reading fails by itself
void expect_regular(const std::filesystem::path& path, const Descriptor& descriptor) {
  struct stat status {};
  if (::fstat(descriptor.get(), &status) != 0) fail_to_read(path, errno);
  if (S_ISREG(status.st_mode) || S_ISDIR(status.st_mode)) return;
  throw Error(ErrorKind::Io, Fault{.place = path.string(),
                                   .key = {},
                                   .expected = "expected a regular file",
                                   .found = S_ISFIFO(status.st_mode) ? "a pipe" : "a device or a socket",
                                   .hint = {}});
}

/// Makes the rename itself durable; a file system that cannot do it still has the file.
void sync_folder(const std::filesystem::path& folder) {
  const Descriptor descriptor = open_file(folder.empty() ? "." : folder, O_RDONLY | O_DIRECTORY);
  if (descriptor.is_open()) (void)retried([&] { return ::fsync(descriptor.get()); });
}

/// Renames `from` to `to`, with fsync of content and folder. 0 on success, errno otherwise.
int publish(Descriptor& descriptor, const std::filesystem::path& from, const std::filesystem::path& to) {
  int code = retried([&] { return ::fsync(descriptor.get()); }) != 0 ? errno : 0;
  const int closed = descriptor.close();
  if (code == 0) code = closed;
  if (code == 0 && retried([&] { return ::rename(from.c_str(), to.c_str()); }) != 0) code = errno;
  if (code == 0) sync_folder(to.parent_path());
  return code;
}

}  // namespace

std::filesystem::path temporary_name(const std::filesystem::path& path) {
  static std::atomic<unsigned> counter{0};
  // Machines and containers that share a folder may have processes of the same number.
  static const unsigned token = std::random_device()();
  return path.parent_path() / ('.' + path.filename().string() + '.' + std::to_string(::getpid()) + '-' + std::to_string(token) + '.' +
                               std::to_string(counter.fetch_add(1)) + ".tmp");
}

AtomicFile::AtomicFile(std::filesystem::path path) : path_(std::move(path)), temporary_(temporary_name(path_)), open_(temporary_.c_str()) {
  descriptor_ = open_file(temporary_, O_WRONLY | O_CREAT | O_EXCL);
  if (!descriptor_.is_open()) fail(path_, "cannot be written", errno);
}

AtomicFile::~AtomicFile() {
  if (descriptor_.is_open()) ::unlink(temporary_.c_str());
}

void AtomicFile::write(std::span<const std::byte> bytes) {
  if (const int code = write_all(descriptor_.get(), bytes)) fail(path_, "cannot be written", code);
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
  SUPPLE_EXPECTS(descriptor_.is_open());
  write(buffer_);
  buffer_.clear();
  if (const int code = publish(descriptor_, temporary_, path_)) {
    ::unlink(temporary_.c_str());
    fail(path_, "cannot be written", code);
  }
}

void rename_whole(const std::filesystem::path& from, const std::filesystem::path& to) {
  Descriptor descriptor = open_to_read(from);
  const int code = descriptor.is_open() ? publish(descriptor, from, to) : errno;
  if (code != 0) fail(to, "cannot be written", code);
}

void write_atomically(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  AtomicFile file(path);
  file.append(bytes);
  file.commit();
}

void write_atomically(const std::filesystem::path& path, std::string_view text) {
  write_atomically(path, std::as_bytes(std::span<const char>(text)));
}

Descriptor open_to_read(const std::filesystem::path& path) {
  Descriptor descriptor = open_file(path, O_RDONLY | O_NONBLOCK | O_NOCTTY);  // a pipe without a writer is opened, not waited for
  if (descriptor.is_open()) expect_regular(path, descriptor);
  return descriptor;
}

std::string hint_of_absent(const std::filesystem::path& path) {
  namespace fs = std::filesystem;
  const fs::path folder = path.parent_path().empty() ? fs::path(".") : path.parent_path();
  std::error_code failed;
  if (!fs::is_directory(folder, failed)) return "there is no folder '" + folder.string() + '\'';
  std::vector<std::string> names;
  for (fs::directory_iterator at(folder, failed); !failed && at != fs::directory_iterator() && names.size() < kMostNames; at.increment(failed)) {
    std::string name = at->path().filename().string();
    if (!name.starts_with('.')) names.push_back(std::move(name));
  }
  std::sort(names.begin(), names.end());  // folders have no order of their own
  const std::vector<std::string_view> words(names.begin(), names.end());
  const std::string near = nearest_word(path.filename().string(), words);
  return near.empty() ? "" : "did you mean '" + near + "'?";
}

std::vector<std::byte> read_file(const std::filesystem::path& path, std::size_t limit) {
  const Descriptor descriptor = open_to_read(path);
  if (!descriptor.is_open()) fail_to_read(path, errno);
  struct stat status {};
  if (::fstat(descriptor.get(), &status) != 0) fail_to_read(path, errno);
  if (S_ISDIR(status.st_mode)) fail_to_read(path, EISDIR);
  const auto refuse = [&](std::size_t size) {
    throw Error(ErrorKind::Limit, Fault{.place = path.string(),
                                        .key = {},
                                        .expected = "expected at most " + std::to_string(limit) + " bytes",
                                        .found = std::to_string(size),
                                        .hint = {}});
  };
  const auto size = static_cast<std::size_t>(status.st_size);
  if (size > limit) refuse(size);

  // The size is a hint only: files of the kernel report 0, and a file may grow while it is read. With room for one byte more, the end is found without growing.
  std::vector<std::byte> bytes(size + 1);
  std::size_t used = 0;
  for (;;) {
    if (used == bytes.size()) bytes.resize(used + 4096);
    const ssize_t count = retried([&] { return ::read(descriptor.get(), bytes.data() + used, bytes.size() - used); });
    if (count < 0) fail_to_read(path, errno);
    if (count == 0) break;
    used += static_cast<std::size_t>(count);
    if (used > limit) refuse(used);
  }
  bytes.resize(used);
  return bytes;
}

std::optional<std::size_t> read_start(const std::filesystem::path& path, std::span<std::byte> bytes) {
  Descriptor descriptor = open_to_read(path);
  if (!descriptor.is_open()) return std::nullopt;
  std::size_t used = 0;
  while (used < bytes.size()) {
    const ssize_t count = retried([&] { return ::read(descriptor.get(), bytes.data() + used, bytes.size() - used); });
    if (count < 0) {
      const int code = errno;
      (void)descriptor.close();
      errno = code;
      return std::nullopt;
    }
    if (count == 0) break;
    used += static_cast<std::size_t>(count);
  }
  return used;
}

std::size_t read_start_if_there(const std::filesystem::path& path, std::span<std::byte> bytes) {
  const std::optional<std::size_t> count = read_start(path, bytes);
  if (count) return *count;
  const int code = errno;
  if (code != ENOENT && code != ENOTDIR) fail(path, "cannot be read", code);
  return 0;
}

void make_writable_folder(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) fail(path, "cannot be made a folder", error.value());
  const std::filesystem::path probe = temporary_name(path / "probe");
  {
    const Descriptor descriptor = open_file(probe, O_WRONLY | O_CREAT | O_EXCL);
    if (!descriptor.is_open()) fail(path, "files cannot be made in this folder", errno);
  }
  ::unlink(probe.c_str());
}

}  // namespace supple::io
