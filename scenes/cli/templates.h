/// Scenes that `supple new` begins with.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace supple::tool {

struct Template {
  std::string_view name;
  std::string_view meaning;
  std::string_view text;  ///< a complete scene; @TITLE@ stands for its title
};

[[nodiscard]] std::span<const Template> templates();

/// Writes NAME.yaml from a template, and says what to do next. @param name  of the scene, with or without folder and extension
/// @return the path
/// @throws Error{Usage} for an unknown template; Error{Io} where the file exists or cannot be written
std::string write_new_scene(const std::string& name, const std::string& from);

}  // namespace supple::tool
