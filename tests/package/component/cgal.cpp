// The distance of two triangles.
#include <supple/cgal/surface_meshes.h>

#include <cmath>

int main() {
  supple::Mesh a, b;
  a.position = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  b.position = {{0, 0, 2}, {1, 0, 2}, {0, 1, 2}};
  a.triangle = b.triangle = {{0, 1, 2}};
  return std::abs(supple::cgal::one_sided_hausdorff_distance(a, b, 1e-3) - 2.0) < 1e-2 ? 0 : 1;
}
