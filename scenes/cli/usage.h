/// Words of the command line that the tool does not know.
#pragma once

#include <CLI/CLI.hpp>
#include <span>

namespace supple::tool {

/// @param words  the command line without the name of the program
/// @throws Error{Usage} for the first word that is no command or option where one belongs, with the nearest known one or all
void expect_known_words(const CLI::App& app, std::span<char* const> words);

}  // namespace supple::tool
