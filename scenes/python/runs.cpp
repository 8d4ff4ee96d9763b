#include <pybind11/functional.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <chrono>
#include <csignal>
#include <exception>
#include <future>
#include <variant>

#include "bindings.h"
#include "supple/core/hash.h"
#include "supple/scenes/inspect.h"
#include "supple/scenes/run.h"

namespace supple::python {
namespace {

using scenes::Progress;
using scenes::RunOptions;
using scenes::RunResult;
using scenes::Scene;
using Path = std::filesystem::path;
using Frames = std::variant<std::monostate, std::string, std::vector<int>>;

std::set<int> frames_of(const Frames& frames) {
  if (const auto* text = std::get_if<std::string>(&frames)) return scenes::parse_frames(*text);
  if (const auto* list = std::get_if<std::vector<int>>(&frames)) return {list->begin(), list->end()};
  return {};
}

/// A call on a thread of its own, while this one sees to signals. What Python code or a signal raises meanwhile ends it
/// by `interrupt` and is raised here then.
class Watched {
 public:
  std::atomic<int> interrupt{0};

  /// Runs Python code that belongs to the call; this thread holds the interpreter.
  template <class Body>
  void guarded(const Body& body) {
    try {
      if (!raised_) body();
    } catch (const py::error_already_set&) {
      raised_ = std::current_exception();
      interrupt = SIGINT;
    }
  }

  template <class Body>
  auto call(const Body& body) {
    constexpr std::chrono::milliseconds kSlice(50);
    auto result = std::async(std::launch::async, body);
    for (bool done = false; !done;) {
      {
        const py::gil_scoped_release others_run;
        done = result.wait_for(kSlice) == std::future_status::ready;
      }
      guarded([] {
        if (PyErr_CheckSignals() != 0) throw py::error_already_set();
      });
    }
    if (raised_) std::rethrow_exception(raised_);
    return result.get();
  }

 private:
  std::exception_ptr raised_;
};

RunResult call(RunResult (*verb)(const Scene&, const RunOptions&), const Scene& scene, RunOptions options,
               const py::object& progress) {
  Watched watched;
  options.interrupt = &watched.interrupt;
  if (!progress.is_none()) {
    options.progress = [&](const Progress& now) {
      const py::gil_scoped_acquire hold;
      watched.guarded([&] { progress(now); });
    };
  }
  return watched.call([&] { return verb(scene, options); });
}

RunResult run(const Scene& scene, const Path& folder, const Frames& frames, int threads, bool overwrite, bool resume,
              bool simulate_only, const py::object& progress) {
  return call(&scenes::run_scene, scene,
              {.folder = folder,
               .frames = frames_of(frames),
               .threads = threads,
               .overwrite = overwrite,
               .resume = resume,
               .simulate_only = simulate_only},
              progress);
}

RunResult render(const Scene& scene, const Path& folder, const Frames& frames, int threads, bool overwrite,
                 const py::object& progress) {
  return call(&scenes::render_run, scene,
              {.folder = folder, .frames = frames_of(frames), .threads = threads, .overwrite = overwrite}, progress);
}

RunResult export_files(const Scene& scene, const Path& folder, const Frames& frames, int threads,
                       const py::object& progress) {
  return call(&scenes::export_run, scene, {.folder = folder, .frames = frames_of(frames), .threads = threads},
              progress);
}

}  // namespace

void bind_runs(py::module_& module) {
  py::class_<Progress>(module, "Progress", "Where a run is.")
      .def_readonly("stage", &Progress::stage, "\"simulate\", \"surface\", \"render\" or \"film\".")
      .def_readonly("frame", &Progress::frame, "The frame at work.")
      .def_readonly("frame_count", &Progress::frame_count, "Of so many.")
      .def_readonly("elapsed_s", &Progress::elapsed_s, "Since the start [s].")
      .def_readonly("left_s", &Progress::left_s, "Estimate [s]; negative while unknown.")
      .def_readonly("frames_per_s", &Progress::frames_per_s, "0 while unknown [1/s].");
  py::class_<RunResult>(module, "RunResult", "How a run ended and what it left behind.")
      .def_readonly("outcome", &RunResult::outcome,
                    "\"done\", \"diverged\", \"interrupted\", \"limit\", \"io\" or \"invalid\".")
      .def_readonly("reason", &RunResult::reason, "Empty when done.")
      .def_readonly("exit_code", &RunResult::exit_code, "What the command line tool would end with.")
      .def_readonly("frames", &RunResult::frames, "The last frame reached.")
      .def_property_readonly(
          "state_hash", [](const RunResult& r) { return to_hex(r.state_hash); }, "Of the last state.")
      .def_property_readonly(
          "folder", [](const RunResult& r) { return r.folder; }, "Where everything went.")
      .def_property_readonly(
          "report", [](const RunResult& r) { return r.report; }, "result.json, render.json or export.json.")
      .def_property_readonly(
          "film", [](const RunResult& r) { return r.film.empty() ? std::optional<Path>() : r.film; },
          "None: there is none.")
      .def_property_readonly(
          "warnings", [](const RunResult& r) { return r.warnings; }, "As sentences.")
      .def("__repr__", [](const RunResult& r) {
        return py::str("<supple.RunResult {}, {} frames in {}>").format(r.outcome, r.frames, r.folder.string());
      });

  constexpr const char* kCommon =
      "\n\nframes    which to output, e.g. \"1-50,60,70-90:2\" or [1, 5, 9]; all unless given\n"
      "threads   0: all the machine has; changes no bit\n"
      "progress  called with a Progress now and then; what it raises ends the run after its step, as Control-C does\n\n"
      "Returns a RunResult however the run ended: see its outcome and reason. Raises Error where there can be no "
      "report: the folder cannot\n"
      "be made, is in use, or holds an earlier result.";
  const std::string run_doc = std::string(
                                  "A whole run from scene to files, as `supple run`: pictures, film, states, tables "
                                  "and result.json in `folder`.") +
                              kCommon;
  const std::string render_doc = std::string(
                                     "Draws the frames of an earlier run again from its saved states, as `supple "
                                     "render`; pictures that are up to date are kept\nunless overwrite.") +
                                 kCommon;
  const std::string export_doc =
      std::string(
          "Writes the files that the scene's `output` asks for from the saved states of a run, as `supple export`.") +
      kCommon;
  module.def("run", &run, py::arg("scene"), py::arg("folder"), py::kw_only(), py::arg("frames") = py::none(),
             py::arg("threads") = 0, py::arg("overwrite") = false, py::arg("resume") = false,
             py::arg("simulate_only") = false, py::arg("progress") = py::none(), run_doc.c_str());
  module.def("render", &render, py::arg("scene"), py::arg("folder"), py::kw_only(), py::arg("frames") = py::none(),
             py::arg("threads") = 0, py::arg("overwrite") = false, py::arg("progress") = py::none(),
             render_doc.c_str());
  module.def("export", &export_files, py::arg("scene"), py::arg("folder"), py::kw_only(),
             py::arg("frames") = py::none(), py::arg("threads") = 0, py::arg("progress") = py::none(),
             export_doc.c_str());
  module.def("info", &scenes::describe_run, py::arg("folder"),
             "What a run folder holds, for reading: outcome, audits, times, files.");

  using scenes::Comparison;
  using scenes::FrameComparison;
  py::class_<FrameComparison>(module, "FrameComparison", "A frame of two runs.")
      .def_readonly("frame", &FrameComparison::frame, "Its number.")
      .def_readonly("psnr", &FrameComparison::psnr, "[dB], infinite for equal pictures.")
      .def_readonly("largest", &FrameComparison::largest, "Difference of a channel, 0 to 255.");
  py::class_<Comparison>(module, "Comparison", "Two runs, picture by picture.")
      .def_property_readonly(
          "frames", [](const Comparison& c) { return c.frames; },
          "Those that both have, as FrameComparison, ascending.")
      .def_readonly("only_first", &Comparison::only_first, "How many only the first one has.")
      .def_readonly("only_second", &Comparison::only_second, "How many only the second one has.")
      .def_property_readonly(
          "film", [](const Comparison& c) { return c.film.empty() ? std::optional<Path>() : c.film; },
          "None: there is none.");
  module.def(
      "compare",
      [](const Path& first, const Path& second, const Path& folder, double gain, bool film, const std::string& camera) {
        Watched watched;
        return watched.call([&] {
          return scenes::compare_runs({.first = first,
                                       .second = second,
                                       .folder = folder,
                                       .gain = gain,
                                       .film = film,
                                       .camera = camera,
                                       .interrupt = &watched.interrupt});
        });
      },
      py::arg("first"), py::arg("second"), py::arg("folder"), py::kw_only(), py::arg("gain") = 8.0,
      py::arg("film") = true, py::arg("camera") = "",
      "Puts the frames of two run folders side by side with their difference, times gain, into folder/frames, "
      "compare.mp4 and compare.csv.");
}

}  // namespace supple::python
