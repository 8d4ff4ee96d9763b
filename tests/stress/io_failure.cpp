// Input and output that fail on purpose. LD_PRELOAD=libio_failure.so, and in the environment:
//   SUPPLE_FAIL_IO_UNDER   only files below this folder count (absolute path)
//   SUPPLE_FAIL_IO_KIND    enospc: from call AT on nothing more can be written; eio: call AT fails; eintr: call AT is interrupted (reads and
//                          writes alone); short: call AT reads or writes half; crash: call AT ends the program; none
//   SUPPLE_FAIL_IO_AT      number of that call, from 1
//   SUPPLE_FAIL_IO_COUNT   file that gets the number of calls when the program ends
//   SUPPLE_SERVE           many runs by one process (served.h); NUMBER is SUPPLE_FAIL_IO_AT, WORD SUPPLE_FAIL_IO_KIND
// Programs that this one starts are left alone.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "served.h"

namespace {

enum class Kind { None, NoSpace, Fault, Interrupted, Short, Crash };
enum class Call { Open, Read, Write, Other };

constexpr int kMostFiles = 4096;

struct Settings {
  const char* under = nullptr;
  std::size_t length = 0;
  Kind kind = Kind::None;
  long at = 0;
  const char* count_file = nullptr;
};

Settings settings;
std::atomic<long> calls{0};
std::array<std::atomic<bool>, kMostFiles> watched{};

Kind kind_named(const char* name) {
  if (name == nullptr) return Kind::None;
  if (std::strcmp(name, "enospc") == 0) return Kind::NoSpace;
  if (std::strcmp(name, "eio") == 0) return Kind::Fault;
  if (std::strcmp(name, "eintr") == 0) return Kind::Interrupted;
  if (std::strcmp(name, "short") == 0) return Kind::Short;
  if (std::strcmp(name, "crash") == 0) return Kind::Crash;
  return Kind::None;
}

__attribute__((constructor)) void begin() {
  settings.under = std::getenv("SUPPLE_FAIL_IO_UNDER");
  if (settings.under != nullptr) settings.length = std::strlen(settings.under);
  settings.kind = kind_named(std::getenv("SUPPLE_FAIL_IO_KIND"));
  const char* at = std::getenv("SUPPLE_FAIL_IO_AT");
  settings.at = at != nullptr ? std::strtol(at, nullptr, 10) : 0;
  settings.count_file = std::getenv("SUPPLE_FAIL_IO_COUNT");
  unsetenv("LD_PRELOAD");
  supple::stress::Request request;
  if (supple::stress::serve(request)) {
    settings.at = request.number;
    settings.kind = kind_named(request.word.data());
  }
}

__attribute__((destructor)) void end() {
  if (settings.count_file == nullptr) return;
  std::array<char, 32> text{};
  const int length = std::snprintf(text.data(), text.size(), "%ld\n", calls.load());
  const long file = syscall(SYS_openat, AT_FDCWD, settings.count_file, O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (file < 0) return;
  (void)!syscall(SYS_write, file, text.data(), static_cast<std::size_t>(length));
  syscall(SYS_close, file);
}

bool is_under(const char* path) { return settings.under != nullptr && path != nullptr && std::strncmp(path, settings.under, settings.length) == 0; }
bool is_watched(int file) { return file >= 0 && file < kMostFiles && watched[static_cast<std::size_t>(file)]; }
void watch(int file, bool on) {
  if (file >= 0 && file < kMostFiles) watched[static_cast<std::size_t>(file)] = on;
}

/// Counts a call. @return the error that it fails with, 0 for none; `half` where it shall do half of its work
int verdict(Call call, bool takes_space, bool& half) {
  half = false;
  const long number = ++calls;
  switch (settings.kind) {
    case Kind::NoSpace: return takes_space && number >= settings.at ? ENOSPC : 0;
    case Kind::Fault: return number == settings.at ? EIO : 0;
    case Kind::Interrupted: return number == settings.at && (call == Call::Read || call == Call::Write) ? EINTR : 0;
    case Kind::Short: half = number == settings.at && (call == Call::Read || call == Call::Write); return 0;
    case Kind::Crash:
      if (number == settings.at) std::abort();
      break;
    case Kind::None: break;
  }
  return 0;
}

bool fails(Call call, bool takes_space) {
  bool half = false;
  const int code = verdict(call, takes_space, half);
  if (code != 0) errno = code;
  return code != 0;
}

template <class Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

int opened(const char* path, int flags, int file) {
  if (file >= 0) watch(file, is_under(path) && (flags & O_DIRECTORY) == 0);
  return file;
}

int open_file(const char* name, const char* path, int flags, mode_t mode) {
  if (is_under(path) && fails(Call::Open, (flags & O_CREAT) != 0)) return -1;
  return opened(path, flags, next<int (*)(const char*, int, mode_t)>(name)(path, flags, mode));
}

std::FILE* open_stream(const char* name, const char* path, const char* mode) {
  const bool writes = std::strpbrk(mode, "wa+") != nullptr;
  if (is_under(path) && fails(Call::Open, writes)) return nullptr;
  std::FILE* stream = next<std::FILE* (*)(const char*, const char*)>(name)(path, mode);
  if (stream != nullptr) watch(fileno(stream), is_under(path));
  return stream;
}

/// Bytes to move, or 0 with errno set where the call fails.
std::size_t allowed(Call call, std::size_t size) {
  bool half = false;
  const int code = verdict(call, call == Call::Write, half);
  if (code != 0) errno = code;
  if (code != 0) return 0;
  return half && size > 1 ? size / 2 : size;
}

}  // namespace

extern "C" {

int open(const char* path, int flags, ...) {
  va_list list;
  va_start(list, flags);
  const mode_t mode = va_arg(list, mode_t);
  va_end(list);
  return open_file("open", path, flags, mode);
}

int open64(const char* path, int flags, ...) {
  va_list list;
  va_start(list, flags);
  const mode_t mode = va_arg(list, mode_t);
  va_end(list);
  return open_file("open64", path, flags, mode);
}

int openat(int folder, const char* path, int flags, ...) {
  va_list list;
  va_start(list, flags);
  const mode_t mode = va_arg(list, mode_t);
  va_end(list);
  if (is_under(path) && fails(Call::Open, (flags & O_CREAT) != 0)) return -1;
  return opened(path, flags, next<int (*)(int, const char*, int, mode_t)>("openat")(folder, path, flags, mode));
}

int mkstemps(char* pattern, int suffix) {
  if (is_under(pattern) && fails(Call::Open, true)) return -1;
  return opened(pattern, 0, next<int (*)(char*, int)>("mkstemps")(pattern, suffix));
}

std::FILE* fopen(const char* path, const char* mode) { return open_stream("fopen", path, mode); }
std::FILE* fopen64(const char* path, const char* mode) { return open_stream("fopen64", path, mode); }

ssize_t read(int file, void* bytes, std::size_t size) {
  static const auto real = next<ssize_t (*)(int, void*, std::size_t)>("read");
  if (!is_watched(file) || size == 0) return real(file, bytes, size);
  const std::size_t now = allowed(Call::Read, size);
  return now == 0 ? -1 : real(file, bytes, now);
}

ssize_t write(int file, const void* bytes, std::size_t size) {
  static const auto real = next<ssize_t (*)(int, const void*, std::size_t)>("write");
  if (!is_watched(file) || size == 0) return real(file, bytes, size);
  const std::size_t now = allowed(Call::Write, size);
  return now == 0 ? -1 : real(file, bytes, now);
}

ssize_t writev(int file, const iovec* parts, int count) {
  static const auto real = next<ssize_t (*)(int, const iovec*, int)>("writev");
  if (!is_watched(file)) return real(file, parts, count);
  std::size_t size = 0;
  for (int k = 0; k < count; ++k) size += parts[k].iov_len;
  if (size == 0) return real(file, parts, count);
  const std::size_t now = allowed(Call::Write, size);
  if (now == 0) return -1;
  return now == size ? real(file, parts, count) : real(file, parts, 1);  // a part is a short write
}

std::size_t fwrite(const void* bytes, std::size_t size, std::size_t count, std::FILE* stream) {
  static const auto real = next<std::size_t (*)(const void*, std::size_t, std::size_t, std::FILE*)>("fwrite");
  if (!is_watched(fileno(stream)) || size * count == 0) return real(bytes, size, count, stream);
  const std::size_t now = allowed(Call::Write, count);
  return now == 0 ? 0 : real(bytes, size, settings.kind == Kind::Short ? count : now, stream);
}

std::size_t fread(void* bytes, std::size_t size, std::size_t count, std::FILE* stream) {
  static const auto real = next<std::size_t (*)(void*, std::size_t, std::size_t, std::FILE*)>("fread");
  if (!is_watched(fileno(stream)) || size * count == 0) return real(bytes, size, count, stream);
  const std::size_t now = allowed(Call::Read, count);
  return now == 0 ? 0 : real(bytes, size, settings.kind == Kind::Short ? count : now, stream);
}

int fflush(std::FILE* stream) {
  static const auto real = next<int (*)(std::FILE*)>("fflush");
  if (stream == nullptr || !is_watched(fileno(stream))) return real(stream);
  return fails(Call::Write, true) ? EOF : real(stream);
}

int fclose(std::FILE* stream) {
  static const auto real = next<int (*)(std::FILE*)>("fclose");
  const int file = fileno(stream);
  const bool ours = is_watched(file);
  watch(file, false);
  const bool fault = ours && fails(Call::Other, true);
  const int code = errno;
  const int done = real(stream);
  if (fault) errno = code;
  return fault ? EOF : done;
}

int fsync(int file) {
  if (is_watched(file) && fails(Call::Other, true)) return -1;
  return next<int (*)(int)>("fsync")(file);
}

int close(int file) {
  static const auto real = next<int (*)(int)>("close");
  const bool ours = is_watched(file);
  watch(file, false);
  const bool fault = ours && fails(Call::Other, false);
  const int code = errno;
  const int done = real(file);
  if (fault) errno = code;
  return fault ? -1 : done;
}

int rename(const char* from, const char* to) {
  if (is_under(to) && fails(Call::Other, true)) return -1;
  return next<int (*)(const char*, const char*)>("rename")(from, to);
}

int mkdir(const char* path, mode_t mode) {
  if (is_under(path) && fails(Call::Other, true)) return -1;
  return next<int (*)(const char*, mode_t)>("mkdir")(path, mode);
}

int ftruncate(int file, off_t size) {
  if (is_watched(file) && fails(Call::Other, true)) return -1;
  return next<int (*)(int, off_t)>("ftruncate")(file, size);
}

}  // extern "C"
