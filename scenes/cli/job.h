/// `supple job`.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "supple/scenes/job.h"

namespace supple::tool {

struct JobArguments {
  std::string scene;             ///< or the folder of a sweep
  std::vector<std::string> set;
  std::vector<std::filesystem::path> allowed;
  std::string format, out, folder;
  scenes::JobOptions options;
};

/// Adds the command with its options.
CLI::App* add_job(CLI::App& app, JobArguments& arguments);

/// @return the exit code
int write_job(const JobArguments& arguments);

}  // namespace supple::tool
