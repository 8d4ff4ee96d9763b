#include "file/scene_places.h"

#include <span>

#include "supple/core/io/atomic_file.h"

namespace supple::scenes {

std::string place_of(const Scene& scene, std::string_view key) {
  if (scene.places == nullptr) return scene.source.string();
  return scene.places->texts.place(mark_of(*scene.places->root, key));
}

std::optional<std::string> read_text(const std::filesystem::path& path) {
  std::string text(kLargestText + 1, '\0');
  const auto size = io::read_start(path, std::as_writable_bytes(std::span(text)));
  if (!size) return std::nullopt;
  text.resize(*size);
  return text;
}

void rethrow_with_places(const Scene& scene, const Error& error) {
  std::vector<Fault> faults = error.faults();
  for (Fault& fault : faults) {
    if (fault.place.empty()) fault.place = place_of(scene, fault.key);
  }
  throw Error(error.kind(), std::move(faults));
}

}  // namespace supple::scenes
