#include "supple/scenes/run.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>
#include <nlohmann/json.hpp>
#include <string>
#include <tuple>

#include "scenes/small_scenes.h"
#include "supple/core/error.h"
#include "supple/core/io/atomic_file.h"
#include "supple/core/io/read_mesh.h"
#include "supple/render/image.h"
#include "supple/render/layers.h"
#include "supple/scenes/inspect.h"
#include "supple/scenes/output_limits.h"
#include "supple/scenes/query.h"
#include "supple/scenes/read_scene.h"
#include "support/source_dir.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const std::string kTiny = std::string(small::kTwoDrops) + R"(
title: Two drops
duration: 0.5 s
output: {images: {size: [96, 64], samples: 1}, film: true, contacts: csv, particles: csv, mesh: ply, grid: vdb}
)";

class Run : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = temp_folder() / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    scene_ = parse_scene(kTiny, "drops.yaml", ".");
    scene_.source = "drops.yaml";
  }
  void TearDown() override { fs::remove_all(folder_); }

  RunOptions options() const { return {.folder = folder_, .threads = 1}; }
  json result() const {
    std::ifstream file(folder_ / "result.json");
    return json::parse(file);
  }

  fs::path folder_;
  Scene scene_;
};

// A stiff pendulum without damping that falls from the level of its pivot, in steps that the scene bounds.
TEST_F(Run, SaysWhenStepsThatNobodyAskedForDampTheMotion) {
  const auto warnings_of = [&](const std::string& integrator) {
    const Scene scene = parse_scene(R"(
schema: 1
duration: 1 s
frame_rate: 100
gravity: [0, 0, -9.81]
objects:
  - name: pendulum
    particles: {arrange: line, count: 2, spacing: 1, inertia_radius: 1 mm}
    interactions: [{law: bond_frame, stretch: 1e5, rotation: 0}]
    pins: [{particle: 0, orientation: false}]
time_step: {size: 10 ms}
integrator: {method: )" + integrator + "}", "pendulum.yaml", ".");
    RunOptions settings = options();
    settings.overwrite = true;
    return run_scene(scene, settings).warnings;
  };
  const std::vector<std::string> warnings = warnings_of("auto");
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].find("integrator.method: auto chose backward_euler"), 0u) << warnings[0];
  EXPECT_TRUE(warnings_of("backward_euler").empty());
  EXPECT_TRUE(warnings_of("implicit_midpoint").empty());
}

TEST_F(Run, LeavesFramesFilmTablesStatesAndAResult) {
  const RunResult done = run_scene(scene_, options());
  ASSERT_EQ(done.outcome, "done") << done.reason;
  EXPECT_EQ(done.exit_code, 0);
  for (const char* file : {"frames/drops.0001.png", "frames/drops.0005.png", "drops.mp4", "drops_sheet.png",
                           "states/drops.0003.state", "contacts/drops.0003.csv", "particles/drops.0001.csv",
                           "meshes/drops.left.0001.ply", "grids/drops.0001.vdb", "result.json"}) {
    EXPECT_TRUE(fs::exists(folder_ / file)) << file;
  }
  EXPECT_FALSE(fs::exists(folder_ / "frames/drops.0006.png"));
  EXPECT_EQ(render::read_png(folder_ / "frames/drops.0005.png").width, 96);

  const json r = result();
  EXPECT_EQ(r.at("outcome"), "done");
  EXPECT_EQ(r.at("frames"), 5);
  EXPECT_EQ(r.at("state_hash").get<std::string>().size(), 16u);
  for (const char* key : {"momentum_error", "angular_momentum_error", "energy_error", "energy_returned", "contact_residual", "largest_overlap"}) {
    EXPECT_TRUE(r.at("audits").at(key).is_number()) << key;
  }
  EXPECT_LT(r.at("audits").at("momentum_error").get<double>(), 1e-12);
  for (const char* key : {"diameter", "largest_deformation", "final_shape_error"}) {
    EXPECT_TRUE(r.at("objects").at("left").at(key).is_number()) << key;
  }
  for (const StageInfo& stage : stage_table()) {
    const json& s = r.at("stages").at(std::string(stage.name));
    for (const char* key : {"calls", "cpu_s", "visited", "present"}) EXPECT_TRUE(s.at(key).is_number()) << key;
  }
  EXPECT_GT(r.at("stages").at("solve_contact_surface").at("visited").get<int>(), 0);
  EXPECT_GT(r.at("peak_memory_mb").get<double>(), 1.0);
  EXPECT_GT(r.at("wall_s").get<double>(), 0.0);
}

TEST_F(Run, LeavesHeldVolumesInItsReportAndItsDescription) {
  const Scene scene = parse_scene(R"(
schema: 1
duration: 0.25 s
frame_rate: 24
objects:
  - name: held
    particles: {mass: 0.1}
    skeleton: [{shape: point, kernel: {radius: 0.5}}]
    volume: {rate: 8, target: 0.05}
  - name: pair
    particles: {arrange: line, count: 2, spacing: 0.3, at: [2, 0, 0], mass: 0.1}
    interactions: [{law: bond_frame, stretch: 10, rotation: 1}]
    skeleton: [{shape: point, kernel: {radius: 0.5}}]
    volume: {of: particle, target: 0.4}
)", "held.yaml", ".");
  const RunResult run = run_scene(scene, options());
  ASSERT_EQ(run.outcome, "done") << run.reason;
  const json held = result().at("objects").at("held").at("volume"), pair = result().at("objects").at("pair").at("volume");
  EXPECT_EQ(held.at("of"), "object");
  EXPECT_EQ(held.at("target_m3"), json::array({0.05}));
  // The ball of scale^3 times 0.0490621 m^3, as the last step but one left it: the controller closes in on the target.
  EXPECT_NEAR(held.at("volume_m3").at(0).get<double>(), 0.05, 2e-5);
  EXPECT_NEAR(std::pow(held.at("scale").at(0).get<double>(), 3) * 0.0490620628, 0.05, 2e-5);
  EXPECT_EQ(pair.at("of"), "particle");
  EXPECT_EQ(pair.at("target_m3"), json::array({0.4, 0.4}));
  EXPECT_EQ(pair.at("volume_m3").size(), 2u);
  EXPECT_EQ(pair.at("scale").size(), 2u);
  ASSERT_EQ(run.warnings.size(), 1u);
  EXPECT_TRUE(run.warnings[0].starts_with("objects.pair.volume: 2 of 2 volumes by particle miss their targets, most that of particle ")) << run.warnings[0];
  const std::string text = describe_run(folder_);
  EXPECT_NE(text.find("    volume: 0.05 m^3, target 0.05 m^3, kernels scaled by 1.01"), std::string::npos) << text;
  EXPECT_NE(text.find("    volume of particle 1: "), std::string::npos) << text;
}

TEST_F(Run, HasTheSameStateWithAndWithoutOutputs) {
  const RunResult with = run_scene(scene_, options());
  RunOptions quiet = options();
  quiet.folder = folder_ / "quiet";
  quiet.simulate_only = true;
  const RunResult without = run_scene(scene_, quiet);
  EXPECT_EQ(with.state_hash, without.state_hash);
  EXPECT_FALSE(fs::exists(quiet.folder / "frames"));
}

TEST_F(Run, RefusesToReplaceAnEarlierResultUnlessTold) {
  RunOptions o = options();
  o.simulate_only = true;
  (void)run_scene(scene_, o);
  try {
    (void)run_scene(scene_, o);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Io);
    EXPECT_NE(std::string(error.what()).find("--overwrite"), std::string::npos);
  }
  std::ofstream(folder_ / "export.json") << "{}";
  o.overwrite = true;
  EXPECT_EQ(run_scene(scene_, o).outcome, "done");
  EXPECT_FALSE(fs::exists(folder_ / "export.json"));  // of what was replaced
}

TEST_F(Run, WritesNoColumnThatTheDocumentsDoNotDescribe) {
  Scene scene = parse_scene(std::string(small::kTwoDrops) + "duration: 0.1 s\noutput: {contacts: csv, particles: csv, samples: csv}\n", "drops.yaml", ".");
  ASSERT_EQ(run_scene(scene, options()).outcome, "done");
  std::ifstream file(source_dir() / "docs/results.md");
  const std::string described{std::istreambuf_iterator<char>(file), {}};
  for (const char* table : {"contacts/drops.0001.csv", "contacts/drops.pairs.0001.csv", "particles/drops.0001.csv", "samples/drops.0001.csv"}) {
    std::ifstream rows(folder_ / table);
    std::string head, column;
    ASSERT_TRUE(std::getline(rows, head)) << table;
    for (std::istringstream names(head); std::getline(names, column, ',');) {
      EXPECT_NE(described.find('`' + column + '`'), std::string::npos) << table << ": " << column;
    }
  }
}

TEST_F(Run, ReplacesTheResultOfAnotherSceneAndNoFileThatItDidNotWrite) {
  const auto run = [&](const std::string& name, const std::string& output) {
    Scene scene = parse_scene("schema: 1\nduration: 0.1 s\nframe_rate: 20\n" + output +
                                  "objects: [{name: b, particles: {arrange: single}, skeleton: [{shape: point, kernel: {radius: 0.3}}]}]\n",
                              name + ".yaml", ".");
    RunOptions o{.folder = folder_, .threads = 1};
    o.overwrite = true;
    ASSERT_EQ(run_scene(scene, o).outcome, "done");
  };
  run("pile", "output: {particles: [csv, vtk], contacts: vtk, mesh: [ply, usd]}\n");
  for (const char* written : {"particles/pile.0002.csv", "contacts/pile.pairs.0001.vtp", "meshes/pile.b.0003.ply", "pile.usda", "pile_pairs.pvd"}) {
    EXPECT_TRUE(fs::exists(folder_ / written)) << written;
  }
  const std::vector<std::string> kept{"particles/pile.notes.csv", "contacts/pile.csv", "meshes/pile.b.0001.stl", "particles/pile.b.0001.csv",
                                      "meshes/pile.b.01.ply",     "pile_final.mp4",    "pile.html",              "notes.txt"};
  for (const std::string& own : kept) std::ofstream(folder_ / own) << "mine";
  run("drop", "output: {contacts: csv}\n");
  std::set<std::string> found;
  for (const auto& entry : fs::recursive_directory_iterator(folder_)) {
    if (entry.is_regular_file()) found.insert(entry.path().lexically_relative(folder_).string());
  }
  found.erase(".lock");  // held by the process that runs in the folder
  std::set<std::string> expected(kept.begin(), kept.end());
  for (const char* frame : {"0001", "0002", "0003"}) {
    expected.insert(std::string("states/drop.") + frame + ".state");
    for (const char* table : {"contacts/drop.", "contacts/drop.pairs."}) expected.insert(std::string(table) + frame + ".csv");
  }
  expected.insert("result.json");
  EXPECT_EQ(found, expected);
}

TEST_F(Run, DoesNotResumeInTheFolderOfAnotherScene) {
  RunOptions o = options();
  o.simulate_only = true;
  ASSERT_EQ(run_scene(scene_, o).outcome, "done");
  const std::vector<std::byte> before = io::read_file(folder_ / "result.json", std::size_t{1} << 24);
  Scene other = scene_;
  other.source = "drops.again.yaml";  // begins alike
  o.resume = true;
  try {
    (void)run_scene(other, o);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Io);
    EXPECT_NE(std::string(error.what()).find("expected saved states of 'drops.again' to continue from, found those of 'drops'"), std::string::npos)
        << error.what();
  }
  EXPECT_EQ(io::read_file(folder_ / "result.json", std::size_t{1} << 24), before);
  EXPECT_FALSE(fs::exists(folder_ / "states/drops.again.0001.state"));

  o.folder = folder_ / "fresh";  // where nothing was run a run begins
  EXPECT_EQ(run_scene(other, o).outcome, "done");
}

TEST_F(Run, StopsAtASignalAndResumesToTheSameBits) {
  RunOptions o = options();
  o.simulate_only = true;
  o.folder = folder_ / "whole";
  const RunResult whole = run_scene(scene_, o);

  std::atomic<int> signal{0};
  o.folder = folder_ / "stopped";
  o.interrupt = &signal;
  o.progress = [&](const Progress& p) { signal = p.frame >= 3 ? 15 : 0; };
  const RunResult stopped = run_scene(scene_, o);
  EXPECT_EQ(stopped.outcome, "interrupted");
  EXPECT_EQ(stopped.exit_code, 143);
  EXPECT_EQ(stopped.frames, 2);  // the third was under way

  o.interrupt = nullptr;
  o.progress = nullptr;
  o.resume = true;
  const RunResult resumed = run_scene(scene_, o);
  EXPECT_EQ(resumed.outcome, "done");
  EXPECT_EQ(resumed.state_hash, whole.state_hash);
}

TEST_F(Run, EndsAtItsTimeLimitAfterASavedState) {
  RunOptions o = options();
  o.simulate_only = true;
  o.folder = folder_ / "whole";
  const RunResult whole = run_scene(scene_, o);
  o.folder = folder_ / "limited";
  o.time_limit = 1e-9;
  const RunResult limited = run_scene(scene_, o);
  EXPECT_EQ(limited.outcome, "limit");
  EXPECT_EQ(limited.exit_code, 6);
  EXPECT_EQ(limited.frames, 1);
  EXPECT_EQ(limited.reason.rfind("time limit: expected an end within 1e-09 s, found frame 1 saved", 0), 0U) << limited.reason;
  EXPECT_TRUE(fs::exists(folder_ / "limited/states/drops.0001.state"));
  o.time_limit = 1e9;
  o.resume = true;
  const RunResult resumed = run_scene(scene_, o);
  EXPECT_EQ(resumed.outcome, "done");
  EXPECT_EQ(resumed.state_hash, whole.state_hash);
}

TEST_F(Run, RefusesASceneForItsMemoryWithAReport) {
  RunOptions o = options();
  o.scene_memory = 1e4;
  const RunResult result = run_scene(scene_, o);
  EXPECT_EQ(result.outcome, "limit");
  EXPECT_EQ(result.exit_code, 6);
  EXPECT_NE(result.reason.find("in 10 kB of memory"), std::string::npos) << result.reason;
}

// A restart does not count what was done before it.
TEST_F(Run, ReportsTheRateOfTheFramesThatItDid) {
  RunOptions o = options();
  o.simulate_only = true;
  std::atomic<int> signal{0};
  o.interrupt = &signal;
  int frames_before = 0;
  for (const int until : {3, 100}) {
    std::vector<Progress> all;
    signal = 0;
    o.progress = [&](const Progress& p) {
      all.push_back(p);
      signal = p.frame >= until ? 15 : 0;
    };
    const RunResult result = run_scene(scene_, o);
    ASSERT_GE(all.size(), 2u);
    EXPECT_EQ(all.front().frames_per_s, 0.0);
    EXPECT_GT(all.back().frames_per_s, 0.0);
    for (const Progress& p : all) EXPECT_LE(p.frames_per_s * p.elapsed_s, (p.frame - frames_before) * (1.0 + 1e-12));
    frames_before = result.frames;
    o.resume = true;
  }
}

TEST_F(Run, DrawsFramesAgainFromSavedStates) {
  (void)run_scene(scene_, options());
  const render::Image first = render::read_png(folder_ / "frames/drops.0004.png");
  fs::remove(folder_ / "frames/drops.0004.png");
  RunOptions again = options();
  again.frames = {4};
  EXPECT_EQ(render_run(scene_, again).outcome, "done");
  EXPECT_EQ(render::read_png(folder_ / "frames/drops.0004.png").pixels, first.pixels);
}

std::vector<std::byte> bytes_of(const fs::path& path) { return io::read_file(path, std::size_t{1} << 24); }

TEST_F(Run, ExportsFromSavedStatesWhatTheRunWouldHaveWritten) {
  scene_.output.mesh = {MeshName::Usd, MeshName::Obj, MeshName::Ply};
  scene_.output.particles = scene_.output.contacts = {TableName::Csv, TableName::Vtk};
  scene_.output.images.reset();
  scene_.output.film.reset();
  ASSERT_EQ(run_scene(scene_, options()).outcome, "done");
  Scene quiet = scene_;
  quiet.output = {};
  RunOptions other = options();
  other.folder = folder_ / "other";
  ASSERT_EQ(run_scene(quiet, other).outcome, "done");
  const auto before = bytes_of(other.folder / "result.json");
  EXPECT_EQ(export_run(scene_, other).outcome, "done");
  for (const char* file : {"drops.usda", "drops_particles.pvd", "drops_contacts.pvd", "drops_pairs.pvd", "contacts/drops.pairs.0003.vtp", "contacts/drops.pairs.0003.csv", "meshes/drops.left.0003.obj",
                           "meshes/drops.right.0003.ply", "particles/drops.0003.vtp", "contacts/drops.0003.vtp",
                           "contacts/drops.0003.csv"}) {
    EXPECT_EQ(bytes_of(folder_ / file), bytes_of(other.folder / file)) << file;
  }
  EXPECT_TRUE(fs::exists(other.folder / "export.json"));
  EXPECT_EQ(bytes_of(other.folder / "result.json"), before);  // of the run, not of what came after
  EXPECT_THROW((void)export_run(quiet, other), Error);
}

std::vector<std::uint64_t> ids_of(const fs::path& path) {
  std::vector<std::uint64_t> ids;
  std::ifstream in(path);
  std::string line;
  std::getline(in, line);
  EXPECT_EQ(line, "x_m,y_m,z_m,id,object,owner,normal_x,normal_y,normal_z,area_m2");
  while (std::getline(in, line)) {
    std::size_t at = 0;
    for (int comma = 0; comma < 3; ++comma) at = line.find(',', at) + 1;
    ids.push_back(std::stoull(line.substr(at)));
  }
  std::sort(ids.begin(), ids.end());
  return ids;
}

TEST_F(Run, WritesEvenSamplesThatRideOnTheirParticles) {
  scene_.output = {};
  scene_.output.samples = {TableName::Csv, TableName::Vtk};
  scene_.output.sampling.spacing = 0.03;
  const std::uint64_t state = run_scene(scene_, options()).state_hash;
  EXPECT_TRUE(fs::exists(folder_ / "drops_samples.pvd"));
  const std::vector<std::uint64_t> first = ids_of(folder_ / "samples/drops.0001.csv");
  const std::vector<std::uint64_t> last = ids_of(folder_ / "samples/drops.0005.csv");
  EXPECT_GT(first.size(), 100u);
  std::vector<std::uint64_t> kept;
  std::set_intersection(first.begin(), first.end(), last.begin(), last.end(), std::back_inserter(kept));
  EXPECT_GT(kept.size(), first.size() * 9 / 10);

  // Asking for them changes no state; saved states give the same ones, also of a single frame, and so does a run that
  // was stopped and resumed.
  Scene quiet = scene_;
  quiet.output = {};
  RunOptions other = options();
  other.folder = folder_ / "other";
  EXPECT_EQ(run_scene(quiet, other).state_hash, state);
  other.frames = {4};
  ASSERT_EQ(export_run(scene_, other).outcome, "done");
  EXPECT_FALSE(fs::exists(other.folder / "samples/drops.0003.csv"));
  EXPECT_EQ(bytes_of(folder_ / "samples/drops.0004.csv"), bytes_of(other.folder / "samples/drops.0004.csv"));
  const auto before = bytes_of(folder_ / "samples/drops.0005.csv");
  for (const char* file : {"states/drops.0004.state", "states/drops.0005.state", "samples/drops.0005.csv"}) fs::remove(folder_ / file);
  RunOptions resumed = options();
  resumed.resume = true;
  resumed.threads = 3;
  ASSERT_EQ(run_scene(scene_, resumed).outcome, "done");
  EXPECT_EQ(bytes_of(folder_ / "samples/drops.0005.csv"), before);

  // By density instead, and the key of the spacing in what is refused.
  scene_.output.sampling = {.spacing = {}, .density = 4e3};
  RunOptions dense = options();
  dense.folder = folder_ / "dense";
  ASSERT_EQ(run_scene(scene_, dense).outcome, "done");
  EXPECT_GT(ids_of(dense.folder / "samples/drops.0001.csv").size(), 2 * first.size());
  scene_.output.sampling = {.spacing = 1e-6, .density = {}};
  dense.overwrite = true;
  const RunResult refused = run_scene(scene_, dense);
  EXPECT_EQ(refused.outcome, "limit");
  EXPECT_NE(refused.reason.find("output.sampling.spacing"), std::string::npos) << refused.reason;
}

TEST_F(Run, KeepsPicturesThatShowTheSameSceneAndState) {
  scene_.output.film.reset();
  ASSERT_EQ(run_scene(scene_, options()).pictures_drawn, 5);
  EXPECT_EQ(render_run(scene_, options()).pictures_kept, 5);
  fs::remove(folder_ / "frames/drops.0002.png");
  RunResult result = render_run(scene_, options());
  EXPECT_EQ(result.pictures_kept, 4);
  EXPECT_EQ(result.pictures_drawn, 1);
  RunOptions all = options();
  all.overwrite = true;
  EXPECT_EQ(render_run(scene_, all).pictures_drawn, 5);

  const std::vector<std::string> title{"title=Other"}, colour{"objects.left.colour=[1, 0, 0]"};
  EXPECT_EQ(render_run(parse_scene(kTiny, "drops.yaml", ".", title), options()).pictures_kept, 5);
  Scene red = parse_scene(kTiny, "drops.yaml", ".", colour);
  const auto before = bytes_of(folder_ / "frames/drops.0003.png");
  result = render_run(red, options());
  EXPECT_EQ(result.pictures_drawn, 5);
  EXPECT_NE(bytes_of(folder_ / "frames/drops.0003.png"), before);
}

TEST_F(Run, DrawsFramesAtTheSameTimeWithTheSameBytes) {
  scene_.output.film.reset();
  ASSERT_EQ(run_scene(scene_, options()).outcome, "done");
  std::vector<std::vector<std::byte>> before;
  for (int frame = 1; frame <= 5; ++frame) before.push_back(bytes_of(folder_ / ("frames/drops.000" + std::to_string(frame) + ".png")));
  RunOptions o = options();
  o.overwrite = true;
  o.frames_at_once = 3;
  RunResult result = render_run(scene_, o);
  EXPECT_EQ(result.outcome, "done") << result.reason;
  EXPECT_EQ(result.frames_at_once, 3);
  EXPECT_EQ(result.pictures_drawn, 5);
  EXPECT_EQ(result.pictures.images, 5);
  for (int frame = 1; frame <= 5; ++frame) {
    EXPECT_EQ(bytes_of(folder_ / ("frames/drops.000" + std::to_string(frame) + ".png")), before[static_cast<std::size_t>(frame - 1)]) << frame;
  }
  o.memory = 1.0;  // a byte has room for none beside the first
  result = render_run(scene_, o);
  EXPECT_EQ(result.frames_at_once, 1);
  EXPECT_EQ(result.pictures_drawn, 5);
  // What is current stays, and a state that cannot be read is reported.
  o.memory = 0.0;
  o.overwrite = false;
  fs::remove(folder_ / "frames/drops.0002.png");
  fs::remove(folder_ / "frames/drops.0004.png");
  result = render_run(scene_, o);
  EXPECT_EQ(result.pictures_drawn, 2);
  EXPECT_EQ(result.pictures_kept, 3);
  o.overwrite = true;
  fs::resize_file(folder_ / "states/drops.0003.state", 100);
  result = render_run(scene_, o);
  EXPECT_EQ(result.outcome, "io");
  EXPECT_NE(result.reason.find("drops.0003.state"), std::string::npos) << result.reason;
}

TEST_F(Run, DrawsMissingPicturesOnResuming) {
  scene_.output.film.reset();
  ASSERT_EQ(run_scene(scene_, options()).outcome, "done");
  const auto second = bytes_of(folder_ / "frames/drops.0002.png");
  fs::remove(folder_ / "frames/drops.0002.png");
  RunOptions o = options();
  o.resume = true;
  ASSERT_EQ(run_scene(scene_, o).outcome, "done");
  EXPECT_EQ(bytes_of(folder_ / "frames/drops.0002.png"), second);
}

TEST_F(Run, IsDescribedAndCompared) {
  ASSERT_EQ(run_scene(scene_, options()).outcome, "done");
  const std::string text = describe_run(folder_);
  EXPECT_NE(text.find("1 particle in 1 piece, largest deformation"), std::string::npos) << text;
  for (const char* part : {"Two drops", "outcome     done", "frames      5 of 5", "momentum_error", "left ", "solve_contact_surface",
                           "frames/*.png", "states/*.state", "drops.mp4"}) {
    EXPECT_NE(text.find(part), std::string::npos) << part << "\n" << text;
  }
  EXPECT_THROW((void)describe_run(folder_ / "frames"), Error);

  const std::vector<std::string> colour{"objects.left.colour=[1, 0, 0]", "duration=0.375 s"};
  RunOptions other = options();
  other.folder = folder_ / "red";
  ASSERT_EQ(run_scene(parse_scene(kTiny, "drops.yaml", ".", colour), other).outcome, "done");
  const Comparison same = compare_runs({.first = folder_, .second = folder_, .folder = folder_ / "same"});
  ASSERT_EQ(same.frames.size(), 5u);
  for (const FrameComparison& f : same.frames) EXPECT_EQ(f.largest, 0);
  const Comparison differ = compare_runs({.first = folder_, .second = other.folder, .folder = folder_ / "differ"});
  EXPECT_EQ(differ.frames.size(), 4u);
  EXPECT_EQ(differ.only_first, 1);
  EXPECT_EQ(differ.only_second, 0);
  for (const FrameComparison& f : differ.frames) {
    EXPECT_GT(f.largest, 10);
    EXPECT_LT(f.psnr, 45.0);
  }
  EXPECT_EQ(render::read_png(folder_ / "differ/frames/compare.0001.png").width, 3 * 96 + 4 * 2);
  EXPECT_TRUE(fs::exists(folder_ / "differ/compare.mp4"));
  EXPECT_TRUE(fs::exists(folder_ / "differ/compare.csv"));
}

TEST_F(Run, WritesPicturesForCompositing) {
  const std::vector<std::string> exr{"output={images: {size: [96, 64], samples: 1, formats: [png, exr]}}"};
  scene_ = parse_scene(kTiny, "drops.yaml", ".", exr);
  RunOptions o = options();
  o.frames = {1, 3};
  ASSERT_EQ(run_scene(scene_, o).outcome, "done");
  EXPECT_TRUE(fs::exists(folder_ / "frames/drops.0003.png"));
  EXPECT_EQ(render::exr_fingerprint(folder_ / "frames/drops.0003.exr"), render::png_fingerprint(folder_ / "frames/drops.0003.png"));
  EXPECT_EQ(render_run(scene_, o).pictures_kept, 2);
  fs::remove(folder_ / "frames/drops.0003.exr");
  EXPECT_EQ(render_run(scene_, o).pictures_drawn, 1);
}

TEST_F(Run, GathersTheFramesBeforeARestartToo) {
  scene_.output = {};
  scene_.output.mesh = {MeshName::Usd};
  RunOptions o = options();
  o.folder = folder_ / "whole";
  ASSERT_EQ(run_scene(scene_, o).outcome, "done");
  std::atomic<int> signal{0};
  RunOptions stopped = options();
  stopped.interrupt = &signal;
  stopped.progress = [&](const Progress& p) { signal = p.frame >= 3 ? 15 : 0; };
  ASSERT_EQ(run_scene(scene_, stopped).outcome, "interrupted");
  EXPECT_FALSE(fs::exists(folder_ / "drops.usda"));
  stopped.interrupt = nullptr;
  stopped.progress = nullptr;
  stopped.resume = true;
  ASSERT_EQ(run_scene(scene_, stopped).outcome, "done");
  EXPECT_EQ(bytes_of(folder_ / "drops.usda"), bytes_of(o.folder / "drops.usda"));
}

TEST_F(Run, WritesForEarlierFramesTooWhatARestartAsksForFirst) {
  scene_.output = {};
  std::atomic<int> signal{0};
  RunOptions stopped = options();
  stopped.interrupt = &signal;
  stopped.progress = [&](const Progress& p) { signal = p.frame >= 3 ? 15 : 0; };
  ASSERT_EQ(run_scene(scene_, stopped).outcome, "interrupted");
  scene_.output.mesh = {MeshName::Ply, MeshName::Obj};
  scene_.output.particles = {TableName::Csv, TableName::Vtk};
  scene_.output.contacts = {TableName::Csv};
  scene_.output.grid = {GridName::Vdb};
  RunOptions o = options();
  o.folder = folder_ / "whole";
  const RunResult whole = run_scene(scene_, o);
  ASSERT_EQ(whole.outcome, "done");
  o.folder = folder_;
  o.resume = true;
  EXPECT_EQ(run_scene(scene_, o).state_hash, whole.state_hash);
  std::size_t files = 0;
  for (const char* part : {"meshes", "particles", "contacts", "grids"}) {
    for (const auto& entry : fs::directory_iterator(folder_ / "whole" / part)) {
      const fs::path here = folder_ / part / entry.path().filename();
      EXPECT_TRUE(fs::exists(here)) << here;
      EXPECT_TRUE(std::string(part) == "grids" || bytes_of(here) == bytes_of(entry.path())) << here;
      ++files;
    }
  }
  EXPECT_EQ(files, 5u * (2 * 2 + 2 + 2 + 1));
  // Each kind is missed by itself.
  for (const char* part : {"meshes", "particles", "contacts", "grids"}) {
    std::vector<fs::path> lost;
    for (const auto& entry : fs::directory_iterator(folder_ / part))
      if (entry.path().filename().string().find(".0002.") != std::string::npos) lost.push_back(entry.path());
    ASSERT_FALSE(lost.empty()) << part;
    for (const fs::path& file : lost) fs::remove(file);
    EXPECT_EQ(run_scene(scene_, o).outcome, "done") << part;
    for (const fs::path& file : lost) EXPECT_TRUE(fs::exists(file)) << file;
  }
}

TEST_F(Run, RefusesTooFineCellsWordForWord) {
  const std::string ball = R"(
schema: 1
duration: 0.1 s
frame_rate: 10
objects:
  - name: ball
    particles: {mass: 1}
    skeleton: [{shape: point, kernel: {radius: 1}}]
output: )";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"{mesh: ply, cell: 1.8 mm}",
       "ball.yaml:9:27: output.cell: expected at most 1000000000 lattice nodes around the body, found about 1.38e+09 with cells of 0.0018 m; "
       "use cells of at least 0.00211 m"},
      {"{grid: vdb, cell: 0.1 mm}",
       "ball.yaml:9:27: output.cell: expected a surface in at most 200000000 voxels, found about 6.39e+09 with cells of 0.0001 m; use cells of "
       "at least 0.000593 m"},
      {"{samples: csv, sampling: {spacing: 10 mm}}",
       "ball.yaml:9:44: output.sampling.spacing: expected at most 1000000000 lattice nodes around the body, found about 1.74e+09 with cells of "
       "0.00167 m; use cells of at least 0.00211 m, which are a sixth of the spacing"},
      {"{samples: csv, sampling: {density: 1e12}}",
       "ball.yaml:9:44: output.sampling.density: expected at most 1000000000 lattice nodes around the body, found about 8.24e+20 with cells of "
       "2.13e-07 m for a density of 1e+12 [1/m^2]; use cells of at least 0.0021 m, which are a sixth of the spacing, 1.28 / sqrt(density)"},
      {"{mesh: ply, meshing: {error: 1e-12}}",
       "ball.yaml:9:38: output.meshing.error: expected an error of at most 1e-12 m, found 0.000155 m with triangles of 0.0156 m, and a mesh "
       "that meets it is too large; allow at least 1.27e-06 m"},
      {"{mesh: ply, cell: 1 mm, meshing: {error: 1 mm}}",
       "ball.yaml:9:27: output.cell: expected at most 1000000000 lattice nodes around the body, found about 8.04e+09 with cells of 0.001 m; "
       "use cells of at least 0.0021 m"}};
  for (const auto& [output, message] : cases) {
    RunOptions o = options();
    o.overwrite = true;
    const RunResult refused = run_scene(parse_scene(ball + output + '\n', "ball.yaml", "."), o);
    EXPECT_EQ(refused.outcome, "limit");
    EXPECT_EQ(refused.reason, message);
  }
}

TEST_F(Run, RefusesSamplesOfWhatIsFarTooThinWhateverTheirSpacing) {
  const Scene foil = parse_scene(R"(
schema: 1
duration: 0.1 s
frame_rate: 10
objects:
  - name: foil
    particles: {mass: 1}
    skeleton: [{shape: disc, radius: 20, kernel: {radius: 1 mm}}]
output: {samples: csv, sampling: {spacing: 1}}
)",
                                 "foil.yaml", ".");
  RunOptions o = options();
  o.overwrite = true;
  const RunResult refused = run_scene(foil, o);
  EXPECT_EQ(refused.outcome, "limit");
  EXPECT_EQ(refused.reason,
            "foil.yaml:9:19: output.samples: expected a surface in at most 1000000 blocks of 8^3 cells, found about 3.26e+08 with cells of 0.0005 m, "
            "half the size of the smallest features of 'foil'; make these features larger, or the object smaller");
}

TEST_F(Run, RefusesThinSurfacesAndOwnCellsByTheirKeys) {
  const auto reason_of = [&](const std::string& object, const std::string& output) {
    RunOptions o = options();
    o.overwrite = true;
    const RunResult refused = run_scene(parse_scene("schema: 1\nduration: 0.1 s\nframe_rate: 10\nobjects:\n  - name: ball\n    particles: "
                                                    "{mass: 1}\n" + object + "output: " + output + '\n', "ball.yaml", "."), o);
    EXPECT_EQ(refused.outcome, "limit");
    return refused.reason;
  };
  const std::string point = "    skeleton: [{shape: point, kernel: {radius: 1}}]\n";
  const std::string disc = "    skeleton: [{shape: disc, radius: 100, kernel: {radius: 1 mm}}]\n";
  EXPECT_EQ(reason_of(point + "    iso: 0.9999999\n", "{mesh: ply}"),
            "ball.yaml:8:10: objects.ball.iso: expected at most 1000000000 lattice nodes around the body, found about 8.41e+13 with cells of "
            "4.56e-05 m, 8 across a surface 0.000365148 m thick; use cells of at least 0.0021 m in output.cell, or make the surface thicker");
  EXPECT_EQ(reason_of(disc, "{grid: vdb}"),
            "ball.yaml:7:15: objects.ball.skeleton: expected a surface in at most 200000000 voxels, found about 7.97e+13 with cells of "
            "0.000114 m, 8 across a surface 0.000908404 m thick; use cells of at least 0.0753 m in output.cell, or make the surface thicker");
  EXPECT_EQ(reason_of(disc, "{grid: vdb, cell: 0.1 mm}"),
            "ball.yaml:8:27: output.cell: expected a surface in at most 200000000 voxels, found about 1.03e+14 with cells of 0.0001 m; use "
            "cells of at least 0.0753 m");
  EXPECT_EQ(reason_of(point + "    meshing: {cell: 1e-5}\n", "{grid: vdb}"),
            "ball.yaml:8:21: objects.ball.meshing.cell: expected a surface in at most 200000000 voxels, found about 6.24e+11 with cells of "
            "1e-05 m; use cells of at least 0.000586 m");
}

/// Warnings about the outputs of a scene at its start; may be empty.
std::string told_at_the_start(const Scene& scene) {
  Simulation simulation(scene);
  try {
    expect_output_sizes(simulation, requested_outputs(scene));
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST_F(Run, TellsAnErrorOutOfReachBeforeAStepAsItRefusesIt) {
  const auto scene_of = [](const std::string& own, const std::string& output, const std::string& beside) {
    std::string objects;
    for (const std::string& at : {std::string("0"), beside}) {
      objects += std::string("  - {name: ball") + (at == "0" ? "" : "_beside") + ", particles: {at: [" + at +
                 ", 0, 0], mass: 1}, skeleton: [{shape: point, kernel: {radius: 1}}], contact: {modulus: 1e3}" + own + "}\n";
    }
    return parse_scene("schema: 1\nduration: 0.1 s\nframe_rate: 10\nobjects:\n" + objects + "output: " + output + '\n', "balls.yaml", ".");
  };
  for (const auto& [own, output, key] : {std::tuple{"", "{mesh: ply, meshing: {error: 1e-12}}", ": output.meshing.error: expected"},
                                         std::tuple{", meshing: {error: 1e-12}", "{mesh: ply}", ": objects.ball.meshing.error: expected"}}) {
    for (const char* beside : {"0.8", "3"}) {  // where they touch, and apart
      const Scene scene = scene_of(own, output, beside);
      RunOptions o = options();
      o.overwrite = true;
      const std::string refused = run_scene(scene, o).reason;
      EXPECT_NE(refused.find(key), std::string::npos) << refused;
      EXPECT_EQ(told_at_the_start(scene), refused);
    }
  }
  for (const char* beside : {"0.8", "3"}) EXPECT_EQ(told_at_the_start(scene_of("", "{mesh: ply, meshing: {error: 0.01}}", beside)), "");
}

TEST_F(Run, TellsTooFineCellsBeforeAStepAsItRefusesThem) {
  const auto scene_of = [](const std::string& output, bool touching) {
    const bool whole = output.starts_with("{images") || output.starts_with("{samples");
    const std::string shape = whole ? "shape: point" : "shape: segment, half_length: 0.3";  // all nodes are counted, or those of the surface
    std::string objects;
    for (const double x : {0.0, touching ? 0.8 : 3.0}) {
      objects += "  - {name: rod" + std::to_string(static_cast<int>(10.0 * x)) + ", particles: {at: [" + std::to_string(x) +
                 ", 0, 0], mass: 1}, skeleton: [{" + shape + ", kernel: {radius: 1}}], contact: {modulus: 1e3}}\n";
    }
    return parse_scene("schema: 1\nduration: 0.3 s\nframe_rate: 10\nobjects:\n" + objects + "output: " + output + '\n', "rods.yaml", ".");
  };
  for (const bool touching : {false, true}) {
    for (const std::string output : {"{mesh: ply, cell: 1e-10, meshing: {method: cubes}}", "{mesh: ply, cell: 1e-5, meshing: {method: tetrahedra}}",
                                     "{mesh: ply, cell: 1e-5, meshing: {method: openvdb}}", "{mesh: ply, cell: 1e-10}",
                                     "{images: {size: [64, 64]}, cell: 1e-5}", "{samples: csv, sampling: {density: 1e12}}",
                                     "{grid: vdb, cell: 1e-5}"}) {
      if (touching && output != "{mesh: ply, cell: 1e-10}") continue;  // methods divide alike, bulges in grids are looked at when they are made
      const Scene scene = scene_of(output, touching);
      RunOptions o = options();
      o.overwrite = true;
      const std::string refused = run_scene(scene, o).reason;
      EXPECT_NE(refused.find("use cells of at least"), std::string::npos) << output << refused;
      EXPECT_EQ(told_at_the_start(scene), refused) << output << touching;
    }
    for (const std::string output : {"{mesh: ply, cell: 0.05}", "{grid: vdb, cell: 0.05}", "{samples: csv}"}) {
      EXPECT_EQ(told_at_the_start(scene_of(output, touching)), "") << output << touching;
    }
  }
  RunOptions last = options();
  last.overwrite = true;
  last.frames = {3};
  const RunResult refused = run_scene(scene_of("{mesh: ply, cell: 1e-10}", false), last);
  EXPECT_EQ(refused.outcome, "limit");
  EXPECT_EQ(refused.frames, 0);
}

TEST_F(Run, SaysWhenAFolderCannotBeMade) {
  std::ofstream(temp_folder() / "plain_file") << "x";
  RunOptions o = options();
  o.folder = temp_folder() / "plain_file" / "out";
  try {
    (void)run_scene(scene_, o);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Io);
    EXPECT_NE(std::string(error.what()).find("plain_file"), std::string::npos) << error.what();
  }
}

TEST_F(Run, RefusesFramesBehindTheLastOne) {
  RunOptions o = options();
  o.frames = {6, 7};
  try {
    (void)run_scene(scene_, o);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Usage);
    EXPECT_STREQ(error.what(), "--frames: expected a frame from 1 to 5, found none before 6; frame n shows t = (n - 1) / frame_rate");
  }
  EXPECT_FALSE(fs::exists(folder_));  // nothing is left
  o.frames = {5, 6};
  EXPECT_EQ(run_scene(scene_, o).outcome, "done");
}

TEST_F(Run, IsComparedByTheCameraThatIsNamed) {
  std::string scene = kTiny;
  const std::size_t camera = scene.find("camera:");
  scene.replace(camera, scene.find('\n', camera) - camera, "cameras: [{name: front}, {name: above, from: [0, -0.1, 4]}]");
  ASSERT_EQ(run_scene(parse_scene(scene, "drops.yaml", "."), options()).outcome, "done");
  ComparisonOptions two{.first = folder_, .second = folder_, .folder = folder_ / "same", .film = false};
  try {
    (void)compare_runs(two);
    FAIL() << "it is open which camera is meant";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Usage);
    EXPECT_EQ(error.faults()[0].found, "drops.above, drops.front");
  }
  two.camera = "above";
  EXPECT_EQ(compare_runs(two).frames.size(), 5u);
  const render::Image above = render::read_png(folder_ / "frames/drops.above.0001.png");
  const render::Image row = render::read_png(folder_ / "same/frames/compare.0001.png");
  for (std::size_t y = 0; y < 64; ++y) {  // the picture on the left, 2 pixels in
    const auto line = row.pixels.begin() + 3 * static_cast<std::ptrdiff_t>((y + 2) * static_cast<std::size_t>(row.width) + 2);
    ASSERT_TRUE(std::equal(line, line + 3 * 96, above.pixels.begin() + 3 * 96 * static_cast<std::ptrdiff_t>(y))) << y;
  }
}

TEST(Frames, AreRangesWithSteps) {
  EXPECT_EQ(parse_frames("1-3,7,10-20:5"), (std::set<int>{1, 2, 3, 7, 10, 15, 20}));
  EXPECT_EQ(parse_frames("1, 4-4:2, 5-6:2147483647"), (std::set<int>{1, 4, 5}));
  for (const char* bad : {"", "0", "3-1", "1-5:0", "x", "1,", "1-2-3", "1.5", "5:2", "1-", "1-2:", "1-9999999", "99999999999"}) {
    EXPECT_THROW((void)parse_frames(bad), Error) << bad;
  }
}

TEST(Query, AnswersForcesContactFieldAndMeshAsJson) {
  Scene scene = parse_scene(kTiny, "drops.yaml", ".");
  scene.objects[0].particles.at = Vec3(-0.2, 0, 0);
  scene.objects[1].particles.at = Vec3(0.2, 0, 0);
  Simulation simulation(scene);

  const json forces = json::parse(query_forces(simulation));
  EXPECT_EQ(forces.at("laws").back().at("name"), "contact");
  const json contact = json::parse(query_contact(simulation, true));
  ASSERT_EQ(contact.at("pairs").size(), 1u);
  const json& pair = contact.at("pairs")[0];
  EXPECT_EQ(pair.at("a"), "left");
  EXPECT_LT(pair.at("force_n")[0].get<double>(), 0.0);
  EXPECT_EQ(pair.at("samples").size(), pair.at("points").get<std::size_t>());
  // The contact law's force on the left drop is the pair's force.
  EXPECT_DOUBLE_EQ(forces.at("laws").back().at("particles")[0].at("force")[0].get<double>(),
                   pair.at("force_n")[0].get<double>());

  const fs::path points = temp_folder() / "points.csv";
  std::ofstream(points) << "x,y,z\n-0.2,0,0\n5,5,5\n";
  const json field = json::parse(query_field(simulation, points));
  EXPECT_DOUBLE_EQ(field.at("objects")[0].at("points")[0].at("value").get<double>(), 0.5);
  EXPECT_DOUBLE_EQ(field.at("objects")[0].at("points")[1].at("value").get<double>(), -0.5);

  const json mesh = json::parse(query_mesh(simulation, {.cells = 24, .out = {}}));
  EXPECT_TRUE(mesh.at("objects")[0].at("closed").get<bool>());
  EXPECT_EQ(mesh.at("objects")[0].at("euler_characteristic"), 2);
  const fs::path file = temp_folder() / "queried.obj";
  (void)query_mesh(simulation, {.cells = 24, .out = file});
  std::size_t vertices = 0;
  for (const auto& object : mesh.at("objects")) {
    const std::string name = object.at("name");
    const Mesh written = io::read_mesh(mesh.at("objects").size() == 1 ? file : file.parent_path() / ("queried." + name + ".obj"));
    EXPECT_EQ(written.vertex_count(), object.at("vertices").get<std::size_t>());
    vertices += written.vertex_count();
  }
  EXPECT_GT(vertices, 0u);
  EXPECT_THROW((void)query_mesh(simulation, {.cells = 24, .out = "mesh.stl"}), Error);
}

TEST(Query, OfAMeshNamesTheCellsOrTheErrorThatItWasMadeBy) {
  const auto made_by = [](const std::vector<std::string>& overrides) {
    Simulation simulation(parse_scene(kTiny, "drops.yaml", ".", overrides));
    const json object = json::parse(query_mesh(simulation, {})).at("objects")[0];
    return std::pair(object.at("cell_m"), object.at("error_m"));
  };
  EXPECT_EQ(made_by({"output.cell=0.03"}), std::pair(json(0.03), json()));
  EXPECT_EQ(made_by({"output.meshing.error=0.005"}), std::pair(json(), json(0.005)));
  EXPECT_EQ(made_by({"output.cell=0.03", "output.meshing.error=0.005"}), std::pair(json(0.03), json(0.005)));
  EXPECT_EQ(made_by({"output.cell=0.03", "objects.left.meshing.cell=0.02"}), std::pair(json(0.02), json()));
}

}  // namespace
}  // namespace supple::scenes
