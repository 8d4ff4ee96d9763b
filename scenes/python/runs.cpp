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
#include "supple/scenes/gltf.h"
#include "supple/scenes/run.h"
#include "supple/scenes/view.h"

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

/// A call on a thread of its own, while this one handles signals. An exception of Python code or of a signal ends it
/// by `interrupt` and is then raised here.
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

/// @param use  called with options whose interrupt and progress are those of the call
template <class Options, class Use>
auto watched(Options options, const py::object& progress, const Use& use) {
  Watched call;
  options.interrupt = &call.interrupt;
  if (!progress.is_none()) {
    options.progress = [&](const Progress& now) {
      const py::gil_scoped_acquire hold;
      call.guarded([&] { progress(now); });
    };
  }
  return call.call([&] { return use(options); });
}

RunResult call(RunResult (*verb)(const Scene&, const RunOptions&), const Scene& scene, RunOptions options,
               const py::object& progress) {
  return watched(std::move(options), progress, [&](const RunOptions& o) { return verb(scene, o); });
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

Path view(const Scene& scene, const Path& folder, const std::optional<Path>& page, const Frames& frames, int cells, double size, int threads,
          const py::object& progress) {
  if (cells < 0) throw py::value_error("cells: expected a number >= 0");
  const scenes::ViewOptions options{
      .folder = folder, .page = page.value_or(Path()), .frames = frames_of(frames), .threads = threads, .cells = cells, .size = size};
  return watched(options, progress, [&](const scenes::ViewOptions& o) { return scenes::write_view(scene, o).page; });
}

Path write_gltf(const Scene& scene, const Path& folder, const Frames& frames, int threads, const py::object& progress) {
  const RunOptions options{.folder = folder, .frames = frames_of(frames), .threads = threads};
  return watched(options, progress, [&](const RunOptions& o) { return scenes::write_gltf(scene, o); });
}

}  // namespace

void bind_runs(py::module_& module) {
  py::class_<Progress>(module, "Progress", "Progress of a run.")
      .def_readonly("stage", &Progress::stage, "\"simulate\", \"surface\", \"render\" or \"film\".")
      .def_readonly("frame", &Progress::frame, "Present frame.")
      .def_readonly("frame_count", &Progress::frame_count, "Number of frames.")
      .def_readonly("elapsed_s", &Progress::elapsed_s, "Time since the start of the run [s].")
      .def_readonly("left_s", &Progress::left_s, "Estimated time to the end [s]; negative while unknown.")
      .def_readonly("frames_per_s", &Progress::frames_per_s, "Frames per second [1/s]; 0 while unknown.");
  py::class_<RunResult>(module, "RunResult", "How a run ended and which files it wrote.")
      .def_readonly("outcome", &RunResult::outcome,
                    "\"done\", \"diverged\", \"interrupted\", \"limit\", \"io\" or \"invalid\".")
      .def_readonly("reason", &RunResult::reason, "Why the run ended, as a sentence; empty when done.")
      .def_readonly("exit_code", &RunResult::exit_code, "Exit code of the command line tool for this outcome.")
      .def_readonly("frames", &RunResult::frames, "The last frame reached.")
      .def_property_readonly(
          "state_hash", [](const RunResult& r) { return to_hex(r.state_hash); }, "Hash of the last state.")
      .def_property_readonly(
          "folder", [](const RunResult& r) { return r.folder; }, "Output folder.")
      .def_property_readonly(
          "report", [](const RunResult& r) { return r.report; }, "Path of result.json, render.json or export.json.")
      .def_property_readonly(
          "film", [](const RunResult& r) { return r.film.empty() ? std::optional<Path>() : r.film; },
          "Path of the film, or None.")
      .def_property_readonly(
          "warnings", [](const RunResult& r) { return r.warnings; }, "Warnings, as sentences.")
      .def("__repr__", [](const RunResult& r) {
        return py::str("<supple.RunResult {}, {} frames in {}>").format(r.outcome, r.frames, r.folder.string());
      });

  constexpr const char* kCommon =
      "\n\nframes    frames to output, e.g. \"1-50,60,70-90:2\" or [1, 5, 9]; default: all\n"
      "threads   number of threads, 0: all of the machine; does not change results\n"
      "progress  called with a Progress from time to time; an exception in it ends the run after the present step, as Control-C does\n\n"
      "Returns a RunResult however the run ended: see its outcome and reason. Raises Error where no report can be "
      "written: the folder cannot\n"
      "be made, is in use, or holds an earlier result.";
  const std::string run_doc = std::string(
                                  "Runs a scene and writes its files, as `supple run` does: pictures, film, states, tables "
                                  "and result.json in `folder`.") +
                              kCommon;
  const std::string render_doc = std::string(
                                     "Draws the frames of an earlier run from its saved states, as `supple "
                                     "render` does; pictures that are up to date are kept\nunless overwrite is true.") +
                                 kCommon;
  const std::string export_doc =
      std::string(
          "Writes the files of the scene's `output` from the saved states of a run, as `supple export` does.") +
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
  module.def("view", &view, py::arg("scene"), py::arg("folder"), py::arg("page") = py::none(), py::kw_only(), py::arg("frames") = py::none(),
             py::arg("cells") = 0, py::arg("size") = 9.5e6, py::arg("threads") = 0, py::arg("progress") = py::none(),
             "Writes a page that plays a run in a browser, from its saved states, as `supple view` does. Returns its path.\n\n"
             "page      file to write; default: NAME_view.html in the folder\n"
             "frames    frames to show; default: all\n"
             "cells     of the meshes, along the longest side of all surfaces; 0: as many as `size` admits\n"
             "size      largest page [byte]\n"
             "threads   number of threads, 0: all of the machine\n"
             "progress  called with a Progress from time to time");
  module.def("write_gltf", &write_gltf, py::arg("scene"), py::arg("folder"), py::kw_only(), py::arg("frames") = py::none(), py::arg("threads") = 0,
             py::arg("progress") = py::none(),
             "Writes meshes, materials and cameras of a run to one binary glTF file, NAME.glb in its folder, as `supple export --gltf` does. Returns its\n"
             "path.");
  module.def("info", &scenes::describe_run, py::arg("folder"),
             "Describes a run folder in text: outcome, audits, times, files.");

  using scenes::Comparison;
  using scenes::FrameComparison;
  py::class_<FrameComparison>(module, "FrameComparison", "One frame of two runs, compared.")
      .def_readonly("frame", &FrameComparison::frame, "Number of the frame.")
      .def_readonly("psnr", &FrameComparison::psnr, "Peak signal-to-noise ratio [dB]; infinite for equal pictures.")
      .def_readonly("largest", &FrameComparison::largest, "Largest difference of a channel, 0 to 255.");
  py::class_<Comparison>(module, "Comparison", "Two runs, compared picture by picture.")
      .def_property_readonly(
          "frames", [](const Comparison& c) { return c.frames; },
          "The frames that both have, as FrameComparison, ascending.")
      .def_readonly("only_first", &Comparison::only_first, "Number of frames that only the first run has.")
      .def_readonly("only_second", &Comparison::only_second, "Number of frames that only the second run has.")
      .def_property_readonly(
          "film", [](const Comparison& c) { return c.film.empty() ? std::optional<Path>() : c.film; },
          "Path of the film, or None.");
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
      "Puts the frames of two run folders side by side with their difference (times gain) and writes folder/frames, "
      "compare.mp4 and compare.csv.");
}

}  // namespace supple::python
