#include <algorithm>
#include <chrono>
#include <memory>
#include <utility>
#include <vector>

#include "fuzzers.h"
#include "scene_mutations.h"
#include "supple/scenes/read_scene.h"

namespace supple::stress {
namespace {

namespace fs = std::filesystem;

constexpr int kTriesToMinimise = 200;
constexpr std::chrono::seconds kTimeToMinimise{30};  // of one fault
constexpr const char* kName = "fuzz.yaml";

struct Origin {
  fs::path file;
  std::string text;
  std::optional<Value> value;
};

struct Input {
  const Origin* origin = nullptr;
  std::optional<Value> value;  ///< what the text was printed from
  std::string text;
};

std::vector<Origin> origins_in(const fs::path& folder) {
  std::vector<Origin> origins;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.path().extension() == ".yaml") origins.push_back({entry.path(), file_text(entry.path()), {}});
  }
  std::sort(origins.begin(), origins.end(), [](const Origin& a, const Origin& b) { return a.file < b.file; });
  for (Origin& origin : origins) origin.value = parse_value(origin.text);
  return origins;
}

class SceneFuzzer {
 public:
  explicit SceneFuzzer(FuzzSettings settings) : settings_(std::move(settings)), vocabulary_(scene_vocabulary()) {
    library_ = origins_in(settings_.sources / "scenes/library");
    golden_ = origins_in(settings_.sources / "tests/golden/messages");
  }

  [[nodiscard]] Trial trial(std::uint64_t number) const {
    const Input input = make(number);
    return look(input.text, input.origin->file.parent_path());
  }

  [[nodiscard]] fs::path keep(const FoundFault& found) const {
    Input input = make(found.number);
    const fs::path folder = input.origin->file.parent_path();
    const std::string kind = found.what.substr(0, found.what.find(':'));
    if (input.value) {
      const auto begin = std::chrono::steady_clock::now();
      const auto fails = [&](const Value& value) {
        if (std::chrono::steady_clock::now() - begin > kTimeToMinimise) return false;
        const Tally tally = watch(0, 1, limits(), settings_.scratch / "minimise.log", [&](std::uint64_t) { return look(print_value(value), folder); });
        return !tally.faults.empty() && tally.faults.front().what.substr(0, tally.faults.front().what.find(':')) == kind;
      };
      // Faults that take a minute to show are kept as they are.
      const bool quick = found.what != kAsItIs && !found.what.starts_with("more than") && !found.what.starts_with("no end");
      input.text = print_value(minimise(std::move(*input.value), quick ? kTriesToMinimise : 0, fails));
    }
    const fs::path path = settings_.scratch / ("scene_" + std::to_string(settings_.seed) + '_' + std::to_string(found.number) + ".yaml");
    write_text(path, input.text);
    return path;
  }

  [[nodiscard]] static Limits limits() { return {}; }

 private:
  [[nodiscard]] Input make(std::uint64_t number) const {
    Random random(settings_.seed, number);
    Input input;
    // Three in four from the library: those of messages are wrong from the start.
    input.origin = &random.of(random.one_in(4) ? golden_ : library_);
    if (input.origin->value && !random.one_in(5)) {
      input.value = input.origin->value;
      mutate(*input.value, vocabulary_, random);
      input.text = print_value(*input.value);
    } else {
      input.text = mutate_text(input.origin->text, random);
    }
    return input;
  }

  [[nodiscard]] Trial look(const std::string& text, const fs::path& folder) const {
    std::optional<scenes::Scene> scene;
    Trial trial = judged(kName, [&] {
      scene = scenes::parse_scene(text, kName, folder);
      check_scene(*scene);
    });
    if (trial.refused || !trial.fault.empty()) return trial;
    std::string fault;
    const Trial run = judged(kName, [&] { fault = run_two_frames(*scene, settings_.scratch / "scene_run"); });
    // The check let this scene pass: only crashes and broken contracts are faults of its run, refusals are not.
    trial.fault = run.refused ? fault : run.fault + fault;
    return trial;
  }

  FuzzSettings settings_;
  Vocabulary vocabulary_;
  std::vector<Origin> library_, golden_;
};

}  // namespace

Fuzzer scene_fuzzer(const FuzzSettings& settings) {
  const auto fuzzer = std::make_shared<SceneFuzzer>(settings);
  return {SceneFuzzer::limits(), [fuzzer](std::uint64_t number) { return fuzzer->trial(number); },
          [fuzzer](const FoundFault& found) { return fuzzer->keep(found); }};
}

}  // namespace supple::stress
