/// Identity of the running build: files of another build may differ in the last bit.
#pragma once

#include <string>

namespace supple::scenes {

/// The build id that the linker put into the program, or into the Python module, as hexadecimal digits; its version
/// where there is none. One line of text: the lock of a folder that several processes draw into holds it as a line.
[[nodiscard]] std::string program_identity();

}  // namespace supple::scenes
