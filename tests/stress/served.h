/// A preloaded library as server of runs: the program is started and linked once, and forked for each run before its main.
///   SUPPLE_SERVE   two descriptors, "IN OUT". Each line `NUMBER WORD` that comes through IN makes one run; its process and then its status,
///                  as waitpid gives it, go to OUT as lines. The end of IN ends the server.
#pragma once

#include <array>

namespace supple::stress {

struct Request {
  long number = 0;
  std::array<char, 16> word{};
};

/// To be called before anything of the program runs, with one thread of its own. Does nothing without SUPPLE_SERVE; with it, it returns in the process of each run.
/// @return whether `request` was set
bool serve(Request& request);

}  // namespace supple::stress
