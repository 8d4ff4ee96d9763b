// A mesh file: PLY where it begins with "ply", else OBJ.
#include <string_view>

#include "fuzz_target.h"
#include "supple/core/io/read_mesh.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static supple::fuzz::InputFile ply("fuzz.ply"), obj("fuzz.obj");
  const bool is_ply = std::string_view(reinterpret_cast<const char*>(data), size).starts_with("ply");
  return supple::fuzz::used_or_refused([&] { (void)supple::io::read_mesh((is_ply ? ply : obj).with({data, size})); });
}
