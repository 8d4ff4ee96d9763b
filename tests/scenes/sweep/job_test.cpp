/// Job files: their texts word for word, what they call, and scenes that they refuse.
#include "supple/scenes/job.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>
#include <vector>
#include <nlohmann/json.hpp>

#include "scenes/small_scenes.h"
#include "supple/core/error.h"
#include "supple/scenes/read_scene.h"
#include "support/source_dir.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using Sets = std::vector<std::string>;

const std::vector<std::pair<JobFormat, const char*>> kFormats{{JobFormat::OpenJd, "openjd.json"}, {JobFormat::Slurm, "slurm.sh"}, {JobFormat::Ray, "ray.py"}};

Scene drops(const Sets& sets = {}) {
  return parse_scene(std::string(small::kTwoDrops) + "duration: 2.5 s\noutput: {images: {size: [96, 64]}, film: true}\n", "two drops.yaml", "/shots/John's", sets);
}

std::string text_in(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::string with_mark(std::string text, const std::string& fingerprint) {
  for (std::size_t at = 0; (at = text.find(fingerprint, at)) != std::string::npos;) text.replace(at, fingerprint.size(), "FINGERPRINT");
  return text;
}

class SweepFolder {
 public:
  explicit SweepFolder(const std::string& plan) : path_(temp_folder() / "a sweep") {
    fs::create_directories(path_);
    std::ofstream(path_ / "sweep.json") << plan;
  }
  ~SweepFolder() { fs::remove_all(path_); }
  SweepFolder(const SweepFolder&) = delete;
  SweepFolder& operator=(const SweepFolder&) = delete;
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

TEST(Jobs, OfAScene) {
  const Scene scene = drops({"objects.left.particles.mass=0.25"});
  for (const auto& [format, file] : kFormats) {
    const std::string text = scene_job(scene, {.format = format, .folder = "/runs/two drops", .chunk = 6, .threads = 2});
    EXPECT_EQ(with_mark(text, fingerprint_of(scene)), text_in(source_dir() / "tests/golden/jobs" / (std::string("scene_") + file))) << file;
  }
}

TEST(Jobs, OfASweep) {
  const SweepFolder sweep(R"({"points": [{}, {}, {}]})");
  EXPECT_TRUE(is_sweep(sweep.path()));
  for (const auto& [format, file] : kFormats) {
    std::string text = with_mark(sweep_job(sweep.path(), {.format = format}), sweep_fingerprint(sweep.path()));
    for (std::size_t at = 0; (at = text.find(sweep.path().string(), at)) != std::string::npos;) text.replace(at, sweep.path().string().size(), "/runs/a sweep");
    EXPECT_EQ(text, text_in(source_dir() / "tests/golden/jobs" / (std::string("sweep_") + file))) << file;
  }
}

TEST(Jobs, GiveEveryFrameToOneTask) {
  for (const int chunk : {1, 2, 5, 20, 21, 22, 1000}) {
    const Scene scene = drops();
    const json job = json::parse(scene_job(scene, {.folder = "/runs/two drops", .chunk = chunk}));
    const json& space = job["steps"][1]["parameterSpace"]["taskParameterDefinitions"];
    const auto numbers = [](const std::string& range) {
      int first = 0, last = 0, step = 1;
      const int read = std::sscanf(range.c_str(), "%d-%d:%d", &first, &last, &step);
      std::vector<int> all;
      for (int k = first; k <= (read > 1 ? last : first); k += step) all.push_back(k);
      return all;
    };
    const std::vector<int> first = numbers(space[0]["range"]), last = numbers(space[1]["range"]);
    ASSERT_EQ(first.size(), last.size()) << chunk;
    int next = 1;
    for (std::size_t k = 0; k < first.size(); ++k) {
      EXPECT_EQ(first[k], next) << chunk;
      next = last[k] + 1;
    }
    EXPECT_GT(next, scene.frame_count()) << chunk;
    EXPECT_LE(first.back(), scene.frame_count()) << chunk;
  }
}

TEST(Jobs, RefuseAnotherScene) {
  const Scene scene = drops();
  const std::string own = fingerprint_of(scene);
  EXPECT_NO_THROW(expect_fingerprint(drops(), own));
  for (const char* set : {"objects.left.particles.mass=2", "camera.from=[0, -4, 1]", "duration=3 s"}) {
    EXPECT_NE(fingerprint_of(drops({set})), own) << set;
  }
  EXPECT_EQ(fingerprint_of(drops({"title=Drops", "output.particles=csv"})), own);  // neither motion nor pictures
  const Scene other = drops({"duration=3 s"});
  try {
    expect_fingerprint(other, own);
    FAIL() << "expected an error";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Scene);
    EXPECT_EQ(std::string(error.what()), "/shots/John's/two drops.yaml: expected the scene that the job was written for, with fingerprint " + own + ", found " +
                                             fingerprint_of(other) + "; write the job again with `supple job`, or use the earlier scene");
  }
}

TEST(Jobs, RefuseAnotherPlanOfASweep) {
  std::string own;
  {
    const SweepFolder sweep(R"({"points": [{}]})");
    own = sweep_fingerprint(sweep.path());
    EXPECT_NO_THROW(expect_sweep_fingerprint(sweep.path(), own));
  }
  const SweepFolder changed(R"({"points": [{}, {}]})");
  EXPECT_THROW(expect_sweep_fingerprint(changed.path(), own), Error);
}

TEST(Jobs, NeedAPlanWithPoints) {
  EXPECT_FALSE(is_sweep(temp_folder()));
  for (const char* plan : {"{}", "[]", R"({"points": []})", R"({"points": 3})", "points"}) {
    const SweepFolder sweep(plan);
    try {
      (void)sweep_job(sweep.path(), {});
      FAIL() << plan;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Io);
      EXPECT_EQ(std::string(error.what()), (sweep.path() / "sweep.json").string() +
                                               ": points: expected the plan of a sweep with a list of points, found none; supple sweep SCENE --out FOLDER --plan-only writes it");
    }
  }
}

TEST(Jobs, NameWhatAFormatCannotHold) {
  const auto message = [](JobFormat format, const char* folder) {
    try {
      (void)scene_job(drops(), {.format = format, .folder = folder});
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Usage);
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(message(JobFormat::OpenJd, "/runs/{{x}}"), "supple job: expected names without '{{', which OpenJD replaces, found '/runs/{{x}}'; choose other names of files and folders");
  EXPECT_NE(message(JobFormat::OpenJd, "/runs/\xff").find("expected names in UTF-8"), std::string::npos);
  EXPECT_NE(message(JobFormat::Ray, "/runs/\xff").find("expected names in UTF-8"), std::string::npos);
  EXPECT_EQ(message(JobFormat::Slurm, "/runs/\xff{{x}}"), "");
}

}  // namespace
}  // namespace supple::scenes
