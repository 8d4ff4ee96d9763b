#include "output/pictures/drawing_crew.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <numeric>
#include <system_error>

#include "output/files/saved_frames.h"
#include "output/pictures/camera.h"
#include "supple/core/cpu_time.h"
#include "supple/core/executor.h"
#include "supple/core/interrupt.h"

namespace supple::scenes {
namespace {

double free_bytes() { return static_cast<double>(sysconf(_SC_AVPHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGESIZE)); }

/// Of all stages.
double cpu_seconds(const Profile& profile) {
  return std::accumulate(profile.begin(), profile.end(), 0.0, [](double sum, const StageProfile& stage) { return sum + stage.cpu_s; });
}

/// OpenGL contexts among which these pictures are worth dividing.
int worthwhile_contexts(const Scene& scene, std::size_t frames) {
  constexpr int kMost = 64;
  constexpr double kPixelsOfContext = 4e5;  // drawn in the time that a context and its shaders take
  if (scene.render.renderer != RendererName::Gl) return kMost;
  const std::vector<int> size = scene.output.images ? scene.output.images->size : ImagesDesc{}.size;
  const double pixels = static_cast<double>(size.at(0)) * size.at(1) * static_cast<double>(cameras_of(scene).size() * frames);
  return static_cast<int>(std::clamp(pixels / kPixelsOfContext, 1.0, static_cast<double>(kMost)));
}

}  // namespace

double resident_bytes() {
  std::ifstream file("/proc/self/statm");
  double size = 0.0, resident = 0.0;
  file >> size >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE));
}

int crew_size(const Scene& scene, const RunOptions& options, std::size_t frames, double share) {
  if (options.profile) return 1;
  const int wanted = options.frames_at_once > 0 ? options.frames_at_once : std::min(Executor(options.threads).threads(), worthwhile_contexts(scene, frames));
  const int most = std::min<int>(static_cast<int>(std::min<std::size_t>(frames, 64)), wanted);
  const double memory = options.memory > 0.0 ? options.memory : 0.5 * free_bytes();
  constexpr double kLeastShare = 1 << 20;  // [byte]: a process that reuses freed memory does not grow
  const double room = memory / std::max(share, kLeastShare);
  return std::max(1, static_cast<int>(std::min<double>(most, room)));
}

DrawingCrew::DrawingCrew(Work work, int members, Leader leader, Reporter& report)
    : scene_(work.scene), options_(work.options), outputs_(work.outputs), frames_(std::move(work.frames)), leader_(leader), report_(report),
      profile_before_(leader.simulation.profile()), pictures_before_(leader.writer.picture_times()), cpu_before_(process_cpu_seconds()),
      members_(static_cast<std::size_t>(members - 1)), saved_(work.saved) {
  leader.result.frames_at_once = members;
  options_.threads = std::max(1, Executor(options_.threads).threads() / members);
  options_.progress = [this](const Progress& progress) {
    const std::lock_guard lock(mutex_);
    report_(progress.stage, progress.frame, static_cast<double>(progress.frame) / frames_.back());
  };
  try {
    for (Member& member : members_) member.thread = std::thread([this, &member] { begin(member); });
  } catch (const std::system_error&) {
    // The machine has no more threads: those that began, and the leader, draw all.
  } catch (...) {
    dismiss(true);  // threads that began must be joined
    throw;
  }
}

DrawingCrew::~DrawingCrew() { dismiss(true); }

void DrawingCrew::dismiss(bool leave) {
  {
    const std::lock_guard lock(mutex_);
    complete_ = true;
    if (leave) next_ = frames_.size();
  }
  change_.notify_all();
  for (Member& member : members_) {
    if (member.thread.joinable()) member.thread.join();
  }
}

bool DrawingCrew::saved(int frame) {
  const std::lock_guard lock(mutex_);
  saved_ = frame;
  change_.notify_one();
  return failure_ == nullptr;
}

void DrawingCrew::simulating(int frame) {
  const std::lock_guard lock(mutex_);
  const bool behind = at_work_ > 0 || (next_ < frames_.size() && frames_[next_] <= saved_);
  if (!behind) report_("simulate", frame, static_cast<double>(frame - 1) / frames_.back());
}

int DrawingCrew::next_frame() {
  std::unique_lock lock(mutex_);
  change_.wait(lock, [&] { return complete_ || failure_ || next_ == frames_.size() || frames_[next_] <= saved_; });
  if (failure_ || next_ == frames_.size() || frames_[next_] > saved_ || interrupted()) return 0;
  ++at_work_;
  return frames_[next_++];
}

void DrawingCrew::done() {
  const std::lock_guard lock(mutex_);
  --at_work_;
}

void DrawingCrew::fail(int frame) {
  {
    const std::lock_guard lock(mutex_);
    if (!failure_ || frame < failed_) failure_ = std::current_exception();
    failed_ = std::min(failed_, frame);
  }
  change_.notify_all();
}

void DrawingCrew::begin(Member& member) {
  try {
    const InterruptScope scope(options_.interrupt);
    std::unique_lock lock(opening_);
    Simulation simulation(scene_, SimulationOptions{.threads = options_.threads, .skip = options_.skip, .profile = options_.profile, .delaunay = options_.delaunay,
                                                    .interrupt = options_.interrupt, .memory = options_.scene_memory, .divide = options_.divide});
    FrameWriter writer(scene_, simulation.model(), options_, outputs_);
    lock.unlock();
    work(simulation, writer);
    member.profile = simulation.profile();
    member.pictures = writer.picture_times();
    member.pictures_drawn = writer.pictures_drawn();
    writer.add_warnings(member.warnings);
  } catch (...) {
    fail(frames_.front());
  }
}

void DrawingCrew::work(Simulation& simulation, FrameWriter& writer) {
  Reporter report(options_, frames_.back());
  int kept = 0;
  while (const int frame = next_frame()) {
    try {
      State state = load_frame(options_.folder, scene_, frame);
      if (options_.overwrite || writer.renews(frame, state.hash())) {
        simulation.restore(std::move(state));
        writer.write(simulation, report, 0.0);
      } else {
        ++kept;
      }
    } catch (...) {
      fail(frame);
    }
    done();
  }
  const std::lock_guard lock(mutex_);
  leader_.result.pictures_kept += kept;
}

void DrawingCrew::leave() {
  dismiss(true);
  book();
}

void DrawingCrew::join() {
  {
    const std::lock_guard lock(mutex_);
    complete_ = true;
  }
  change_.notify_all();
  work(leader_.simulation, leader_.writer);
  dismiss(false);
  book();
  if (failure_) std::rethrow_exception(failure_);
}

/// Clocks count the CPU time of the process, so each member measured the work of all: the times are scaled by one factor so that
/// they add up to the total.
void DrawingCrew::book() {
  double seen = cpu_seconds(leader_.simulation.profile()) - cpu_seconds(profile_before_);
  for (const Member& member : members_) seen += cpu_seconds(member.profile);
  const double share = std::min(1.0, (process_cpu_seconds() - cpu_before_) / std::max(seen, 1e-9));

  for (std::size_t s = 0; s < profile_before_.size(); ++s) {
    StageProfile& sum = leader_.simulation.profile(static_cast<Stage>(s));
    const StageProfile& before = profile_before_[s];
    for (const auto part : {&StageProfile::cpu_s, &StageProfile::first_s, &StageProfile::later_s, &StageProfile::apart_s})
      sum.*part = before.*part + share * (sum.*part - before.*part);
  }
  RunResult& result = leader_.result;
  PictureTimes own = leader_.writer.picture_times();
  own.add(pictures_before_, -1.0);
  own.images = 0;
  result.pictures.add(own, share - 1.0);
  for (const Member& member : members_) {
    result.pictures_drawn += member.pictures_drawn;
    result.pictures.add(member.pictures, share);
    result.warnings.insert(result.warnings.end(), member.warnings.begin(), member.warnings.end());
    for (const Stage stage : {Stage::Polygonise, Stage::Render, Stage::Export}) {
      const StageProfile& more = member.profile[static_cast<std::size_t>(stage)];
      StageProfile& sum = leader_.simulation.profile(stage);
      sum.calls += more.calls;
      sum.visited += more.visited;
      sum.present += more.present;
      sum.cpu_s += share * more.cpu_s;
    }
  }
}

}  // namespace supple::scenes
