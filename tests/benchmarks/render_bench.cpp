/// @file render_bench.cpp
/// Times of pictures, one JSON object per line: CPU milliseconds by parts, size of the picture, triangles, hash of the
/// pixels. The body is a ball of 200,000 triangles whose surface waves, so that every frame uploads new vertices.
///
///   render_bench [gl]                          1280 x 720, soft shadows, 4 samples, PNG included; the first frame separately
///   render_bench rate [AT_ONCE] [NOISE]        frames per second of the same, several renderers at a time; with NOISE by the
///                                              path tracer
///   render_bench path [NOISE] [OUT.png]        640 x 360 by the path tracer, matt bodies in a studio
///   render_bench studio FOLDER                 the same bodies as PLY files, for other renderers: see peers/
#include <time.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "programs.h"
#include "render/shapes.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/core/io/mesh_files.h"
#include "supple/render/renderer.h"
#include "usage.h"

namespace {

using namespace supple;
using namespace supple::render;
namespace fs = std::filesystem;

double cpu_seconds(clockid_t clock = CLOCK_PROCESS_CPUTIME_ID) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

std::string hash_of(const Image& image) {
  Hasher hasher;
  hasher.add(std::string_view(reinterpret_cast<const char*>(image.pixels.data()), image.pixels.size()));
  return to_hex(hasher.value());
}

/// 12 n^2 triangles; n = 129 gives 199,692. Normals are those of the ball, as far as the wave is small.
Mesh waving_ball(int n, double time) {
  Mesh mesh = test::sphere(Vec3::Zero(), 1.0, n);
  for (std::size_t i = 0; i < mesh.position.size(); ++i) {
    const Vec3 p = mesh.position[i];
    mesh.position[i] = Vec3(0, 0, 1.1) + (1.0 + 0.05 * std::sin(8.0 * p.x() + time) * std::sin(6.0 * p.z())) * p;
  }
  return mesh;
}

View view_of_ball() {
  View view;
  view.camera = {.from = Vec3(0.5, -6, 2.6), .look_at = Vec3(0, 0, 0.9)};
  view.ground = Ground{};
  return view;
}

int bench_gl() {
  const fs::path file = fs::temp_directory_path() / "supple_render_bench.png";
  const View view = view_of_ball();
  Mesh mesh = waving_ball(129, 0.0);
  Item item{.mesh = &mesh, .colour = Vec3(0.85, 0.45, 0.2)};
  const double start = cpu_seconds();
  const std::unique_ptr<Renderer> renderer = make_renderer({});
  Image image = renderer->render(view, std::span(&item, 1));
  write_png(file, image);
  const double first = cpu_seconds() - start;
  const RenderTimes once = renderer->times();
  std::printf("{\"name\": \"render/gl/first_frame\", \"cpu_ms\": %.1f, \"context_ms\": %.1f, \"shaders_ms\": %.1f, \"hash\": \"%s\"}\n",
              1e3 * first, 1e3 * once.context, 1e3 * once.shaders, hash_of(image).c_str());
  struct Line {
    double total, upload, draw, read_back, encode;
  };
  std::vector<Line> lines;
  for (int frame = 1; frame <= 12; ++frame) {
    mesh = waving_ball(129, 0.2 * frame);
    const RenderTimes before = renderer->times();
    const double begin = cpu_seconds();
    image = renderer->render(view, std::span(&item, 1));
    const double drawn = cpu_seconds();
    write_png(file, image);
    const double end = cpu_seconds();
    const RenderTimes after = renderer->times();
    lines.push_back({end - begin, after.upload - before.upload, after.draw - before.draw, after.read_back - before.read_back, end - drawn});
  }
  std::sort(lines.begin(), lines.end(), [](const Line& a, const Line& b) { return a.total < b.total; });
  const Line& best = lines.front();
  std::printf("{\"name\": \"render/gl/frame\", \"width\": 1280, \"height\": 720, \"samples\": 4, \"triangles\": %zu, \"min_cpu_ms\": %.1f, "
              "\"median_cpu_ms\": %.1f, \"upload_ms\": %.1f, \"draw_ms\": %.1f, \"read_back_ms\": %.1f, \"encode_ms\": %.1f, "
              "\"bytes\": %ju, \"hash\": \"%s\"}\n",
              mesh.triangle_count(), 1e3 * best.total, 1e3 * lines[lines.size() / 2].total, 1e3 * best.upload, 1e3 * best.draw,
              1e3 * best.read_back, 1e3 * best.encode, static_cast<std::uintmax_t>(fs::file_size(file)), hash_of(image).c_str());
  fs::remove(file);
  return 0;
}

/// Time, not CPU time, from meshes to files; every renderer has drawn a frame before.
int bench_rate(int at_once, const RenderSettings& settings) {
  constexpr int kFrames = 12;  // each
  const bool path = settings.kind == RendererKind::Path;
  const View view = view_of_ball();
  std::vector<Mesh> meshes;
  for (int frame = 0; frame < kFrames; ++frame) meshes.push_back(waving_ball(129, 0.2 * frame));
  std::vector<std::unique_ptr<Renderer>> renderers;
  std::vector<std::string> hash(static_cast<std::size_t>(at_once));
  const auto draw = [&](std::size_t k, const Mesh& mesh) {
    const fs::path file = fs::temp_directory_path() / ("supple_render_bench_" + std::to_string(k) + ".png");
    const Item item{.mesh = &mesh, .colour = Vec3(0.85, 0.45, 0.2)};
    const Image image = renderers[k]->render(view, std::span(&item, 1));
    write_png(file, image);
    fs::remove(file);
    if (&mesh == &meshes.back()) hash[k] = hash_of(image);
  };
  for (int k = 0; k < at_once; ++k) {
    renderers.push_back(make_renderer(settings));
    draw(static_cast<std::size_t>(k), meshes.front());
  }
  const auto begin = std::chrono::steady_clock::now();
  const double cpu = cpu_seconds();
  std::vector<double> least(renderers.size(), INFINITY);  // CPU time of a frame, of its thread
  std::vector<std::thread> threads;
  for (std::size_t k = 0; k < renderers.size(); ++k)
    threads.emplace_back([&, k] {
      for (const Mesh& mesh : meshes) {
        const double before = cpu_seconds(CLOCK_THREAD_CPUTIME_ID);
        draw(k, mesh);
        least[k] = std::min(least[k], cpu_seconds(CLOCK_THREAD_CPUTIME_ID) - before);
      }
    });
  for (std::thread& thread : threads) thread.join();
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const double frame_cpu = (cpu_seconds() - cpu) / (at_once * kFrames);
  const std::string quality = path ? "\"noise\": " + std::to_string(settings.noise) : "\"samples\": " + std::to_string(settings.samples);
  std::printf("{\"name\": \"render/%s/rate\", \"width\": %d, \"height\": %d, %s, \"triangles\": %zu, \"at_once\": %d, \"frames_s\": %.2f, "
              "\"cpu_ms\": %.0f, \"least_cpu_ms\": %.0f, \"hash\": \"%s\"}\n",
              path ? "path" : "gl", settings.width, settings.height, quality.c_str(), meshes.front().triangle_count(), at_once, at_once * kFrames / seconds,
              1e3 * frame_cpu, 1e3 * *std::min_element(least.begin(), least.end()), hash.front().c_str());
  return 0;
}

/// Matt bodies on a matt floor under sky and sun: what any renderer can repeat exactly.
struct Studio {
  std::vector<Mesh> meshes;
  std::vector<Item> items;
  View view;
  Studio() {
    meshes.push_back(test::sphere(Vec3(-0.9, 0.2, 0.7), 0.7, 64));
    meshes.push_back(test::rounded_box(Vec3(0.35, 0.35, 0.35), 0.15, 32,
                                       {.position = Vec3(0.75, 0.5, 0.5), .orientation = Quat(Eigen::AngleAxisd(0.5, Vec3::UnitZ()))}));
    meshes.push_back(test::sphere(Vec3(0.1, -0.8, 0.35), 0.35, 64));
    Mesh floor;
    add_quadrangle(floor, Vec3(-40, -40, 0), Vec3(40, -40, 0), Vec3(40, 40, 0), Vec3(-40, 40, 0));
    meshes.push_back(floor);
    const std::array colours = {Vec3(0.80, 0.30, 0.20), Vec3(0.25, 0.45, 0.75), Vec3(0.85, 0.70, 0.25), Vec3(0.80, 0.80, 0.78)};
    for (std::size_t i = 0; i < meshes.size(); ++i)
      items.push_back({.mesh = &meshes[i], .colour = colours[i], .roughness = 1.0, .reflectance = 0.0});
    view.camera = {.from = Vec3(0.4, -4.2, 3.0), .look_at = Vec3(0, 0, 0.3), .up = Vec3::UnitZ(), .field_of_view = 0.6};
  }
};

int bench_path(double noise, const fs::path& out) {
  const Studio studio;
  RenderSettings settings;
  settings.width = 640;
  settings.height = 360;
  settings.kind = RendererKind::Path;
  settings.noise = noise;
  settings.most_samples = 4096;
  const std::unique_ptr<Renderer> renderer = make_renderer(settings);
  double least = 1e9;
  Image image;
  for (int repeat = 0; repeat < (noise < 0.02 ? 1 : 3); ++repeat) {
    const double begin = cpu_seconds();
    image = renderer->render(studio.view, studio.items);
    least = std::min(least, cpu_seconds() - begin);
  }
  if (!out.empty()) write_png(out, image);
  std::printf("{\"name\": \"render/path/frame\", \"width\": 640, \"height\": 360, \"noise\": %g, \"cpu_ms\": %.1f, \"hash\": \"%s\"}\n",
              noise, 1e3 * least, hash_of(image).c_str());
  return 0;
}

int write_studio(const fs::path& folder) {
  const Studio studio;
  fs::create_directories(folder);
  for (std::size_t i = 0; i < studio.meshes.size(); ++i) io::write_ply(folder / (std::to_string(i) + ".ply"), studio.meshes[i]);
  return 0;
}

}  // namespace

int supple::benchmarks::programs::render_bench(int argc, char** argv) {
  using supple::benchmarks::positive_number;
  constexpr std::string_view usage = "render_bench [gl] | rate [AT_ONCE] [NOISE] | path [NOISE] [OUT.png] | studio FOLDER";
  supple::benchmarks::answer_usage(argc, argv, usage, 3);
  const std::string what = argc > 1 ? argv[1] : "gl";
  try {
    if (what == "gl") return bench_gl();
    if (what == "rate") {
      RenderSettings settings;
      if (argc > 3) {
        settings.kind = RendererKind::Path;
        settings.noise = positive_number(usage, argv[3]);
        settings.threads = 1;
      }
      return bench_rate(argc > 2 ? supple::benchmarks::whole_number(usage, argv[2]) : 2, settings);
    }
    if (what == "path") return bench_path(argc > 2 ? positive_number(usage, argv[2]) : 0.05, argc > 3 ? argv[3] : "");
    if (what == "studio" && argc > 2) return write_studio(argv[2]);
  } catch (const supple::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return static_cast<int>(error.kind());
  }
  supple::benchmarks::refuse(usage, "one of gl, rate, path, or studio with its folder", what);
}
