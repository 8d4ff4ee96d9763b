/// @file field_bench.cpp
/// Times of the field, one JSON object per line: name, cpu_ms_min, items_per_s, hash of the result.
/// Bodies: a spiral of ten plates, and Wyvill blobs in a deformed ball such that 30 supports overlap inside.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <functional>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "benchmarks/field_bodies.h"
#include "programs.h"
#include "supple/core/hash.h"
#include "supple/core/math.h"
#include "supple/implicit/field.h"
#include "supple/implicit/project.h"
#include "supple/implicit/surface_samples.h"
#include "usage.h"

namespace {

using namespace supple;
using namespace supple::implicit;
using benchmarks::blobs;
using benchmarks::Body;
using benchmarks::plate_spiral;

/// Whether a name that starts with `prefix` may start with the filter.
bool wanted(std::string_view filter, std::string_view prefix) {
  const std::size_t n = std::min(filter.size(), prefix.size());
  return filter.substr(0, n) == prefix.substr(0, n);
}

/// Runs `work` for at least 0.2 s; work returns the number of items and adds its result to the hash.
void measure(std::string_view filter, const std::string& name, const std::function<std::size_t(Hasher&)>& work) {
  if (!wanted(filter, name) || name.size() < filter.size()) return;
  double best = 1e300;
  double total = 0.0;
  std::size_t items = 0;
  std::string hash;
  for (int repeat = 0; repeat < 1000 && (repeat < 3 || total < 0.2); ++repeat) {
    Hasher hasher;
    timespec begin{}, end{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &begin);
    items = work(hasher);
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &end);
    const double seconds =
        static_cast<double>(end.tv_sec - begin.tv_sec) + 1e-9 * static_cast<double>(end.tv_nsec - begin.tv_nsec);
    best = std::min(best, seconds);
    total += seconds;
    hash = to_hex(hasher.value());
  }
  std::printf("{\"name\": \"implicit/%s\", \"threads\": 1, \"cpu_ms_min\": %.6g, \"items\": %zu, "
              "\"items_per_s\": %.4g, \"hash\": \"%s\"}\n",
              name.c_str(), 1e3 * best, items, static_cast<double>(items) / best, hash.c_str());
  std::fflush(stdout);
}

void measure_body(std::string_view filter, const std::string& name, Body& body, double cell) {
  const Field& field = body.field;
  const Box box = field.surface_box();
  // Lattice blocks of 9^3 nodes as meshing asks for them, those that the bounds leave.
  std::vector<std::vector<Vec3>> blocks;
  std::size_t looked_at = 0;
  const Vec3 count = (box.extent() / (8.0 * cell)).array().ceil();
  const auto block_box = [&](int i, int j, int k) {
    const Vec3 low = box.lower + 8.0 * cell * Vec3(i, j, k);
    return Box{low, low + Vec3::Constant(8.0 * cell)};
  };
  const auto for_blocks = [&](const auto& use) {
    for (int k = 0; k < count.z(); ++k) {
      for (int j = 0; j < count.y(); ++j) {
        for (int i = 0; i < count.x(); ++i) use(block_box(i, j, k));
      }
    }
  };
  for_blocks([&](const Box& b) {
    ++looked_at;
    const Interval bound = field.bound(b);
    if (bound.upper < 0.0 || bound.lower > 0.0) return;
    auto& points = blocks.emplace_back();
    for (int i = 0; i < 729; ++i) points.push_back(b.lower + cell * Vec3(i % 9, i / 9 % 9, i / 81));
  });
  std::vector<Vec3> scattered;
  for (const auto& b : blocks) scattered.push_back(b[364]);
  std::vector<double> values(729);
  std::vector<Vec3> gradients(729);

  measure(filter, name + "/index", [&](Hasher& hasher) {
    body.place();
    (void)field.index();
    hasher.add(field.feature_size());
    return body.skeleton.primitive.size();
  });
  measure(filter, name + "/bound", [&](Hasher& hasher) {
    for_blocks([&](const Box& b) { hasher.add(field.bound(b).upper); });
    return looked_at;
  });
  measure(filter, name + "/gradient_bound", [&](Hasher& hasher) {
    for_blocks([&](const Box& b) { hasher.add(field.gradient_bound(b)); });
    return looked_at;
  });
  measure(filter, name + "/surface_box", [&](Hasher& hasher) {
    const Box b = field.surface_box();
    hasher.add(b.lower.x());
    hasher.add(b.extent().sum());
    return std::size_t{1};
  });
  measure(filter, name + "/values", [&](Hasher& hasher) {
    for (const auto& points : blocks) field.evaluate(points, values);
    hasher.add(values);
    return 729 * blocks.size();
  });
  measure(filter, name + "/gradients", [&](Hasher& hasher) {
    for (const auto& points : blocks) field.evaluate(points, values, gradients);
    hasher.add(values);
    hasher.add(gradients);
    return 729 * blocks.size();
  });
  measure(filter, name + "/single_gradients", [&](Hasher& hasher) {
    const FieldView view(field);
    double sum = 0.0;
    Vec3 gradient;
    for (const Vec3& x : scattered) sum += view.value(x, gradient);
    hasher.add(sum);
    return scattered.size();
  });
  measure(filter, name + "/scattered_gradients", [&](Hasher& hasher) {
    std::vector<double> v(scattered.size());
    std::vector<Vec3> g(scattered.size());
    field.evaluate(scattered, v, g);
    hasher.add(v);
    return scattered.size();
  });
  FieldParts parts;
  measure(filter, name + "/parts", [&](Hasher& hasher) {
    field.evaluate_parts(scattered, parts);
    hasher.add(parts.value);
    return scattered.size();
  });
  measure(filter, name + "/intersect", [&](Hasher& hasher) {
    const Vec3 eye(0.3, -4.0, 0.5);
    std::size_t rays = 0;
    for (std::size_t i = 0; i < scattered.size() && rays < 500; i += 1 + scattered.size() / 500, ++rays) {
      hasher.add(intersect(field, eye, (scattered[i] - eye).normalized(), 8.0).value_or(-1.0));
    }
    return rays;
  });
  if (!wanted(filter, name + "/samples")) return;
  const SampleLayout layout = make_sample_layout(body.skeleton, 0.25 * field.feature_size());
  SampleState state;
  SurfaceSamples samples;
  const Executor executor(1);
  sample_surface({body.skeleton, layout, body.parts, field}, {}, executor, state, samples);
  const SampleState warm = state;
  measure(filter, name + "/samples", [&](Hasher& hasher) {
    state.distance = warm.distance;
    sample_surface({body.skeleton, layout, body.parts, field}, {}, executor, state, samples);
    hasher.add(samples.area);
    return layout.size();
  });
}

void measure_few(std::string_view filter, std::uint32_t count, ShapeKind shape) {
  Body body;
  body.skeleton.part_count = count;
  std::mt19937_64 engine(3);
  const auto uniform = [&] { return 2.0 * static_cast<double>(engine() >> 11) * 0x1p-53 - 1.0; };
  for (std::uint32_t i = 0; i < count; ++i) {
    Primitive p;
    p.part = i;
    p.shape = shape;
    p.size = Vec3::Constant(0.3);
    p.kernel = Kernel::wyvill(1.0);
    body.skeleton.primitive.push_back(p);
    body.parts.push_back(Pose{0.2 * Vec3(uniform(), uniform(), uniform()), Quat::Identity()});
  }
  body.place();
  std::vector<Vec3> points(64);
  for (Vec3& p : points) p = 0.3 * Vec3(uniform(), uniform(), uniform());
  std::vector<double> values(64);
  std::vector<Vec3> gradients(64);
  const std::string name = "primitives=" + std::to_string(count) + (shape == ShapeKind::Point ? ",points" : ",plates");
  for (const std::size_t n : {1u, 4u, 16u, 64u}) {
    measure(filter, "few/" + name + "/batch=" + std::to_string(n), [&](Hasher& hasher) {
      for (int repeat = 0; repeat < 1000; ++repeat) {
        body.field.evaluate(std::span(points).first(n), std::span(values).first(n), std::span(gradients).first(n));
      }
      hasher.add(values);
      return 1000 * n;
    });
  }
}

}  // namespace

/// @param argv  beginning of the names to run, e.g. w3/values; all when absent
int supple::benchmarks::programs::field_bench(int argc, char** argv) {
  constexpr std::string_view kUsage = "field_bench [PREFIX]    prefix of the names to run, e.g. w3/values";
  supple::benchmarks::answer_usage(argc, argv, kUsage, 1);
  const std::string_view filter = argc > 1 ? argv[1] : "";
  constexpr std::array<std::string_view, 6> kFirst{"few/", "fit/", "w1/", "w2/", "w3/", "w4/"};
  if (std::none_of(kFirst.begin(), kFirst.end(), [filter](std::string_view first) { return wanted(filter, first); })) {
    supple::benchmarks::refuse(kUsage, "a prefix of a name, such as w3/values", filter);
  }
  if (wanted(filter, "few/")) {
    for (const std::uint32_t count : {1u, 4u, 16u}) {
      measure_few(filter, count, ShapeKind::Point);
      measure_few(filter, count, ShapeKind::Rectangle);
    }
  }
  for (const auto& [name, shape] : {std::pair{"fit/ellipsoids", ShapeKind::Ellipsoid}, {"fit/points", ShapeKind::Point}}) {
    if (!wanted(filter, std::string(name) + "/")) continue;
    Body body = benchmarks::ellipsoids(64, shape);
    measure_body(filter, name, body, 3.0 / 256);
  }
  if (wanted(filter, "w1/")) {
    Body spiral = plate_spiral();
    measure_body(filter, "w1", spiral, 1.4 / 128);
  }
  for (const auto& [name, count] : {std::pair{"w2", 1000u}, {"w3", 10000u}, {"w4", 100000u}}) {
    if (!wanted(filter, std::string(name) + "/")) continue;
    Body body = blobs(count);
    measure_body(filter, name, body, 3.0 / 256);
  }
  return 0;
}
