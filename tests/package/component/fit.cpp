// A tetrahedron as an object.
#include <supple/fit/fit.h>

#include <filesystem>
#include <fstream>

int main(int, char** argv) {
  const std::filesystem::path file = std::filesystem::path(argv[0]).replace_filename("tetrahedron.off");
  std::ofstream(file) << "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n";
  const supple::fit::FittedObject object = supple::fit::fit(file, {.error = 0.1, .particles = 4});
  return object.report.rigid && object.particles.size() == 4 ? 0 : 1;
}
