#include "scene_places.h"

namespace supple::scenes {

std::string place_of(const Scene& scene, std::string_view key) {
  if (scene.places == nullptr) return scene.source.string();
  return scene.places->texts.place(mark_of(*scene.places->root, key));
}

}  // namespace supple::scenes
