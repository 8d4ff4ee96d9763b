/// @file tests/support/source_dir.h
#pragma once

#include <filesystem>

namespace supple {

/// Root of the source tree. In a file of its own, so that no other object file depends on the location of the tree.
std::filesystem::path source_dir();

}  // namespace supple
