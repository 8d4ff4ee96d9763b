// A scene file: read and checked, as `supple check` does, with less memory and time, so that large scenes end early.
#include <string>

#include "fuzz_target.h"
#include "supple/scenes/check.h"
#include "supple/scenes/read_scene.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr double kMemory = 2e7, kSeconds = 0.1;
  return supple::fuzz::used_or_refused([&] {
    const supple::scenes::Scene scene = supple::scenes::parse_scene(std::string(reinterpret_cast<const char*>(data), size), "fuzz.yaml", supple::fuzz::scratch());
    (void)supple::scenes::check_scene(scene, {.threads = 1}, kMemory, kSeconds);
  });
}
