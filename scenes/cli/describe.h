/// The command line described for shells and for `man`, from the options themselves.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace supple::tool {

/// Completion of commands, options, their choices and files; to be read by the shell (`source <(supple describe bash)`).
[[nodiscard]] std::string bash_completion(const CLI::App& app);
[[nodiscard]] std::string zsh_completion(const CLI::App& app);

/// A page for `man`, section 1.
[[nodiscard]] std::string man_page(const CLI::App& app, const std::string& version);

}  // namespace supple::tool
