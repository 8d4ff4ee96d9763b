#include "fit/data.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <numeric>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>

#include "supple/core/io/atomic_file.h"

namespace supple::fit {
namespace {

/// Whether the header of a PLY file tells of faces; a file that has no such header is taken for a mesh, whose reader refuses it.
bool ply_has_faces(const std::filesystem::path& file) {
  constexpr std::size_t kMostLines = 1000;
  std::ifstream in(file, std::ios::binary);
  std::string line;
  for (std::size_t number = 0; number < kMostLines && std::getline(in, line); ++number) {
    std::istringstream words(line);
    std::string element, name;
    std::uint64_t count = 0;
    if (words >> element >> name >> count && element == "element" && name == "face") return count > 0;
    if (element == "end_header") return false;
  }
  return true;
}

}  // namespace

std::string extension_of(const std::filesystem::path& file) {
  const auto lower = [](std::string text) {
    std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return text;
  };
  const std::string last = lower(file.extension().string());
  return last == ".gz" ? lower(file.stem().extension().string()) + last : last;
}

DataKind kind_of(const std::filesystem::path& file) {
  constexpr std::array<std::string_view, 4> kMeshes{".ply", ".obj", ".off", ".stl"};
  constexpr std::array<std::string_view, 7> kVolumes{".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd", ".vdb"};
  const std::string extension = extension_of(file);
  const auto is_one_of = [&](const auto& known) { return std::find(known.begin(), known.end(), extension) != known.end(); };
  const bool mesh = is_one_of(kMeshes), volume = is_one_of(kVolumes);
  if (!mesh && !volume && extension != ".xyz") {
    refuse(file, "expected a mesh (.ply, .obj, .off, .stl), points (.xyz, .ply) or a volume (.nii, .nii.gz, .nrrd, .nhdr, .mha, .mhd, .vdb)",
           extension.empty() ? "no extension" : '\'' + extension + '\'', "convert the data, or rename a file of another extension", ErrorKind::Usage);
  }
  std::array<std::byte, 1> first{};
  const std::optional<std::size_t> found = io::read_start(file, first);
  if (!found) (void)io::read_file(file, first.size());  // which says why
  if (found == 0) refuse(file, "expected data", "an empty file", "write it again");
  if (extension == ".ply" && !ply_has_faces(file)) return DataKind::Points;
  return mesh ? DataKind::Mesh : volume ? DataKind::Volume : DataKind::Points;
}

void refuse(const std::filesystem::path& file, std::string expected, std::string found, std::string hint, ErrorKind kind) {
  throw Error(kind, Fault{.place = file.string(), .key = {}, .expected = std::move(expected), .found = std::move(found), .hint = std::move(hint)});
}

std::size_t piece_of(const std::filesystem::path& file, const std::vector<double>& size, std::uint32_t which) {
  if (which > size.size()) refuse(file, "expected at least " + std::to_string(which) + " pieces, of which --pieces chooses one", std::to_string(size.size()), "", ErrorKind::Usage);
  std::vector<std::size_t> order(size.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&size](std::size_t a, std::size_t b) { return size[a] > size[b]; });
  return order[which - 1];
}

std::string short_number(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.6g", value);
  return text.data();
}

}  // namespace supple::fit
