/// @file measures.h
/// Columns of the table of a sweep.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "supple/scenes/sweep.h"

namespace supple::scenes {

/// Checks the measures of a plan against its scene at the first point. @throws Error{Scene}
void check_measures(const SweepPlan& plan);

/// The values of a finished run, in the order of the measures. @param folder  of the run   @throws Error
[[nodiscard]] nlohmann::ordered_json measure_run(const SweepPlan& plan, const SweepPoint& point, const std::filesystem::path& folder);

}  // namespace supple::scenes
