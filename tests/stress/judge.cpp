#include <sys/time.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <new>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "fuzzers.h"
#include "supple/scenes/check.h"
#include "supple/scenes/plan.h"
#include "supple/scenes/run.h"
#include "supple/scenes/simulation.h"
#ifdef SUPPLE_HAS_CGAL
#include "supple/cgal/surface_meshes.h"
#endif

namespace supple::stress {
namespace {

namespace fs = std::filesystem;

constexpr double kRunSeconds = 3.0;  // of processor time, then the run is interrupted

implicit::DelaunayMesher delaunay() {
#ifdef SUPPLE_HAS_CGAL
  return cgal::delaunay_mesh;
#else
  return {};
#endif
}

/// "NAME:LINE:COLUMN", or a file beside the scene with a line or without.
bool has_place(const Fault& fault, const std::string& name, ErrorKind kind) {
  if (kind != ErrorKind::Scene || !fault.place.starts_with(name)) return !fault.place.empty();
  std::string_view rest = std::string_view(fault.place).substr(name.size());
  int numbers = 0;
  while (rest.size() > 1 && rest.front() == ':' && std::isdigit(static_cast<unsigned char>(rest[1])) != 0) {
    rest.remove_prefix(1);
    while (!rest.empty() && std::isdigit(static_cast<unsigned char>(rest.front())) != 0) rest.remove_prefix(1);
    ++numbers;
  }
  return rest.empty() && numbers == 2;
}

std::string fault_in(const Error& error, const std::string& name) {
  if (error.kind() == ErrorKind::Internal) return std::string("internal: ") + error.what();
  for (const Fault& fault : error.faults()) {
    if (!has_place(fault, name, error.kind())) return "a message without file:line:column: " + fault.message();
    if (fault.expected.empty()) return "a message without what was expected: " + fault.message();
  }
  return {};
}

std::atomic<int> interrupted{0};
void interrupt(int) { interrupted = SIGINT; }

void interrupt_after(double seconds) {
  interrupted = 0;
  std::signal(SIGVTALRM, interrupt);
  itimerval timer{};
  timer.it_value.tv_sec = static_cast<time_t>(seconds);
  setitimer(ITIMER_VIRTUAL, &timer, nullptr);
}

/// Small and few outputs of every kind that the scene requests, except the film.
void shrink_outputs(scenes::Scene& scene) {
  if (scene.output.images) {
    scene.output.images->size = {32, 24};
    scene.output.images->samples = 1;
  }
  scene.output.film.reset();
  scene.render.most_samples = std::min(scene.render.most_samples, 4);
}

/// Files that must not exist after a run of any outcome.
std::string fault_in_folder(const fs::path& folder) {
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name.ends_with(".tmp")) return "a temporary file was left: " + name;
    if (entry.path().extension() == ".png" && !file_text(entry.path()).ends_with(std::string_view("IEND\xae\x42\x60\x82", 8))) {
      return "a picture is not whole: " + name;
    }
  }
  return {};
}

std::string fault_in_result(const scenes::RunResult& result) {
  const std::string outcome = "the run of a scene that passed the check ended as '" + result.outcome + "': " + result.reason;
  if (result.exit_code == 1 || result.outcome == "internal" || result.exit_code == 4) return outcome;
  return {};
}

}  // namespace

Trial judged(const std::string& name, const std::function<void()>& use) {
  const Meter meter;
  Trial trial;
  try {
    use();
  } catch (const Error& error) {
    trial.refused = true;
    trial.fault = fault_in(error, name);
  } catch (const ContractViolation& error) {
    trial.fault = std::string("contract violation: ") + error.what();
  } catch (const fs::filesystem_error&) {
    trial.refused = true;  // exit code 4
  } catch (const std::bad_alloc&) {
    trial.refused = true;  // exit code 6
  } catch (const std::exception& error) {
    trial.fault = std::string("internal fault: ") + error.what();
  }
  if (!trial.refused || !trial.fault.empty()) return trial;
  char number[96];
  if (meter.processor_s() > kMostSeconds * slowness()) {
    std::snprintf(number, sizeof number, "refused after %.1f s of processor time", meter.processor_s());
    trial.fault = number;
  } else if (meter.most_bytes() > kMostBytes * slowness()) {
    std::snprintf(number, sizeof number, "refused after taking %.0f MB", meter.most_bytes() / 1e6);
    trial.fault = number;
  }
  return trial;
}

void check_scene(const scenes::Scene& scene) {
  (void)scenes::check_scene(scene, {.threads = 1, .delaunay = delaunay()}, scenes::kCheckMemory, scenes::kCheckSeconds * slowness());
}

std::string run_two_frames(scenes::Scene scene, const fs::path& folder) {
  check_scene(scene);
  scene.duration = std::min(scene.duration, 1.0 / scene.frame_rate);
  shrink_outputs(scene);
  scenes::RunOptions options{.folder = folder, .threads = 1, .overwrite = true, .delaunay = delaunay(), .frames_at_once = 1};
  options.interrupt = &interrupted;
  interrupt_after(kRunSeconds * slowness());
  const scenes::RunResult result = scenes::run_scene(scene, options);
  std::string fault = fault_in_result(result);
  if (fault.empty()) fault = fault_in_folder(folder);
  std::error_code ignored;
  fs::remove_all(folder, ignored);
  return fault;
}

std::string file_text(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

void write_text(const fs::path& path, std::string_view text) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(text.data(), static_cast<std::streamsize>(text.size()));
  if (!file.flush()) throw std::runtime_error("cannot write " + path.string());
}

}  // namespace supple::stress
