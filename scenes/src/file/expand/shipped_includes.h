/// @file shipped_includes.h
/// Files that every scene can include by name: `include: supple:materials`.
#pragma once

#include <optional>
#include <string_view>

namespace supple::scenes {

inline constexpr std::string_view kShippedPrefix = "supple:";
inline constexpr std::string_view kShippedMaterials = "supple:materials";

/// The text of a shipped file; none of another name.
[[nodiscard]] std::optional<std::string_view> shipped_include(std::string_view name);

}  // namespace supple::scenes
