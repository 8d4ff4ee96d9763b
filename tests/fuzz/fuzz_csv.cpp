// A table of points.
#include "fuzz_target.h"
#include "supple/core/io/mesh_files.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return supple::fuzz::used_or_refused([&] { (void)supple::io::read_points_csv(supple::fuzz::as_file("fuzz.csv", {data, size})); });
}
