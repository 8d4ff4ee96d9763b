/// How the programs of the command line begin and end.
#pragma once

#include <atomic>

namespace supple::tool {

/// The first signal that asked for an end; 0: none. The first one ends the work at its next check, a second one ends the program.
extern std::atomic<int> interrupted;

/// @param silent  standard output is closed: text that only accompanies files is not printed   @return the exit code
using ProgramBody = int (*)(int argc, char** argv, bool silent);

/// Handles signals, calls the body and turns what it throws into a message and an exit code.
/// @return the exit code of the program
int run_program(int argc, char** argv, ProgramBody body);

}  // namespace supple::tool
