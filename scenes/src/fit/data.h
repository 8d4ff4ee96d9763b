/// @file data.h
/// What all readers of data share: refusals and the kinds of files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "supple/core/error.h"

namespace supple::fit {

/// What a file holds, by its extension, and of .ply by its header.
enum class DataKind : std::uint8_t { Mesh, Points, Volume };

/// @throws Error{Usage} for other extensions, Error{Io} for files that are absent
[[nodiscard]] DataKind kind_of(const std::filesystem::path& file);

/// The extension in lower case; .nii.gz is one.
[[nodiscard]] std::string extension_of(const std::filesystem::path& file);

[[noreturn]] void refuse(const std::filesystem::path& file, std::string expected, std::string found, std::string hint, ErrorKind kind = ErrorKind::Scene);

/// The index of the piece that is number `which` by size, counted from the largest, equal ones in order. @throws Error{Usage} where there are fewer
[[nodiscard]] std::size_t piece_of(const std::filesystem::path& file, const std::vector<double>& size, std::uint32_t which);

/// What to do about several pieces.
inline constexpr const char* kPiecesHint = "choose the largest by --pieces largest, others by --pieces 2 and so on";

/// A number in a message.
[[nodiscard]] std::string short_number(double value);

}  // namespace supple::fit
