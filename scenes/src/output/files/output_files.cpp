#include "output/files/output_files.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "simulation/frame.h"
#include "supple/core/cpu_time.h"
#include "supple/core/io/atomic_file.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

/// A subfolder of results; its files are NAME.0001.EXTENSION, or NAME.WHAT.0001.EXTENSION.
struct Part {
  const char* folder;
  bool of_several;  ///< cameras, objects, or tables of pairs
  std::array<std::string_view, 2> extensions;
};
constexpr std::array kParts = {Part{"states", false, {".state"}},        Part{"frames", true, {".png", ".exr"}},
                               Part{"meshes", true, {".ply", ".obj"}},   Part{"searches", false, {".json"}},
                               Part{"grids", false, {".vdb"}},           Part{"contacts", true, {".csv", ".vtp"}},
                               Part{"particles", false, {".csv", ".vtp"}}, Part{"samples", false, {".csv", ".vtp"}}};

/// "NAME" of "NAME.0001.EXTENSION" with an extension of the part; empty: no file that frames have there.
std::string stem_of_frame(const Part& part, const fs::path& file) {
  const std::string extension = file.extension().string();
  const std::string numbered = file.stem().string(), number = file.stem().extension().string();
  if (extension.empty() || std::find(part.extensions.begin(), part.extensions.end(), extension) == part.extensions.end()) return {};
  if (number.size() < 5 || number.find_first_not_of("0123456789", 1) != std::string::npos) return {};
  return numbered.substr(0, numbered.size() - number.size());
}

template <class Use>
void for_each_file(const fs::path& folder, const Use& use) {
  if (!fs::is_directory(folder)) return;  // throws where the kind of the file is unknown
  for (const auto& entry : fs::directory_iterator(folder)) use(entry.path());
}

}  // namespace

std::string numbered(const std::string& name, int frame, const std::string& extension) {
  std::array<char, 16> digits{};
  std::snprintf(digits.data(), digits.size(), ".%04d", frame);
  return name + digits.data() + extension;
}

StageClock::StageClock(StageProfile& profile) : profile_(profile), begin_(process_cpu_seconds()) { ++profile.calls; }
StageClock::~StageClock() { profile_.cpu_s += process_cpu_seconds() - begin_; }

fs::path state_path(const fs::path& folder, const std::string& name, int frame) {
  return folder / "states" / numbered(name, frame, ".state");
}

fs::path frame_path(const fs::path& folder, const std::string& name, int frame) {
  return folder / "frames" / numbered(name, frame, ".png");
}

void remove_temporaries(const fs::path& folder, const std::string& name) {
  std::vector<fs::path> left;
  const auto look = [&](const fs::path& path) {
    const std::string file = path.filename().string();
    const bool ours = file.starts_with('.' + name + '.') || file.starts_with('.' + name + '_') ||
                      file.starts_with(".probe.") ||
                      file.starts_with(".result.json.") || file.starts_with(".render.json.") || file.starts_with(".export.json.");
    if (ours && file.ends_with(".tmp")) left.push_back(path);
  };
  for_each_file(folder, look);
  for (const Part& part : kParts) for_each_file(folder / part.folder, look);
  std::error_code ignored;
  for (const fs::path& path : left) fs::remove_all(path, ignored);  // a film is made in a folder
}

std::set<std::string> saved_scenes(const fs::path& folder) {
  std::set<std::string> names;
  const Part& states = kParts[0];
  for_each_file(folder / states.folder, [&](const fs::path& path) {
    const std::string stem = stem_of_frame(states, path.filename());
    if (!stem.empty()) names.insert(stem);
  });
  return names;
}

void remove_outputs(const fs::path& folder, const std::string& name) {
  std::vector<fs::path> old;
  std::set<std::string> shown{name};  // as films are called
  for (const Part& part : kParts) {
    for_each_file(folder / part.folder, [&](const fs::path& path) {
      const std::string stem = stem_of_frame(part, path.filename());
      if (stem != name && !(part.of_several && stem.starts_with(name + '.'))) return;
      old.push_back(path);
      if (part.folder == std::string_view("frames")) shown.insert(stem);
    });
  }
  for (const std::string& stem : shown) {
    for (const char* end : {".mp4", "_sheet.png"}) old.push_back(folder / (stem + end));
  }
  for (const char* end : {".usda", ".glb", "_view.html", "_particles.pvd", "_contacts.pvd", "_pairs.pvd", "_samples.pvd"}) old.push_back(folder / (name + end));
  for (const char* report : {"result.json", "render.json", "export.json", "origin.json"}) old.push_back(folder / report);
  std::error_code ignored;
  for (const fs::path& path : old) fs::remove(path, ignored);
}

}  // namespace supple::scenes
