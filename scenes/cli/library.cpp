#include "library.h"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <vector>

#include "supple/core/error.h"
#include "supple/scenes/read_scene.h"

namespace supple::tool {
namespace {

namespace fs = std::filesystem;

/// The library, from the place of the program: installed, in the Python package, or in the source tree. Empty: none.
fs::path library_folder() {
  std::error_code failed;
  const fs::path program = fs::read_symlink("/proc/self/exe", failed);
  if (failed) return {};
  const fs::path above = program.parent_path().parent_path();
  for (const fs::path& folder : {above / "share/supple/scenes/library", above / "scenes/library", above.parent_path().parent_path() / "scenes/library"}) {
    if (fs::is_directory(folder, failed)) return folder;
  }
  return {};
}

std::vector<fs::path> library_scenes() {
  std::vector<fs::path> scenes;
  const fs::path folder = library_folder();
  if (folder.empty()) return scenes;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.path().extension() == ".yaml") scenes.push_back(entry.path());
  }
  std::sort(scenes.begin(), scenes.end());
  return scenes;
}

}  // namespace

std::string find_scene(const std::string& name) {
  std::error_code failed;
  if (name.empty() || fs::exists(name, failed) || failed) return name;
  for (const fs::path& scene : library_scenes()) {
    const fs::path below = scene.lexically_relative(library_folder());
    for (fs::path known : {below, below.filename()}) {
      if (name == known.string() || name == known.replace_extension().string()) return scene.string();
    }
  }
  return name;
}

std::string list_library() {
  const std::vector<fs::path> scenes = library_scenes();
  if (scenes.empty()) {
    throw Error(ErrorKind::Io, Fault{.place = "supple scenes", .key = {}, .expected = "expected a library of scenes beside the program", .found = "none", .hint = {}});
  }
  std::size_t width = 0;
  for (const fs::path& scene : scenes) width = std::max(width, scene.stem().string().size());
  std::string text;
  for (const fs::path& scene : scenes) {
    std::string name = scene.stem().string();
    name.resize(width + 2, ' ');
    text += name + scenes::read_scene(scene).title + '\n';
  }
  return text;
}

}  // namespace supple::tool
