#include "watched.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fstream>
#include <new>
#include <string_view>

namespace supple::stress {
namespace {

#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define SUPPLE_SANITIZED  // by clang
#endif
#elif defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SUPPLE_SANITIZED  // by GCC
#endif

#ifdef SUPPLE_SANITIZED
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif

/// Data that the process of the trials shares while it lives; read after its end.
struct Board {
  std::atomic<std::uint64_t> at{0};       ///< the trial at work
  std::atomic<std::uint64_t> tried{0};
  std::atomic<std::uint64_t> refused{0};
};

void fail(const char* what) {
  std::perror(what);
  std::exit(4);
}

void write_all(int file, std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(file, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) std::_Exit(4);
    text.remove_prefix(static_cast<std::size_t>(written));
  }
}

std::string read_all(int file) {
  std::string text;
  char part[4096];
  for (;;) {
    const ssize_t count = ::read(file, part, sizeof part);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return text;
    text.append(part, static_cast<std::size_t>(count));
  }
}

void set_timer(int which, double seconds) {
  itimerval timer{};
  timer.it_value.tv_sec = static_cast<time_t>(seconds);
  timer.it_value.tv_usec = static_cast<suseconds_t>((seconds - std::floor(seconds)) * 1e6);
  setitimer(which, &timer, nullptr);
}

/// Number and text of faults go through the pipe as "NUMBER LENGTH\nTEXT".
[[noreturn]] void run_trials(std::uint64_t first, std::uint64_t end, const Limits& limits, const std::filesystem::path& log, int pipe_end,
                             Board& board, const std::function<Trial(std::uint64_t)>& trial) {
  const int file = ::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (file >= 0) {
    ::dup2(file, STDOUT_FILENO);
    ::dup2(file, STDERR_FILENO);
  }
  if (!kSanitized) {
    const rlimit memory{static_cast<rlim_t>(limits.memory), static_cast<rlim_t>(limits.memory)};
    setrlimit(RLIMIT_AS, &memory);
  }
  const rlimit no_core{0, 0};
  setrlimit(RLIMIT_CORE, &no_core);
  for (std::uint64_t number = first; number < end; ++number) {
    board.at = number;
    set_timer(ITIMER_PROF, limits.processor_s * slowness());
    set_timer(ITIMER_REAL, limits.wall_s * slowness());
    const Trial done = trial(number);
    set_timer(ITIMER_PROF, 0.0);
    set_timer(ITIMER_REAL, 0.0);
    if (!done.fault.empty()) {
      write_all(pipe_end, std::to_string(number) + ' ' + std::to_string(done.fault.size()) + '\n' + done.fault);
    }
    ++board.tried;
    if (done.refused) ++board.refused;
  }
  std::_Exit(0);  // without the destructors of libraries, whose threads a fork does not have
}

void add_faults(std::string_view text, std::vector<FoundFault>& faults) {
  while (!text.empty()) {
    const std::size_t line = text.find('\n');
    const std::size_t blank = text.find(' ');
    if (line == std::string_view::npos || blank > line) return;
    const std::uint64_t number = std::strtoull(std::string(text.substr(0, blank)).c_str(), nullptr, 10);
    const std::size_t length = std::strtoull(std::string(text.substr(blank + 1, line - blank - 1)).c_str(), nullptr, 10);
    faults.push_back({number, std::string(text.substr(line + 1, length))});
    text.remove_prefix(std::min(text.size(), line + 1 + length));
  }
}

std::string cause_of(int status, const Limits& limits) {
  if (WIFEXITED(status)) return "the process ended with exit code " + std::to_string(WEXITSTATUS(status));
  const int number = WTERMSIG(status);
  if (number == SIGPROF) return "more than " + std::to_string(std::lround(limits.processor_s * slowness())) + " s of processor time";
  if (number == SIGALRM) return "no end after " + std::to_string(std::lround(limits.wall_s * slowness())) + " s";
  return "crash by signal " + std::to_string(number) + " (" + strsignal(number) + ')';
}

double processor_now() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// A line of /proc/self/status [byte].
double status_bytes(std::string_view name) {
  std::ifstream file("/proc/self/status");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with(name)) return 1024.0 * std::strtod(line.c_str() + name.size(), nullptr);
  }
  return 0.0;
}

}  // namespace

double slowness() { return kSanitized ? 20.0 : 1.0; }

Tally watch(std::uint64_t first, std::uint64_t count, const Limits& limits, const std::filesystem::path& log,
            const std::function<Trial(std::uint64_t)>& trial) {
  void* memory = mmap(nullptr, sizeof(Board), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) fail("mmap");
  Board& board = *new (memory) Board;
  Tally tally;
  const std::uint64_t end = first + count;
  while (first < end) {
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0) fail("pipe");
    std::fflush(nullptr);
    const pid_t child = fork();
    if (child < 0) fail("fork");
    if (child == 0) {
      ::close(ends[0]);
      run_trials(first, end, limits, log, ends[1], board, trial);
    }
    ::close(ends[1]);
    add_faults(read_all(ends[0]), tally.faults);
    ::close(ends[0]);
    int status = 0;
    while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) break;
    tally.faults.push_back({board.at, cause_of(status, limits)});
    std::fprintf(stderr, "trial %llu: %s\n", static_cast<unsigned long long>(board.at.load()), tally.faults.back().what.c_str());
    ++board.tried;
    first = board.at + 1;
  }
  tally.tried = board.tried;
  tally.refused = board.refused;
  munmap(memory, sizeof(Board));
  return tally;
}

Meter::Meter() {
  std::ofstream file("/proc/self/clear_refs");
  file << "5";  // the peak begins here
  peaks_ = static_cast<bool>(file.flush());
  begin_bytes_ = status_bytes("VmRSS:");
  begin_s_ = processor_now();
}

double Meter::processor_s() const { return processor_now() - begin_s_; }

double Meter::most_bytes() const { return peaks_ ? status_bytes("VmHWM:") - begin_bytes_ : 0.0; }

}  // namespace supple::stress
