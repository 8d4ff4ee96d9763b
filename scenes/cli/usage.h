/// Unknown words of the command line.
#pragma once

#include <CLI/CLI.hpp>
#include <span>

namespace supple::tool {

/// @param words  the command line without the name of the program
/// @throws Error{Usage} for the first unknown command or option, with the nearest known one or all
void expect_known_words(const CLI::App& app, std::span<char* const> words);

}  // namespace supple::tool
