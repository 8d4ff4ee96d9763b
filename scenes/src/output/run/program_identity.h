/// Identity of the running build: files of another build may differ in the last bit.
#pragma once

#include <string>

namespace supple::scenes {

/// The build id that the linker put into the program, or into the Python module; its version where there is none.
[[nodiscard]] std::string program_identity();

}  // namespace supple::scenes
