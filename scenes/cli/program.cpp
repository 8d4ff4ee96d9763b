#include "program.h"

#include <sys/time.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <iostream>
#include <new>
#include <string_view>

#include "last_resort.h"
#include "print.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "supple/core/io/descriptor.h"
#include "supple/core/io/open_temporaries.h"
#include "supple/scenes/run.h"

namespace supple::tool {

std::atomic<int> interrupted{0};

namespace {

constexpr int kSignalExit = 128;

double seconds_of(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// When the program was interrupted: of the clock and of its processor time [s].
double interrupted_at = 0.0, interrupted_after = 0.0;

/// Ends the program as a kill does where its work has not ended within a second, as inside a library it may not: all that is complete on the disk stays, and temporary files go. On a busy
/// machine work that has had little processor time gets ten seconds.
void end_if_late(int /*number*/) {
  constexpr double kSoon = 0.8, kLate = 10.0, kWork = 0.5;
  const double waited = seconds_of(CLOCK_MONOTONIC) - interrupted_at;
  if (waited < kSoon || (waited < kLate && seconds_of(CLOCK_PROCESS_CPUTIME_ID) - interrupted_after < kWork)) return;
  constexpr std::string_view kMessage = "interrupted, in the middle of a calculation\n";
  (void)!write(STDERR_FILENO, kMessage.data(), kMessage.size());
  io::remove_open_temporaries();
  _exit(kSignalExit + interrupted);
}

/// The timer is neither inherited by programs that are started nor needed without a signal.
void on_signal(int number) {
  interrupted = number;
  std::signal(number, SIG_DFL);
  interrupted_at = seconds_of(CLOCK_MONOTONIC);
  interrupted_after = seconds_of(CLOCK_PROCESS_CPUTIME_ID);
  constexpr timeval kLook{.tv_sec = 0, .tv_usec = 50'000};
  const itimerval often{.it_interval = kLook, .it_value = kLook};
  setitimer(ITIMER_REAL, &often, nullptr);
}

void ignore(int /*number*/) {}

/// Handlers instead of SIG_IGN for pipes that are closed at the other end and for files that exceed the limit of the system, as programs that
/// are started would inherit that: the call fails.
void heed_signals() {
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  std::signal(SIGALRM, end_if_late);
  std::signal(SIGPIPE, ignore);
  std::signal(SIGXFSZ, ignore);
}

/// @throws Error{Io} where the output could not be written
void flush_output() {
  if (std::cout.flush().good()) return;
  throw Error(ErrorKind::Io, Fault{.place = "standard output", .key = {}, .expected = "cannot be written", .found = {}, .hint = {}});
}

/// @return the exit code
int call(int argc, char** argv, bool silent, ProgramBody body) {
  try {
    const InterruptScope scope(&interrupted);
    const int code = body(argc, argv, silent);
    flush_output();
    return code;
  } catch (const Error& error) {
    std::cout.flush();
    std::cerr << error.what() << '\n';
    return static_cast<int>(error.kind());
  } catch (const Interrupted&) {
    std::cerr << "interrupted by signal " << interrupted << '\n';
    return kSignalExit + interrupted;
  } catch (const std::filesystem::filesystem_error& error) {
    std::cerr << printable_lines(error.what()) << '\n';
    return static_cast<int>(ErrorKind::Io);
  } catch (const std::bad_alloc&) {
    std::cerr << scenes::kOutOfMemory << '\n';
    return static_cast<int>(ErrorKind::Limit);
  } catch (const std::exception& error) {
    std::cerr << "internal fault: " << error.what() << '\n';
    return static_cast<int>(ErrorKind::Internal);
  }
}

}  // namespace

int run_program(int argc, char** argv, ProgramBody body) {
  heed_signals();
  // Before any file is opened: it would get the number of a closed standard stream, and the text that is printed there.
  const bool silent = io::occupy_standard_descriptors()[STDOUT_FILENO];
  std::signal(SIGCHLD, SIG_DFL);  // our parent may ignore it, which hides how ffmpeg ends
  std::ios::sync_with_stdio(false);
  prepare_last_resort();
  const int code = call(argc, argv, silent, body);
  // After running out of memory, arrays of Eigen may hold freed memory: data of threads is not destroyed.
  if (code == static_cast<int>(ErrorKind::Limit)) {
    std::cout.flush();
    std::_Exit(code);
  }
  return code;
}

}  // namespace supple::tool
