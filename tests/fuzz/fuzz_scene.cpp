// A scene file: read and checked, as `supple check` does.
#include <string>

#include "fuzz_target.h"
#include "supple/scenes/check.h"
#include "supple/scenes/read_scene.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return supple::fuzz::used_or_refused([&] {
    const supple::scenes::Scene scene = supple::scenes::parse_scene(std::string(reinterpret_cast<const char*>(data), size), "fuzz.yaml", supple::fuzz::scratch());
    (void)supple::scenes::check_scene(scene, {.threads = 1});
  });
}
