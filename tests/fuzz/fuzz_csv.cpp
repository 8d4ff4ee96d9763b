// A table of particles, or of points.
#include "fuzz_target.h"
#include "supple/core/io/mesh_files.h"
#include "supple/core/io/particle_files.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static supple::fuzz::InputFile file("fuzz.csv");
  return supple::fuzz::used_or_refused([&] { (void)supple::io::read_particles(file.with({data, size}), supple::io::kMostPoints); });
}
