#include "program.h"

#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <new>

#include "last_resort.h"
#include "print.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "supple/core/io/descriptor.h"
#include "supple/scenes/run.h"

namespace supple::tool {

std::atomic<int> interrupted{0};

namespace {

constexpr int kSignalExit = 128;

void on_signal(int number) {
  interrupted = number;
  std::signal(number, SIG_DFL);
}

void ignore(int /*number*/) {}

/// A handler instead of SIG_IGN for pipes that are closed at the other end, as programs that are started would inherit that.
void heed_signals() {
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  std::signal(SIGPIPE, ignore);
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
