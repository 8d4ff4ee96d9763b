#include "supple/scenes/view.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "output/files/output_files.h"
#include "output/files/saved_frames.h"
#include "output/pictures/camera.h"
#include "output/run/unreached.h"
#include "output/view/view_arrays.h"
#include "output/view/view_frame.h"
#include "supple/core/counted.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "supple/core/io/atomic_file.h"

namespace supple::scenes {

/// The page without its run; made of the files in viewer/ by the build. `@RUN@` stands for the run.
extern const std::string_view kViewerPage;

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

Json json_of(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

/// The scene with plain meshes that show the pressure of contact: the looks of its pictures cost time and bytes here.
Scene for_view(Scene scene) {
  scene.accuracy.reset();  // it would choose the errors of meshes
  scene.output.meshing = {};
  scene.output.meshing.search = false;
  for (ObjectDesc& object : scene.objects) {
    object.meshing = {};
    object.look.colour_by = ColourByName::Pressure;
    object.look.texture.reset();
  }
  return scene;
}

/// JSON that may stand in a page.
std::string page_text(const Json& json) {
  std::string out;
  for (const char c : json.dump()) c == '<' ? out += "\\u003c" : out += c;
  return out;
}

std::string page_with(const std::string& head, const std::string& frames) {
  constexpr std::string_view kMark = "@RUN@";
  const std::size_t at = kViewerPage.find(kMark);
  SUPPLE_EXPECTS(at != std::string_view::npos);
  std::string page(kViewerPage.substr(0, at));
  page += "<script type=\"application/json\" id=\"head\">" + head + "</script>\n<script type=\"text/plain\" id=\"frames\">" + frames + "</script>";
  page += kViewerPage.substr(at + kMark.size());
  return page;
}

std::size_t in_base64(std::size_t bytes) { return (bytes + 2) / 3 * 4; }

/// Cells with which the frames should fit, by three of them.
int cells_that_fit(const Scene& scene, const ViewOptions& options, const std::vector<int>& frames) {
  constexpr double kMargin = 0.85;  // the three may be small ones
  double bytes = 0.0;
  const std::size_t last = frames.size() - 1;
  for (const std::size_t k : {std::size_t{0}, last / 2, last}) {
    RunView sample(scene, options, kMostViewCells);
    bytes += static_cast<double>(in_base64(sample.frame(frames[k])->size())) / 3.0;
  }
  const double room = kMargin * (options.size - static_cast<double>(kViewerPage.size())) / static_cast<double>(frames.size());
  // Meshes grow with the square of the cells.
  return std::clamp(static_cast<int>(kMostViewCells * std::sqrt(std::max(room, 0.0) / bytes)), 8, kMostViewCells);
}

void append_word(std::string& out, std::size_t value) {
  for (unsigned k = 0; k < 4; ++k) out += static_cast<char>((value >> (8U * k)) & 0xFFU);
}

/// Length and content of each frame.
std::string all_frames(RunView& view, const ViewOptions& options, const std::vector<int>& frames) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point begin = Clock::now();
  std::string out;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const std::string frame = view.frame(frames[i]).value();
    append_word(out, frame.size());
    out += frame;
    if (!options.progress) continue;
    const double elapsed = std::chrono::duration<double>(Clock::now() - begin).count(), done = static_cast<double>(i + 1);
    options.progress({"view", frames[i], frames.back(), elapsed, elapsed * (static_cast<double>(frames.size()) - done) / done, done / elapsed});
  }
  return out;
}

Json solids_of(const Scene& scene) {
  Json solids = Json::array();
  for (const ObstacleDesc& o : scene.obstacles) solids.push_back({{"name", o.name}, {"colour", json_of(o.colour)}, {"roughness", o.roughness}, {"solid", true}});
  return solids;
}

}  // namespace

struct RunView::Impl {
  Impl(const Scene& scene, const ViewOptions& options)
      : folder(options.folder), interrupt(options.interrupt),
        simulation(for_view(scene_to_draw(scene, options.folder, options.frames)), {.threads = options.threads, .interrupt = options.interrupt, .memory = options.memory, .questions = true}) {}

  fs::path folder;
  const std::atomic<int>* interrupt;
  Simulation simulation;
  ViewFrames frames;
};

RunView::RunView(const Scene& scene, const ViewOptions& options, int cells) : impl_(std::make_unique<Impl>(scene, options)) {
  impl_->simulation.set_cells(cells);
}
RunView::~RunView() = default;

std::string RunView::head(bool follows) const {
  const Scene& scene = impl_->simulation.scene();
  const Model& model = impl_->simulation.model();
  Json meshes = Json::array();
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    const ObjectDesc& o = scene.objects[i];
    meshes.push_back({{"name", o.name}, {"colour", json_of(o.colour)}, {"roughness", o.roughness}, {"opacity", o.look.opacity},
                      {"metallic", o.look.metallic}, {"particles", {model.objects[i].first, model.objects[i].last}}});
  }
  for (Json& solid : solids_of(scene)) meshes.push_back(std::move(solid));
  Json json{{"name", scene_name(scene)}, {"title", scene.title}, {"frame_rate", scene.frame_rate}, {"frame_count", scene.frame_count()},
            {"follows", follows}, {"meshes", std::move(meshes)}, {"light", json_of(scene.light.direction)},
            {"background", {json_of(scene.background.top), json_of(scene.background.bottom)}}, {"up", json_of(model.cameras.front().up)},
            {"aspect", aspect_of(scene)}};
  if (scene.ground && scene.ground->visible) json["ground"] = {{"height", scene.ground->height}, {"colour", json_of(scene.ground->colour)}};
  return page_text(json);
}

std::optional<std::string> RunView::frame(int frame) {
  const InterruptScope scope(impl_->interrupt);
  Simulation& simulation = impl_->simulation;
  if (!fs::exists(state_path(impl_->folder, scene_name(simulation.scene()), frame))) return std::nullopt;
  simulation.restore(load_frame(impl_->folder, simulation.scene(), frame));
  return compress(impl_->frames.write(simulation));
}

ViewResult write_view(const Scene& scene, const ViewOptions& options) {
  constexpr int kTries = 4;
  const std::vector<int> frames = saved_frames(options.folder, scene, options.frames);
  int cells = options.cells > 0 ? options.cells : cells_that_fit(scene, options, frames);
  std::string page;
  for (int attempt = 0; attempt < kTries; ++attempt) {
    RunView view(scene, options, cells);
    page = page_with(view.head(false), base64(all_frames(view, options, frames)));
    if (options.cells > 0 || static_cast<double>(page.size()) <= options.size) break;
    const double share = options.size / static_cast<double>(page.size());
    if (attempt + 1 == kTries || cells <= 4) {
      throw Error(ErrorKind::Limit, Fault{.place = "--size",
                                          .key = {},
                                          .expected = "expected room for a page of " + counted(frames.size(), "frame"),
                                          .found = std::to_string(static_cast<long>(options.size)) + " bytes, of " + std::to_string(page.size()),
                                          .hint = "choose fewer frames, e.g. --frames 1-" + std::to_string(frames.back()) + ":4"});
    }
    cells = std::max(4, static_cast<int>(0.95 * cells * std::sqrt(share)));
  }
  const fs::path path = options.page.empty() ? options.folder / (scene_name(scene) + "_view.html") : options.page;
  io::write_atomically(path, std::string_view(page));
  return {path, static_cast<int>(frames.size()), cells, page.size()};
}

std::string following_page(const RunView& view) { return page_with(view.head(true), {}); }

}  // namespace supple::scenes
