#include "served.h"

#include <dlfcn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>

namespace supple::stress {
namespace {

bool forked = false;

using Line = std::array<char, 64>;

bool read_line(int file, Line& line) {
  std::size_t length = 0;
  for (char c = 0; length + 1 < line.size();) {
    const ssize_t count = ::read(file, &c, 1);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    if (c == '\n') break;
    line[length++] = c;
  }
  line[length] = '\0';
  return true;
}

void tell(int file, int number) {
  Line text{};
  const int length = std::snprintf(text.data(), text.size(), "%d\n", number);
  if (::write(file, text.data(), static_cast<std::size_t>(length)) != length) _exit(2);
}

/// Runs when the destructors of the program are done, before those of libraries.
void leave(int status, void* /*unused*/) {
  std::fflush(nullptr);
  _exit(status);
}

}  // namespace

bool serve(Request& request) {
  const char* ends = std::getenv("SUPPLE_SERVE");
  int in = -1, out = -1;
  if (ends == nullptr || std::sscanf(ends, "%d %d", &in, &out) != 2) return false;
  unsetenv("SUPPLE_SERVE");
  for (Line line{}; read_line(in, line);) {
    if (std::sscanf(line.data(), "%ld %15s", &request.number, request.word.data()) != 2) _exit(2);
    const pid_t child = fork();
    if (child < 0) _exit(2);
    if (child == 0) {
      ::close(in);
      ::close(out);
      forked = true;
      on_exit(leave, nullptr);
      return true;
    }
    tell(out, child);
    int status = 0;
    while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    tell(out, status);
  }
  _exit(0);
}

}  // namespace supple::stress

/// Called for each library as a process ends. Some wait for threads that they started as they were loaded, which a forked process does not have.
extern "C" void __cxa_finalize(void* object) {  // NOLINT(bugprone-reserved-identifier)
  if (supple::stress::forked) return;
  reinterpret_cast<void (*)(void*)>(dlsym(RTLD_NEXT, "__cxa_finalize"))(object);
}
