// A scene file: read, with all that it names.
#include <string>

#include "fuzz_target.h"
#include "supple/scenes/read_scene.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return supple::fuzz::used_or_refused(
      [&] { (void)supple::scenes::parse_scene(std::string(reinterpret_cast<const char*>(data), size), "fuzz.yaml", supple::fuzz::scratch()); });
}
