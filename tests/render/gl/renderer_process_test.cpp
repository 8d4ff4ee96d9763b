// What a driver reads once in a process is tested in processes of its own: this program starts itself.
#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>

#include "render/shapes.h"
#include "render/support.h"
#include "supple/render/renderer.h"

namespace supple::render::test {
namespace {

constexpr const char* kTarget = "SUPPLE_TEST_PICTURE";

void write_picture(const std::string& path) {
  const std::array meshes = {sphere(Vec3(-0.5, 0, 0.5), 0.5, 24), sphere(Vec3(0.45, 0, 0.45), 0.45, 24)};
  const std::array items = {Item{.mesh = &meshes[0], .colour = Vec3(0.9, 0.3, 0.1)},
                            Item{.mesh = &meshes[1], .colour = Vec3(0.1, 0.3, 0.9)}};
  View view;
  view.ground = Ground{};
  RenderSettings settings;
  settings.width = 320;
  settings.height = 180;
  write_png(path, make_renderer(settings)->render(view, items));
}

Image picture_with_threads(const Folder& folder, const char* threads) {
  const std::filesystem::path path = folder / (std::string("threads") + threads + ".png");
  ::setenv("LP_NUM_THREADS", threads, 1);
  ::setenv(kTarget, path.c_str(), 1);
  std::string program = "/proc/self/exe";
  std::string filter = "--gtest_filter=RendererProcess.GivesTheSameBytesForEveryThreadCountOfTheDriver";
  std::array<char*, 3> argv = {program.data(), filter.data(), nullptr};
  pid_t child = 0;
  EXPECT_EQ(::posix_spawn(&child, program.c_str(), nullptr, nullptr, argv.data(), environ), 0);
  int status = -1;
  ::waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
  ::unsetenv(kTarget);
  ::unsetenv("LP_NUM_THREADS");
  return read_png(path);
}

TEST(RendererProcess, GivesTheSameBytesForEveryThreadCountOfTheDriver) {
  if (const char* path = std::getenv(kTarget)) {
    write_picture(path);
    return;
  }
  const Folder folder;
  const Image one = picture_with_threads(folder, "1");
  EXPECT_EQ(picture_with_threads(folder, "2").pixels, one.pixels);
  EXPECT_EQ(picture_with_threads(folder, "3").pixels, one.pixels);
}

}  // namespace
}  // namespace supple::render::test
