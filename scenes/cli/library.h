/// The scenes that come with the program.
#pragma once

#include <string>

namespace supple::tool {

/// A file as it is given or, where there is none, the scene of the library with this name: "two_balls" or "contacts/two_balls", with or
/// without ".yaml". Names of neither are returned as they are, for the message of the reader.
[[nodiscard]] std::string find_scene(const std::string& name);

/// One line for each scene of the library: its name and its title. @throws Error{Io} where the library is not installed
[[nodiscard]] std::string list_library();

}  // namespace supple::tool
