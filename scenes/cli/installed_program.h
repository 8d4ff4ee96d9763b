/// Programs that are built on request and belong to the tool.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace supple::tool {

/// Where the program of this name is: beside the tool in a build and in the Python package, in libexec/supple where installed. Empty: none.
[[nodiscard]] std::filesystem::path installed_program(const std::string& name);

/// Replaces this process by the program. @param words  its arguments   @throws Error{Io} where it cannot be started
[[noreturn]] void become_program(const std::filesystem::path& program, std::vector<std::string> words);

}  // namespace supple::tool
