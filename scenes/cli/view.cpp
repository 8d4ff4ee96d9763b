#include "view.h"

#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "library.h"
#include "print.h"
#include "supple/core/counted.h"
#include "supple/core/error.h"
#include "supple/core/io/atomic_file.h"
#include "supple/scenes/limits.h"
#include "supple/scenes/read_scene.h"
#include "view_server.h"

namespace supple::tool {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLargestReport = std::size_t{1} << 24;  // [byte]

/// What a run was of, by its report.
struct RunOf {
  std::string scene;             ///< its file
  std::vector<std::string> set;  ///< overrides of its keys
};

/// @throws Error{Io}
RunOf run_of(const fs::path& folder) {
  const fs::path path = folder / "result.json";
  const bool there = fs::exists(path);
  const std::vector<std::byte> bytes = there ? io::read_file(path, kLargestReport) : std::vector<std::byte>();
  const char* text = reinterpret_cast<const char*>(bytes.data());
  const nlohmann::json report = nlohmann::json::parse(text, text + bytes.size(), nullptr, false);
  if (report.is_object() && report.contains("scene_file") && report["scene_file"].is_string()) {
    RunOf out{.scene = report["scene_file"], .set = {}};
    for (const nlohmann::json& one : report.value("set", nlohmann::json::array())) {
      if (one.is_string()) out.set.push_back(one);
    }
    return out;
  }
  throw Error(ErrorKind::Io, Fault{.place = path.string(),
                                   .key = {},
                                   .expected = "expected the report of a run with its 'scene_file'",
                                   .found = there ? "none" : "no such file",
                                   .hint = "name the scene instead: supple view SCENE --out " + folder.string()});
}

}  // namespace

CLI::App* add_view(CLI::App& app, ViewArguments& a) {
  CLI::App* verb = app.add_subcommand("view", "write a page that plays a run in a browser, or serve it");
  verb->add_option("run", a.run, "run folder, or the scene with --out")->required();
  verb->add_option("--set", a.set, "override a key, as the run did where a scene is named; may be repeated")->take_all();
  verb->add_option("--allow-path", a.allowed, "file or folder outside the scene's folder that the scene may read; may be repeated")->take_all();
  verb->add_option("--out", a.out, "run folder, where a scene is named (default: out/NAME)");
  verb->add_option("--page", a.page, "file to write (default: NAME_view.html in the run folder)");
  verb->add_option("--frames", a.frames, "frames to show, e.g. 1-50,60,70-90:2 (default: all)");
  verb->add_option("--cells", a.cells, "cells of the meshes along the longest side (default: as many as --size admits)")->check(CLI::Range(4, 1024));
  verb->add_option_function<std::string>("--size", [&a](const std::string& text) { a.size = scenes::parse_bytes(text); }, "largest page, such as 20M (default: 9.5M)")
      ->check([](const std::string& text) { return scenes::parse_bytes(text) > 0.0 ? std::string() : "expected a size > 0, such as 20M, found " + text; });
  verb->add_option("--threads", a.threads, "number of threads (default: all); does not change the page")->check(CLI::Range(0, 1024));
  verb->add_flag("--serve", a.serve, "serve the page to this machine until Control-C and follow a run that goes on");
  verb->add_option("--port", a.port, "with --serve: port (default: any that is free)")->check(CLI::Range(0, 65535));
  verb->add_option("--progress", a.progress, "auto, bar, plain or none")->check(CLI::IsMember({"auto", "bar", "plain", "none"}));
  verb->add_flag("--quiet", a.quiet, "print warnings and errors only");
  verb->footer("The page needs no network and no other file. Keys: space plays, arrows step.\n\nExample: supple view out/two_balls");
  return verb;
}

int view(const ViewArguments& a, const std::atomic<int>& interrupt) {
  const bool is_folder = fs::is_directory(a.run);
  RunOf of = is_folder ? run_of(a.run) : RunOf{.scene = find_scene(a.run), .set = {}};
  of.set.insert(of.set.end(), a.set.begin(), a.set.end());
  const std::vector<fs::path> allowed(a.allowed.begin(), a.allowed.end());
  const scenes::Scene scene = scenes::read_scene(of.scene, of.set, allowed);
  const fs::path folder = is_folder ? fs::path(a.run) : a.out.empty() ? fs::path("out") / scenes::scene_name(scene) : fs::path(a.out);
  if (a.serve) {
    ViewServer server(scene, {.folder = folder, .port = a.port, .cells = a.cells > 0 ? a.cells : scenes::kFollowedViewCells, .interrupt = &interrupt});
    fs::exists(folder / "result.json") ? server.end() : server.begin();
    print(std::cout, "view:   %s (Control-C ends it)\n", server.address().c_str());
    std::cout.flush();
    server.wait();
    return 0;
  }
  ProgressBar bar(a.quiet ? ProgressStyle::None : progress_style(a.progress));
  scenes::ViewOptions options{.folder = folder, .page = a.page, .threads = a.threads, .cells = a.cells, .interrupt = &interrupt};
  if (!a.frames.empty()) options.frames = scenes::parse_frames(a.frames);
  if (a.size > 0.0) options.size = a.size;
  options.progress = [&bar](const scenes::Progress& progress) { bar.show(progress); };
  const scenes::ViewResult result = scenes::write_view(scene, options);
  bar.finish();
  if (!a.quiet) {
    print(std::cout, "view:   %s (%s, %.1f MB, meshes of %d cells)\n", result.page.c_str(), counted(static_cast<std::size_t>(result.frames), "frame").c_str(), 1e-6 * static_cast<double>(result.bytes), result.cells);
  }
  return 0;
}

}  // namespace supple::tool
