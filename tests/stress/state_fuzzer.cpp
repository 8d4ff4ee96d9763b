#include <algorithm>
#include <array>
#include <memory>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include "fuzzers.h"
#include "scene_mutations.h"
#include "supple/scenes/read_scene.h"
#include "supple/scenes/run.h"
#include "supple/scenes/simulation.h"
#include "supple/scenes/state.h"

namespace supple::stress {
namespace {

namespace fs = std::filesystem;

constexpr int kFrames = 3;

struct Saved {
  std::string bytes;
  scenes::StateOrigin origin;
  std::uint64_t hash = 0;
  std::int32_t frame = 0;
};

/// Contact, links that break with samples, and bodies that sleep.
constexpr std::array kScenes{"contacts/two_balls", "objects/plate_breaks", "contacts/pile_rests"};

class StateFuzzer {
 public:
  explicit StateFuzzer(FuzzSettings settings) : settings_(std::move(settings)) {
    const fs::path path = settings_.scratch / "seed.state";
    for (const char* name : kScenes) {
      scenes::Simulation simulation(scenes::read_scene(settings_.sources / "scenes/library" / (std::string(name) + ".yaml")));
      const scenes::StateOrigin origin = scenes::origin_of(simulation.scene());
      for (int frame = 1; frame <= kFrames; ++frame) {
        if (frame > 1) simulation.step_frame();
        scenes::save_state(path, simulation.state(), origin);
        saved_.push_back({file_text(path), origin, simulation.state_hash(), frame});
      }
    }
  }

  [[nodiscard]] Trial trial(std::uint64_t number) const {
    const std::pair<const Saved*, std::string> made = make(number);
    const Saved* const saved = made.first;  // clang 14 has no lambdas that use parts of a structured binding
    const std::string& bytes = made.second;
    const fs::path path = settings_.scratch / "fuzz.state";
    write_text(path, bytes);
    std::string fault;
    Trial trial = judged("fuzz.state", [&] {
      try {
        const scenes::State state = scenes::load_state(path, saved->origin);
        // The end of another state may be all of it.
        const bool known = std::any_of(saved_.begin(), saved_.end(), [&bytes, &state](const Saved& s) {
          return s.bytes == bytes && s.hash == state.hash() && s.frame == state.frame;
        });
        if (!known) fault = "a state that is not what was saved was read without a word";
      } catch (const Error& error) {
        if (error.kind() != ErrorKind::Corrupt) fault = std::string("not refused as corrupt: ") + error.what();
        throw;
      }
    });
    if (trial.fault.empty()) trial.fault = fault;
    return trial;
  }

  [[nodiscard]] fs::path keep(const FoundFault& found) const {
    const fs::path path = settings_.scratch / ("state_" + std::to_string(settings_.seed) + '_' + std::to_string(found.number) + ".state");
    write_text(path, make(found.number).second);
    return path;
  }

 private:
  [[nodiscard]] std::pair<const Saved*, std::string> make(std::uint64_t number) const {
    Random random(settings_.seed, number);
    const Saved& saved = random.of(saved_);
    std::string bytes = saved.bytes;
    const std::size_t at = random.below(random.one_in(4) ? 64 : bytes.size());
    switch (random.below(8)) {
      case 0:
      case 1:
      case 2: bytes[at] = static_cast<char>(static_cast<unsigned char>(bytes[at]) ^ (1U << random.below(8))); break;
      case 3: bytes.resize(random.below(bytes.size())); break;
      case 4: bytes.append(1 + random.below(64), static_cast<char>(random.below(256))); break;
      case 5: {  // two parts change places
        const std::size_t other = random.below(bytes.size()), length = random.below(64);
        for (std::size_t k = 0; k < length && at + k < bytes.size() && other + k < bytes.size(); ++k) std::swap(bytes[at + k], bytes[other + k]);
        break;
      }
      case 6: {  // the end of another state
        const std::string& other = random.of(saved_).bytes;
        bytes = bytes.substr(0, at) + other.substr(std::min(at, other.size()));
        break;
      }
      default: bytes[at] = static_cast<char>(random.below(256)); break;
    }
    return {&saved, bytes};
  }

  FuzzSettings settings_;
  std::vector<Saved> saved_;
};

std::string frame_list(std::uint64_t seed, std::uint64_t number) {
  static const std::vector<std::string> parts{"1", "50", "60", "0", "-", ":", ",", " ", "1000001", "1000002", "2147483647", "2147483648", "-1", "99999999999999999999", "+1", "1e3", "a", "\t",
                                              "1-50", "70-90:2", ":0", ":1000000"};
  Random random(seed, number);
  std::string text;
  for (std::size_t left = random.below(9); left > 0; --left) text += random.of(parts);
  return text;
}

}  // namespace

Fuzzer state_fuzzer(const FuzzSettings& settings) {
  const auto fuzzer = std::make_shared<StateFuzzer>(settings);
  return {{}, [fuzzer](std::uint64_t number) { return fuzzer->trial(number); }, [fuzzer](const FoundFault& found) { return fuzzer->keep(found); }};
}

Fuzzer frames_fuzzer(const FuzzSettings& settings) {
  const auto trial = [settings](std::uint64_t number) {
    const std::string text = frame_list(settings.seed, number);
    std::string fault;
    Trial done = judged("--frames", [&] {
      try {
        const std::set<int> frames = scenes::parse_frames(text);
        if (frames.empty() || *frames.begin() < 1) fault = "frames that are none were read from '" + text + '\'';
      } catch (const Error& error) {
        if (error.kind() != ErrorKind::Usage) fault = std::string("not refused as usage: ") + error.what();
        throw;
      }
    });
    if (done.fault.empty()) done.fault = fault;
    return done;
  };
  const auto keep = [settings](const FoundFault& found) {
    const fs::path path = settings.scratch / ("frames_" + std::to_string(found.number) + ".txt");
    write_text(path, frame_list(settings.seed, found.number));
    return path;
  };
  return {{}, trial, keep};
}

}  // namespace supple::stress
