// A saved state with changes and a right checksum, so that what reads the content is reached. The input is a list of changes: 4 bytes of a
// position and 8 bytes to write there; a position of all ones cuts the state off at the place that follows.
#include <algorithm>
#include <cstring>
#include <limits>
#include <vector>

#include "fuzz_target.h"
#include "supple/core/hash.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/simulation.h"
#include "supple/scenes/state_bytes.h"

namespace {

using namespace supple;

/// Contact, links that break and bodies that sleep, so that every part of a state is there.
constexpr const char* kScene = R"(schema: 1
duration: 1
gravity: [0, 0, -9.81]
sleep: true
objects:
  - name: chain
    particles: {arrange: line, count: 3, spacing: 0.2, at: [0, 0, 0.24]}
    interactions: [{law: bond_frame, stretch: 500, rotation: 1}]
    breaking: {stretch: 0.5}
    skeleton: [{shape: point, kernel: {radius: 0.3}}]
    contact: {friction: 0.3}
ground: {height: 0}
)";

struct Seed {
  scenes::StateOrigin origin;
  std::vector<std::byte> content;  // without the checksum
};

const Seed& seed() {
  static const Seed one = [] {
    scenes::Simulation simulation(scenes::parse_scene(kScene, "seed.yaml", "."), {.threads = 1});
    simulation.step_frame();
    Seed made{scenes::origin_of(simulation.scene()), {}};
    made.content = scenes::state_bytes(simulation.state(), made.origin);
    made.content.resize(made.content.size() - sizeof(std::uint64_t));
    return made;
  }();
  return one;
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::size_t kChange = sizeof(std::uint32_t) + sizeof(std::uint64_t);
  std::vector<std::byte> state = seed().content;
  for (std::size_t k = 0; k + kChange <= size && !state.empty(); k += kChange) {
    std::uint32_t at = 0;
    std::uint64_t value = 0;
    std::memcpy(&at, data + k, sizeof at);
    std::memcpy(&value, data + k + sizeof at, sizeof value);
    if (at == std::numeric_limits<std::uint32_t>::max()) {
      state.resize(value % (state.size() + 1));
    } else {
      at %= static_cast<std::uint32_t>(state.size());
      std::memcpy(state.data() + at, &value, std::min(sizeof value, state.size() - at));
    }
  }
  const std::uint64_t check = hash_bytes(state);
  const auto* const bytes = reinterpret_cast<const std::byte*>(&check);
  state.insert(state.end(), bytes, bytes + sizeof check);
  return fuzz::used_or_refused([&] { (void)scenes::state_of_bytes("fuzz.state", state, seed().origin); });
}
