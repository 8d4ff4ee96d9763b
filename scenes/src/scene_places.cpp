#include "scene_places.h"

namespace supple::scenes {

std::string place_of(const Scene& scene, std::string_view key) {
  if (scene.places == nullptr) return scene.source.string();
  return scene.places->texts.place(mark_of(*scene.places->root, key));
}

void rethrow_with_places(const Scene& scene, const Error& error) {
  std::vector<Fault> faults = error.faults();
  for (Fault& fault : faults) {
    if (fault.place.empty()) fault.place = place_of(scene, fault.key);
  }
  throw Error(error.kind(), std::move(faults));
}

}  // namespace supple::scenes
