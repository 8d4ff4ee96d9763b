/// @file surface_mesh_openvdb.cpp
/// OpenVDB's volumeToMesh on a grid of mesh_bench: surface_mesh_openvdb GRID OUT. The tree gets the leaves in which F
/// changes sign, and their neighbours; filling it is part of the time. Prints the least CPU time of several runs [ms].
#include <openvdb/openvdb.h>
#include <openvdb/tools/SignedFloodFill.h>
#include <openvdb/tools/VolumeToMesh.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <vector>

namespace {

double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  openvdb::initialize();
  std::ifstream in(argv[1], std::ios::binary);
  double header[5];
  in.read(reinterpret_cast<char*>(header), sizeof header);
  const int n = static_cast<int>(header[0]);
  std::vector<float> values(static_cast<std::size_t>(n) * n * n);
  in.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(4 * values.size()));
  if (!in) return 1;
  const auto at = [&](int x, int y, int z) {
    return values[(static_cast<std::size_t>(std::min(z, n - 1)) * n + std::min(y, n - 1)) * n + std::min(x, n - 1)];
  };
  // Leaves with a sign change among their nodes and the first beyond, and the next ones up and down.
  const int leaves = (n + 7) / 8;
  std::vector<std::uint8_t> needed(static_cast<std::size_t>(leaves) * leaves * leaves, 0);
  const auto leaf_index = [&](int x, int y, int z) { return (static_cast<std::size_t>(z) * leaves + y) * leaves + x; };
  for (int k = 0; k < leaves; ++k) {
    for (int j = 0; j < leaves; ++j) {
      for (int i = 0; i < leaves; ++i) {
        bool in_any = false, out_any = false;
        for (int z = 0; z <= 8; ++z) {
          for (int y = 0; y <= 8; ++y) {
            for (int x = 0; x <= 8; ++x) (at(8 * i + x, 8 * j + y, 8 * k + z) > 0.0f ? in_any : out_any) = true;
          }
        }
        if (!in_any || !out_any) continue;
        for (int z = k; z <= std::min(k + 1, leaves - 1); ++z) {
          for (int y = j; y <= std::min(j + 1, leaves - 1); ++y) {
            for (int x = i; x <= std::min(i + 1, leaves - 1); ++x) needed[leaf_index(x, y, z)] = 1;
          }
        }
      }
    }
  }
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec3I> triangles;
  std::vector<openvdb::Vec4I> quads;
  double best = 1e300;
  for (int repeat = 0; repeat < 5; ++repeat) {
    const double start = cpu_seconds();
    openvdb::FloatGrid grid(1.0f);
    grid.setGridClass(openvdb::GRID_LEVEL_SET);
    grid.setTransform(openvdb::math::Transform::createLinearTransform(header[4]));
    for (int k = 0; k < leaves; ++k) {
      for (int j = 0; j < leaves; ++j) {
        for (int i = 0; i < leaves; ++i) {
          if (needed[leaf_index(i, j, k)] == 0) continue;
          auto* leaf = grid.tree().touchLeaf({8 * i, 8 * j, 8 * k});
          float* to = leaf->buffer().data();
          for (int x = 0; x < 8; ++x) {
            for (int y = 0; y < 8; ++y) {
              for (int z = 0; z < 8; ++z) to[(x * 8 + y) * 8 + z] = -at(8 * i + x, 8 * j + y, 8 * k + z);
            }
          }
          leaf->setValuesOn();
        }
      }
    }
    openvdb::tools::signedFloodFill(grid.tree());
    points.clear();
    triangles.clear();
    quads.clear();
    openvdb::tools::volumeToMesh(grid, points, triangles, quads, 0.0, 0.0);
    best = std::min(best, cpu_seconds() - start);
  }
  std::ofstream out(argv[2], std::ios::binary);
  const std::int64_t counts[2] = {static_cast<std::int64_t>(points.size()),
                                  static_cast<std::int64_t>(triangles.size() + 2 * quads.size())};
  out.write(reinterpret_cast<const char*>(counts), sizeof counts);
  for (const auto& p : points) {
    const double world[3] = {p[0] + header[1], p[1] + header[2], p[2] + header[3]};
    out.write(reinterpret_cast<const char*>(world), sizeof world);
  }
  const auto put = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    const std::uint32_t t[3] = {a, b, c};
    out.write(reinterpret_cast<const char*>(t), sizeof t);
  };
  for (const auto& t : triangles) put(t[0], t[1], t[2]);
  for (const auto& q : quads) {
    put(q[0], q[1], q[2]);
    put(q[0], q[2], q[3]);
  }
  std::printf("{\"cpu_ms\": %.5g}\n", 1e3 * best);
  return 0;
}
