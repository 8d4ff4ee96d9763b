#include "supple/scenes/accuracy.h"
#include "supple/core/counted.h"
#include "supple/scenes/estimate.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <optional>
#include <system_error>
#include <vector>

#include "file/read_scene_faults.h"
#include "output/files/frame_writer.h"
#include "output/files/output_files.h"
#include "supple/core/cpu_time.h"
#include "supple/core/interrupt.h"
#include "supple/scenes/limits.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr double kCoarseContact = 3e-2;  // contact.error of the coarse simulation
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
};

struct Coarse {
  std::size_t particles = 0;       ///< at the end
  std::vector<CoarseFrame> frame;  ///< of frames 2, 3 ...
  std::vector<State> before;       ///< states from which the frames of the sample begin
  std::vector<int> sampled;        ///< these frames
};

/// Frames of the sample: the middles of equal parts of the frames 2 .. last.
std::vector<int> sample_of(int last) {
  std::vector<int> frames;
  const int count = std::min(kSample, last - 1);
  for (int k = 0; k < count; ++k) frames.push_back(2 + static_cast<int>((k + 0.5) * (last - 1) / count));
  return frames;
}

Coarse follow(const Scene& scene, const SimulationOptions& options, int last, double limit) {
  Scene rough = scene;
  rough.contact.error = std::max(contact_error(scene), kCoarseContact);
  Simulation simulation(std::move(rough), options);
  Coarse out;
  const std::vector<int> wanted = sample_of(last);
  double spent = 0.0;
  while (simulation.frame() < last && spent < limit) {
    const int next = simulation.frame() + 1;
    if (std::binary_search(wanted.begin(), wanted.end(), next)) {
      out.sampled.push_back(next);
      out.before.push_back(simulation.state());
    }
    const std::uint64_t steps = simulation.state().steps;
    const double begin = process_cpu_seconds();
    simulation.step_frame();
    out.frame.push_back({process_cpu_seconds() - begin, static_cast<int>(simulation.state().steps - steps)});
    spent += out.frame.back().cpu_s;
  }
  out.particles = simulation.state().particles.size();
  return out;
}

/// Sums over the frames of the sample, made in full.
struct Sample {
  double cpu_s = 0.0, coarse_s = 0.0, wall_s = 0.0, steps_s = 0.0;
  double first_drawing_s = 0.0, drawing_s = 0.0;  ///< of frame 1, with what is made once; of the others
  double first_triangles = 0.0, triangles = 0.0;  ///< likewise
  bool touched = false;
};

double triangles_of(Simulation& simulation) {
  double sum = 0.0;
  for (const Mesh& mesh : simulation.meshes()) sum += static_cast<double>(mesh.triangle.size());
  return sum;
}

Sample make_sample(const Scene& scene, const RunOptions& options, const SimulationOptions& simulation_options, const OutputRequest& outputs,
                   const Coarse& coarse) {
  Sample sample;
  const double begin_of_all = process_cpu_seconds();
  Simulation simulation(scene, simulation_options);
  FrameWriter writer(scene, simulation.model(), options, outputs);
  Reporter report(options, scene.frame_count());
  const auto write = [&] {
    const double begin = process_cpu_seconds();
    writer.write(simulation, report, 0.0);
    save_state(state_path(options.folder, scene_name(scene), simulation.frame()), simulation.state(), origin_of(scene));
    return process_cpu_seconds() - begin;
  };
  const bool has_meshes = outputs.images || outputs.meshes;
  const double made_once = process_cpu_seconds() - begin_of_all;
  sample.first_drawing_s = made_once + write();
  if (has_meshes) sample.first_triangles = triangles_of(simulation);
  for (std::size_t k = 0; k < coarse.sampled.size(); ++k) {
    simulation.restore(coarse.before[k]);
    const double begin = process_cpu_seconds();
    const auto wall = Clock::now();
    simulation.step_frame();
    sample.wall_s += std::chrono::duration<double>(Clock::now() - wall).count();
    sample.cpu_s += process_cpu_seconds() - begin;
    sample.coarse_s += coarse.frame[static_cast<std::size_t>(coarse.sampled[k] - 2)].cpu_s;
    sample.drawing_s += write();
    if (has_meshes) sample.triangles += triangles_of(simulation);
  }
  sample.touched = simulation.profile()[static_cast<std::size_t>(Stage::React)].visited > 0;
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
  const SimulationOptions simulation_options{.threads = options.threads, .skip = options.skip, .delaunay = options.delaunay,
                                             .interrupt = options.interrupt, .memory = options.scene_memory};
  const int last = options.frames.empty() ? scene.frame_count() : std::min(scene.frame_count(), *options.frames.rbegin());
  const Coarse coarse = follow(scene, simulation_options, last, follow_s);
  const ScratchFolder scratch;
  RunOptions full = options;
  full.folder = scratch.path();
  full.frames.clear();
  full.progress = {};
  const Sample sample = make_sample(scene, full, simulation_options, outputs, coarse);

  RunEstimate out{.objects = scene.objects.size(), .particles = coarse.particles};
  out.frames = last;
  out.followed = 1 + static_cast<int>(coarse.frame.size());
  out.calibrated = static_cast<int>(coarse.sampled.size());
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
  const double samples = std::max(1, out.calibrated);
  const double again = !options.estimate_errors ? 0.0 : sample.touched ? kEstimateWithContact : kEstimateAlone;
  out.simulation_s = sample.coarse_s > 0.0 ? (1.0 + again) * coarse_s * sample.cpu_s / sample.coarse_s : 0.0;
  out.drawing_s = sample.first_drawing_s + (drawn - 1.0) * sample.drawing_s / samples;
  out.triangles = out.calibrated > 0 ? sample.triangles / samples : sample.first_triangles;
  out.memory = largest_resident_bytes();
  const double pictures = scratch.bytes(".png"), share = drawn / (out.calibrated + 1.0);
  const double sheets = outputs.images ? pictures / (out.calibrated + 1.0) * sheet_share(scene, drawn) : 0.0;
  out.disk = share * scratch.bytes() + sheets + (outputs.film ? kFilmOfPictures * share * pictures : 0.0);
  const double threads = Executor(options.threads).threads();
  const double alone = sample.cpu_s > 0.0 ? out.simulation_s * std::min(1.0, sample.wall_s / sample.cpu_s) : 0.0;
  out.wall_s = std::max(alone, (out.simulation_s + out.drawing_s) / threads);
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
  line("CPU time", time_text(e.simulation_s) + " for steps, " + time_text(e.drawing_s) + " for meshes, pictures and files");
  line("time", "about " + time_text(e.wall_s) + " on an idle machine");
  line("measured", counted(static_cast<std::size_t>(e.calibrated), "frame") + " in full, " + std::to_string(e.followed) + " of " + std::to_string(e.frames) + " with coarse contact");
  return text;
}

}  // namespace supple::scenes
