/// @file supple/core/io/atomic_file.h
/// Files that exist are complete: content goes to a temporary name beside the target and is renamed when it is whole.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

namespace supple::io {

/// Writes `bytes` under `path` by temporary file, fsync and rename.
/// @throws Error{Io} naming the path and the system's reason; nothing is left under either name then.
void write_atomically(const std::filesystem::path& path, std::span<const std::byte> bytes);
void write_atomically(const std::filesystem::path& path, std::string_view text);

/// The whole file. @throws Error{Io} when it cannot be read, Error{Limit} when it is larger than `limit` bytes.
[[nodiscard]] std::vector<std::byte> read_file(const std::filesystem::path& path, std::size_t limit);

/// Creates the folder (and its parents) and checks that files can be made in it. @throws Error{Io} otherwise.
void make_writable_folder(const std::filesystem::path& path);

}  // namespace supple::io
