#include "supple/scenes/accuracy.h"
#include "supple/core/counted.h"
#include "supple/scenes/estimate.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "file/read_scene_faults.h"
#include "output/files/frame_writer.h"
#include "output/files/output_files.h"
#include "supple/core/cpu_time.h"
#include "supple/core/interrupt.h"
#include "supple/render/image.h"
#include "supple/scenes/limits.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr double kCoarseContact = 3e-2;  // contact.error of the coarse simulation
constexpr int kKept = 24;                // frames whose states are kept, of which the sample is chosen
constexpr int kSample = 6;               // frames made in full
/// Time of the error estimate of a run over that of its steps, with contact and without: one in so many frames is made again with half the steps.
constexpr double kEstimateWithContact = 0.5 / 6.0, kEstimateAlone = 0.5 / 16.0;
constexpr double kFilmOfPictures = 0.05;  // bytes of a film over those of its pictures

/// Removed with all it holds.
class ScratchFolder {
 public:
  ScratchFolder() : path_(fs::temp_directory_path() / ("supple-dry-run-" + std::to_string(getpid()))) { fs::create_directories(path_ / "states"); }
  ~ScratchFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  [[nodiscard]] const fs::path& path() const { return path_; }
  /// Bytes of its files. @param extension  of those that count; empty: all
  [[nodiscard]] double bytes(const std::string& extension = {}) const {
    double sum = 0.0;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(path_)) {
      if (entry.is_regular_file() && (extension.empty() || entry.path().extension() == extension)) sum += static_cast<double>(entry.file_size());
    }
    return sum;
  }

 private:
  fs::path path_;
};

/// A frame of the coarse simulation.
struct CoarseFrame {
  double cpu_s = 0.0;
  int steps = 0;
  bool touches = false;  ///< bodies touch in one of its steps
};

/// A frame that can be made in full.
struct Start {
  int frame = 0;
  State before;  ///< the state from which it begins
};

struct Coarse {
  std::size_t particles = 0;       ///< at the end
  std::vector<CoarseFrame> frame;  ///< of frames 2, 3 ...
  std::vector<Start> kept;         ///< spread evenly over these frames
  [[nodiscard]] const CoarseFrame& of(const Start& start) const { return frame[static_cast<std::size_t>(start.frame - 2)]; }
  /// Frames without contact, and with contact.
  [[nodiscard]] std::array<double, 2> counts() const {
    std::array<double, 2> out{};
    for (const CoarseFrame& one : frame) out[one.touches] += 1.0;
    return out;
  }
};

/// Middles of `count` equal parts of 0 .. size - 1, or all.
std::vector<std::size_t> middles(std::size_t size, std::size_t count) {
  std::vector<std::size_t> out;
  count = std::min(count, size);
  for (std::size_t k = 0; k < count; ++k) out.push_back((2 * k + 1) * size / (2 * count));
  return out;
}

std::uint64_t contact_points_of(const Simulation& simulation) { return simulation.profile()[static_cast<std::size_t>(Stage::React)].visited; }

Coarse follow(const Scene& scene, const SimulationOptions& options, int last, double limit) {
  Scene rough = scene;
  rough.contact.error = std::max(contact_error(scene), kCoarseContact);
  Simulation simulation(std::move(rough), options);
  Coarse out;
  const std::vector<std::size_t> wanted = middles(static_cast<std::size_t>(last - 1), kKept);
  double spent = 0.0;
  while (simulation.frame() < last && spent < limit) {
    const int next = simulation.frame() + 1;
    if (std::binary_search(wanted.begin(), wanted.end(), out.frame.size())) out.kept.push_back({next, simulation.state()});
    const std::uint64_t steps = simulation.state().steps, points = contact_points_of(simulation);
    const double begin = process_cpu_seconds();
    simulation.step_frame();
    out.frame.push_back({process_cpu_seconds() - begin, static_cast<int>(simulation.state().steps - steps), contact_points_of(simulation) > points});
    spent += out.frame.back().cpu_s;
  }
  out.particles = simulation.state().particles.size();
  return out;
}

/// The frames to make in full: of those with and without contact as many as they are long, but some of both.
std::vector<const Start*> sample_of(const Coarse& coarse) {
  std::array<std::vector<const Start*>, 2> kinds;
  for (const Start& start : coarse.kept) kinds[coarse.of(start).touches].push_back(&start);
  constexpr std::size_t kLeast = 2;
  const double all = static_cast<double>(std::max<std::size_t>(1, coarse.kept.size()));
  const auto rounded = static_cast<std::size_t>(std::lround(kSample * static_cast<double>(kinds[1].size()) / all));
  std::size_t touching = std::clamp(rounded, std::min(kLeast, kinds[1].size()), kSample - std::min(kLeast, kinds[0].size()));
  std::vector<const Start*> out;
  for (const std::size_t k : middles(kinds[0].size(), kSample - touching)) out.push_back(kinds[0][k]);
  for (const std::size_t k : middles(kinds[1].size(), touching)) out.push_back(kinds[1][k]);
  std::sort(out.begin(), out.end(), [](const Start* a, const Start* b) { return a->frame < b->frame; });
  return out;
}

/// What frames take beside their steps.
struct FrameCost {
  double drawing_s = 0.0, triangles = 0.0, bytes = 0.0, pictures = 0.0;  ///< the last two: of all files, and of pictures [byte]
  FrameCost& add(const FrameCost& more, double weight) {
    drawing_s += weight * more.drawing_s;
    triangles += weight * more.triangles;
    bytes += weight * more.bytes;
    pictures += weight * more.pictures;
    return *this;
  }
};

/// The frames of the sample, made in full.
struct Sample {
  int frames = 0;
  double cpu_s = 0.0, coarse_s = 0.0, wall_s = 0.0;  ///< of all steps together
  FrameCost first;  ///< of frame 1, with what is made once
  FrameCost other;  ///< mean of the others
  double film_start_s = 0.0, film_frame_s = 0.0;  ///< of the film, and of one more picture in it
  bool touched = false;
};

double triangles_of(Simulation& simulation) {
  double sum = 0.0;
  for (const Mesh& mesh : simulation.meshes()) sum += static_cast<double>(mesh.triangle.size());
  return sum;
}

/// CPU time of ended child processes.
double children_cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_CHILDREN, &usage);
  const auto seconds = [](const timeval& t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

/// Makes films of the first picture and of all pictures of the sample.
void time_film(const Scene& scene, const RunOptions& options, Sample& sample) {
  const fs::path folder = options.folder / "film";
  fs::create_directory(folder);
  std::vector<fs::path> pictures;
  const std::string name = image_names(scene).front();
  for (const fs::directory_entry& entry : fs::directory_iterator(options.folder / "frames")) {
    if (entry.path().extension() == ".png" && entry.path().filename().string().starts_with(name + '.')) pictures.push_back(entry.path());
  }
  std::sort(pictures.begin(), pictures.end());
  for (std::size_t k = 0; k < pictures.size(); ++k) fs::create_symlink(pictures[k], folder / numbered("film", static_cast<int>(k + 1), ".png"));
  const auto encode = [&](int last) {
    const double begin = children_cpu_seconds();
    render::encode_film({folder, "film", 1, last, scene.frame_rate}, folder / (std::to_string(last) + ".mp4"), options.interrupt);
    return children_cpu_seconds() - begin;
  };
  const auto count = static_cast<int>(pictures.size());
  const double one = encode(1), all = count > 1 ? encode(count) : one;
  const double cameras = static_cast<double>(image_names(scene).size());
  sample.film_frame_s = count > 1 ? cameras * std::max(0.0, all - one) / (count - 1) : 0.0;
  sample.film_start_s = cameras * one - sample.film_frame_s;
}

Sample make_sample(const Scene& scene, const RunOptions& options, const ScratchFolder& scratch, const SimulationOptions& simulation_options,
                   const OutputRequest& outputs, const Coarse& coarse) {
  Sample sample;
  const double begin_of_all = process_cpu_seconds();
  Simulation simulation(scene, simulation_options);
  FrameWriter writer(scene, simulation.model(), options, outputs);
  Reporter report(options, scene.frame_count());
  FrameCost before;
  const auto write = [&] {
    const double begin = process_cpu_seconds();
    writer.write(simulation, report, 0.0);
    save_state(state_path(options.folder, scene_name(scene), simulation.frame()), simulation.state(), origin_of(scene));
    FrameCost cost{.drawing_s = process_cpu_seconds() - begin, .bytes = scratch.bytes(), .pictures = scratch.bytes(".png")};
    const double bytes = cost.bytes, pictures = cost.pictures;
    cost.bytes -= std::exchange(before.bytes, bytes);
    cost.pictures -= std::exchange(before.pictures, pictures);
    if (outputs.images || outputs.meshes) cost.triangles = triangles_of(simulation);
    return cost;
  };
  const double made_once = process_cpu_seconds() - begin_of_all;
  sample.first = write();
  sample.first.drawing_s += made_once;
  std::array<FrameCost, 2> sum;
  std::array<double, 2> made{};
  for (const Start* start : sample_of(coarse)) {
    simulation.restore(start->before);
    const double begin = process_cpu_seconds();
    const auto wall = Clock::now();
    simulation.step_frame();
    sample.wall_s += std::chrono::duration<double>(Clock::now() - wall).count();
    sample.cpu_s += process_cpu_seconds() - begin;
    const CoarseFrame& same = coarse.of(*start);
    sample.coarse_s += same.cpu_s;
    sum[same.touches].add(write(), 1.0);
    made[same.touches] += 1.0;
    ++sample.frames;
  }
  const std::array<double, 2> counts = coarse.counts();
  double represented = 0.0;  // frames of the kinds that the sample has
  for (std::size_t kind = 0; kind < made.size(); ++kind) represented += made[kind] > 0.0 ? counts[kind] : 0.0;
  for (std::size_t kind = 0; kind < made.size(); ++kind) {
    if (made[kind] > 0.0) sample.other.add(sum[kind], counts[kind] / (represented * made[kind]));
  }
  sample.touched = contact_points_of(simulation) > 0;
  if (outputs.film) time_film(scene, options, sample);
  return sample;
}

/// Pixels of a contact sheet, as `write_contact_sheet` makes it, over those of a picture.
double sheet_share(const Scene& scene, double drawn) {
  constexpr double kMostOnASheet = 12.0, kWidthOnASheet = 320.0;  // [pixel]
  const double width = scene.output.images ? scene.output.images->size.at(0) : ImagesDesc{}.size.at(0);
  const double shrunk = std::min(1.0, kWidthOnASheet / width);
  return std::min(drawn, kMostOnASheet) * shrunk * shrunk;
}

double largest_resident_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

/// Three digits: an estimate has no more.
std::string rough_text(double value) {
  const double unit = value > 0.0 ? std::pow(10.0, std::floor(std::log10(value)) - 2.0) : 1.0;
  return short_text(std::round(value / unit) * unit);
}

std::string time_text(double seconds) {
  if (seconds < 100.0) return rough_text(seconds) + " s";
  if (seconds < 6000.0) return rough_text(seconds / 60.0) + " min";
  return rough_text(seconds / 3600.0) + " h";
}

}  // namespace

RunEstimate estimate_run(const Scene& scene, const RunOptions& options, double follow_s) {
  const InterruptScope scope(options.interrupt);
  OutputRequest outputs = requested_outputs(scene);
  if (options.simulate_only) outputs.images = outputs.film = outputs.meshes = outputs.grids = false;
  outputs.samples = false;  // they follow from all earlier frames
  if (outputs.images) check_pictures(scene);
  outputs.film = outputs.film && outputs.images && (options.frames.empty() || (*options.frames.begin() == 1 && *options.frames.rbegin() == static_cast<int>(options.frames.size())));
  if (outputs.film) render::find_film_program();
  const SimulationOptions simulation_options{.threads = options.threads, .skip = options.skip, .delaunay = options.delaunay,
                                             .interrupt = options.interrupt, .memory = options.scene_memory, .divide = options.divide};
  const int last = options.frames.empty() ? scene.frame_count() : std::min(scene.frame_count(), *options.frames.rbegin());
  const Coarse coarse = follow(scene, simulation_options, last, follow_s);
  const ScratchFolder scratch;
  RunOptions full = options;
  full.folder = scratch.path();
  full.frames.clear();
  full.progress = {};
  const Sample sample = make_sample(scene, full, scratch, simulation_options, outputs, coarse);

  RunEstimate out{.objects = scene.objects.size(), .particles = coarse.particles};
  out.frames = last;
  out.followed = 1 + static_cast<int>(coarse.frame.size());
  out.calibrated = sample.frames;
  double coarse_s = 0.0;
  for (const CoarseFrame& frame : coarse.frame) {
    coarse_s += frame.cpu_s;
    out.steps += static_cast<std::uint64_t>(frame.steps);
  }
  if (const int left = last - out.followed; left > 0 && !coarse.frame.empty()) {
    coarse_s += left * coarse.frame.back().cpu_s;
    out.steps += static_cast<std::uint64_t>(left) * static_cast<std::uint64_t>(coarse.frame.back().steps);
  }
  const double drawn = options.frames.empty() ? last : static_cast<double>(options.frames.size());
  const double again = !options.estimate_errors ? 0.0 : sample.touched ? kEstimateWithContact : kEstimateAlone;
  out.simulation_s = sample.coarse_s > 0.0 ? (1.0 + again) * coarse_s * sample.cpu_s / sample.coarse_s : 0.0;
  FrameCost all = sample.first;
  all.add(sample.other, drawn - 1.0);
  out.drawing_s = all.drawing_s;
  out.film_s = outputs.film ? sample.film_start_s + drawn * sample.film_frame_s : 0.0;
  out.triangles = all.triangles / drawn;
  out.memory = largest_resident_bytes();
  const double sheets = outputs.images && options.contact_sheet ? all.pictures / drawn * sheet_share(scene, drawn) : 0.0;
  out.disk = all.bytes + sheets + (outputs.film ? kFilmOfPictures * all.pictures : 0.0);
  const double threads = Executor(options.threads).threads();
  const double alone = sample.cpu_s > 0.0 ? out.simulation_s * std::min(1.0, sample.wall_s / sample.cpu_s) : 0.0;
  out.wall_s = std::max(alone, (out.simulation_s + out.drawing_s) / threads) + out.film_s / threads;
  return out;
}

std::string text_of(const RunEstimate& e) {
  std::string text;
  const auto line = [&text](const std::string& name, const std::string& value) { text += name + std::string(12 - name.size(), ' ') + value + '\n'; };
  line("objects", std::to_string(e.objects));
  line("particles", std::to_string(e.particles));
  line("frames", std::to_string(e.frames));
  line("steps", std::to_string(e.steps));
  line("triangles", std::to_string(std::lround(e.triangles)) + " per frame");
  line("memory", bytes_text(e.memory) + " for one frame at a time");
  line("disk", bytes_text(e.disk));
  line("CPU time", time_text(e.simulation_s) + " for steps, " + time_text(e.drawing_s) + " for meshes, pictures and files" + (e.film_s > 0.0 ? ", " + time_text(e.film_s) + " for the film" : ""));
  line("time", "about " + time_text(e.wall_s) + " on an idle machine");
  line("measured", counted(static_cast<std::size_t>(e.calibrated), "frame") + " in full, " + std::to_string(e.followed) + " of " + std::to_string(e.frames) + " with coarse contact");
  return text;
}

}  // namespace supple::scenes
