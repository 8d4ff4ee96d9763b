/// @file tests/support/temp_folder.h
#pragma once

#include <filesystem>

namespace supple {

/// A folder of this process alone, so that tests that run at the same time do not share files. Made at the first call,
/// removed with all that is in it when the process ends.
const std::filesystem::path& temp_folder();

}  // namespace supple
