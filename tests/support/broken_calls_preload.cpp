// A library to load before a program's own: every other call that opens, reads, writes, syncs or renames a file fails with EINTR, as
// if a signal came first, and so does every close, after it has closed. Each thread counts for itself.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/types.h>
#include <sys/wait.h>

#include <cerrno>
#include <cstdarg>

namespace {

thread_local unsigned calls = 0;

bool breaks_off() {
  if (calls++ % 2 != 0) return false;
  errno = EINTR;
  return true;
}

template <class Call>
Call* own(Call* /*like*/, const char* name) {
  return reinterpret_cast<Call*>(dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

int open(const char* path, int flags, ...) {
  std::va_list list;
  va_start(list, flags);
  const auto mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(list, mode_t) : 0;
  va_end(list);
  return breaks_off() ? -1 : own(&open, "open")(path, flags, mode);
}
ssize_t read(int file, void* data, size_t size) { return breaks_off() ? -1 : own(&read, "read")(file, data, size); }
ssize_t write(int file, const void* data, size_t size) { return breaks_off() ? -1 : own(&write, "write")(file, data, size); }
ssize_t pread(int file, void* data, size_t size, off_t at) { return breaks_off() ? -1 : own(&pread, "pread")(file, data, size, at); }
ssize_t pwrite(int file, const void* data, size_t size, off_t at) {
  return breaks_off() ? -1 : own(&pwrite, "pwrite")(file, data, size, at);
}
int fsync(int file) { return breaks_off() ? -1 : own(&fsync, "fsync")(file); }
int rename(const char* from, const char* to) noexcept { return breaks_off() ? -1 : own(&rename, "rename")(from, to); }
int fcntl(int file, int command, ...) {
  std::va_list list;
  va_start(list, command);
  void* const argument = va_arg(list, void*);
  va_end(list);
  const bool locks = command == F_OFD_SETLK || command == F_OFD_GETLK;
  return locks && breaks_off() ? -1 : own(&fcntl, "fcntl")(file, command, argument);
}
pid_t waitpid(pid_t process, int* status, int options) {
  return breaks_off() ? -1 : own(&waitpid, "waitpid")(process, status, options);
}
int close(int file) {
  const int result = own(&close, "close")(file);
  if (result == 0) errno = EINTR;
  return -1;
}

}  // extern "C"
