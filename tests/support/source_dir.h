/// @file tests/support/source_dir.h
#pragma once

#include <filesystem>

namespace supple {

/// The top of the source tree. Alone in a file of its own, so that all others compile alike wherever the tree lies.
std::filesystem::path source_dir();

}  // namespace supple
