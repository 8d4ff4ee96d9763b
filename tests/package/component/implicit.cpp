// A ball as a mesh and as a grid.
#include <supple/implicit/march_cubes.h>
#include <supple/implicit/surface_grid.h>

int main() {
  using namespace supple;
  using namespace supple::implicit;
  Skeleton skeleton;
  skeleton.part_count = 1;
  skeleton.primitive.resize(1);
  skeleton.primitive[0].kernel = Kernel::wyvill(1.0);
  const Pose pose;
  PlacedSkeleton placed;
  place_skeleton(skeleton, std::span(&pose, 1), placed);
  Field field;
  index_field(skeleton, placed, field);
  MarchOptions mesh;
  mesh.lattice.cell = 0.1;
  GridOptions grid;
  grid.lattice.cell = 0.1;
  return !march_cubes(field, mesh, Executor(1)).triangle.empty() &&
                 !mesh_of(make_surface_grid(field, grid, Executor(1)), field, Executor(1)).triangle.empty() ? 0 : 1;
}
