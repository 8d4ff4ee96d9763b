#include "output/files/saved_frames.h"

#include "output/files/output_files.h"
#include "supple/core/error.h"
#include "supple/scenes/run.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

constexpr const char* kOtherwise =
    "or run the scene again: supple run --overwrite, or start a variation from a frame N of this run: supple run SCENE --from-frame N --from THIS_FOLDER --out ANOTHER";

}  // namespace

std::optional<SavedRange> saved_range(const fs::path& folder, const std::string& name, int frame_count) {
  const auto there = [&](int frame) { return fs::exists(state_path(folder, name, frame)); };
  int last = frame_count, first = 1;
  while (last >= 1 && !there(last)) --last;
  if (last < 1) return std::nullopt;
  while (!there(first)) ++first;
  return SavedRange{first, last};
}

std::vector<int> saved_frames(const fs::path& folder, const Scene& scene, const std::set<int>& wanted) {
  const std::string name = scene_name(scene);
  const auto saved = saved_range(folder, name, scene.frame_count());
  std::vector<int> frames;
  for (int frame = saved ? saved->first : 1; saved && frame <= saved->last; ++frame) {
    if ((wanted.empty() || wanted.contains(frame)) && fs::exists(state_path(folder, name, frame))) frames.push_back(frame);
  }
  if (!frames.empty()) return frames;
  throw Error(ErrorKind::Io, Fault{.place = (folder / "states").string(),
                                   .key = {},
                                   .expected = "expected saved states of '" + name + (wanted.empty() ? "'" : "' at the requested frames"),
                                   .found = "none",
                                   .hint = "run the scene first: supple run SCENE --out FOLDER"});
}

State load_frame(const fs::path& folder, const Scene& scene, int frame) {
  const fs::path path = state_path(folder, scene_name(scene), frame);
  if (!fs::exists(path)) {
    throw Error(ErrorKind::Io, Fault{.place = path.string(),
                                     .key = {},
                                     .expected = "expected the saved state of frame " + std::to_string(frame),
                                     .found = "none",
                                     .hint = "`supple run --resume` computes it from the last one before it"});
  }
  return load_state(path, origin_of(scene), {.frame = frame, .otherwise = kOtherwise});
}

std::optional<State> usable_frame(const fs::path& folder, const Scene& scene, int frame, UnusableFrames& unusable) {
  const fs::path path = state_path(folder, scene_name(scene), frame);
  if (!fs::exists(path)) {
    unusable.lost.push_back(frame);
    return std::nullopt;
  }
  try {
    return load_state(path, origin_of(scene), {.frame = frame, .same_program = true, .otherwise = kOtherwise});
  } catch (const DamagedState&) {
    unusable.damaged.push_back(frame);
    return std::nullopt;
  }
}

std::vector<std::string> UnusableFrames::sentences() const {
  std::vector<std::string> text;
  for (const auto& [frames, why] : {std::pair{&lost, "lost"}, {&damaged, "damaged"}}) {
    if (frames->empty()) continue;
    const bool one = frames->size() == 1;
    text.push_back(frames_text(*frames) + (one ? " is simulated again: its saved state is " : " are simulated again: their saved states are ") + why);
  }
  return text;
}

std::string frames_text(const std::vector<int>& frames) {
  std::string text = frames.size() == 1 ? "frame " : "frames ";
  for (std::size_t i = 0; i < frames.size();) {
    std::size_t end = i + 1;
    while (end < frames.size() && frames[end] == frames[end - 1] + 1) ++end;
    text += (i == 0 ? "" : ", ") + std::to_string(frames[i]);
    if (end - i > 1) text += '-' + std::to_string(frames[end - 1]);
    i = end;
  }
  return text;
}

}  // namespace supple::scenes
