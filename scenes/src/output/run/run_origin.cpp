#include "output/run/run_origin.h"

#include <set>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "output/files/output_files.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/core/io/atomic_file.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr std::size_t kLargestOrigin = std::size_t{1} << 20;  // [byte]

/// The saved state of a frame of a run; its scene may have another name than that of the variation.
fs::path start_path(const RunStart& start, const std::string& name) {
  const fs::path own = state_path(start.folder, name, start.frame);
  if (fs::exists(own)) return own;
  const std::set<std::string> names = saved_scenes(start.folder);
  const fs::path other = names.size() == 1 ? state_path(start.folder, *names.begin(), start.frame) : own;
  if (fs::exists(other)) return other;
  throw Error(ErrorKind::Io, Fault{.place = (start.folder / "states").string(),
                                   .key = {},
                                   .expected = "expected the saved state of frame " + std::to_string(start.frame),
                                   .found = names.empty() ? "no states" : "none of this frame",
                                   .hint = "--from-frame takes a frame of an earlier run; --from FOLDER names the folder of that run"});
}

}  // namespace

std::optional<RunOrigin> read_origin(const fs::path& folder) {
  const fs::path path = folder / kOriginFile;
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return std::nullopt;
  const std::vector<std::byte> bytes = io::read_file(path, kLargestOrigin);
  const auto* text = reinterpret_cast<const char*>(bytes.data());
  try {
    const ordered_json json = ordered_json::parse(text, text + bytes.size());
    return RunOrigin{.folder = json.at("folder").get<std::string>(),
                     .frame = json.at("frame").get<int>(),
                     .state_hash = std::stoull(json.at("state_hash").get<std::string>(), nullptr, 16),
                     .differences = json.at("differences").get<std::string>()};
  } catch (const std::exception&) {
    throw Error(ErrorKind::Corrupt, Fault{.place = path.string(),
                                          .key = {},
                                          .expected = "expected the record of where this run started",
                                          .found = "another text",
                                          .hint = "run it again with --from-frame and --overwrite"});
  }
}

void write_origin(const fs::path& folder, const RunOrigin& origin) {
  const ordered_json json = {{"folder", origin.folder.string()}, {"frame", origin.frame}, {"state_hash", to_hex(origin.state_hash)}, {"differences", origin.differences}};
  io::write_atomically(folder / kOriginFile, std::string_view(json.dump(2, ' ', false, ordered_json::error_handler_t::replace) + '\n'));
}

int first_frame_of(const fs::path& folder) {
  const std::optional<RunOrigin> origin = read_origin(folder);
  return origin ? origin->frame : 1;
}

RunOrigin start_from(const RunStart& start, Simulation& simulation) {
  RunOrigin origin{.folder = fs::absolute(start.folder).lexically_normal(), .frame = start.frame, .state_hash = 0, .differences = {}};
  const fs::path path = start_path(start, scene_name(simulation.scene()));
  State state = load_state(path, origin_of(simulation.scene()), {.frame = start.frame, .differences = &origin.differences});
  origin.state_hash = state.hash();
  simulation.adopt(std::move(state));
  return origin;
}

}  // namespace supple::scenes
