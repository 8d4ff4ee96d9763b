// The surface of three blended points as a mesh file.
#include <supple/core/io/mesh_files.h>
#include <supple/implicit/field.h>
#include <supple/implicit/polygonise.h>

#include <iostream>
#include <vector>

using namespace supple;

int main(int argc, char** argv) {
  implicit::Skeleton skeleton{.part_count = 3};
  std::vector<Pose> pose(3);
  for (std::uint32_t k = 0; k < 3; ++k) {
    skeleton.primitive.push_back({.part = k, .kernel = implicit::Kernel::wyvill(0.4)});
    pose[k].position = Vec3(0.25 * k, 0, 0);
  }
  implicit::PlacedSkeleton placed;
  implicit::Field field;
  place_skeleton(skeleton, pose, placed);
  index_field(skeleton, placed, field);
  const Mesh mesh = implicit::polygonise(field, {.origin = Vec3::Zero(), .cell = 0.02}, Executor());
  const MeshReport report = inspect(mesh);
  std::cout << mesh.triangle_count() << " triangles, " << report.area << " m^2, " << report.volume << " m^3\n";
  if (argc > 1) io::write_ply(argv[1], mesh);
  return report.closed && report.components == 1 ? 0 : 1;
}
