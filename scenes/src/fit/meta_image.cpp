#include "fit/meta_image.h"

#include <libdeflate.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <memory>
#include <sstream>

#include "fit/data.h"

namespace supple::fit {
namespace {

constexpr double kMillimetre = 1e-3;

enum class Type : std::uint8_t { Int8, Uint8, Int16, Uint16, Int32, Uint32, Float, Double };
struct NamedType {
  const char* name;
  Type type;
  std::size_t bytes;
};
constexpr std::array kTypes{NamedType{"MET_CHAR", Type::Int8, 1},   NamedType{"MET_UCHAR", Type::Uint8, 1}, NamedType{"MET_SHORT", Type::Int16, 2}, NamedType{"MET_USHORT", Type::Uint16, 2},
                            NamedType{"MET_INT", Type::Int32, 4},   NamedType{"MET_UINT", Type::Uint32, 4}, NamedType{"MET_FLOAT", Type::Float, 4}, NamedType{"MET_DOUBLE", Type::Double, 8}};

/// Lines `Key = Value` up to ElementDataFile, where the voxels begin.
class Header {
 public:
  explicit Header(const std::filesystem::path& file) : file_(file) {
    std::ifstream in(file, std::ios::binary);
    std::string line;
    constexpr std::size_t kMostLines = 1000;
    for (line_ = 1; line_ <= kMostLines && std::getline(in, line); ++line_) {
      const std::size_t equals = line.find('=');
      if (equals == std::string::npos) break;
      const std::string key = trimmed(line.substr(0, equals));
      value_[key] = trimmed(line.substr(equals + 1));
      if (key != "ElementDataFile") continue;
      end_ = static_cast<std::size_t>(in.tellg());
      return;
    }
    refuse(file_.string() + ':' + std::to_string(line_), "expected lines of a MetaImage header, Key = Value, up to ElementDataFile", line.empty() ? "none" : '\'' + line.substr(0, 40) + '\'', "write the header again, its last line is ElementDataFile = FILE or LOCAL");
  }

  [[nodiscard]] std::size_t end() const { return end_; }
  [[nodiscard]] bool has(const std::string& key) const { return value_.contains(key); }
  [[nodiscard]] std::string text(const std::string& key, const std::string& otherwise = {}) const { return has(key) ? value_.at(key) : otherwise; }
  [[nodiscard]] bool is_true(const std::string& key) const { return text(key, "False") == "True"; }
  /// The numbers of the first of the keys that the header has. @param otherwise  without any
  [[nodiscard]] std::vector<double> numbers(std::initializer_list<const char*> keys, std::vector<double> otherwise) const {
    for (const char* key : keys) {
      if (!has(key)) continue;
      std::istringstream words(value_.at(key));
      std::vector<double> out;
      for (double v = 0.0; words >> v;) out.push_back(v);
      if (!words.eof() || out.size() != otherwise.size()) refuse(file_, "expected " + std::to_string(otherwise.size()) + " numbers after " + key, '\'' + value_.at(key) + '\'', "one for each axis");
      return out;
    }
    return otherwise;
  }

 private:
  static std::string trimmed(const std::string& s) {
    const std::size_t first = s.find_first_not_of(" \t\r"), last = s.find_last_not_of(" \t\r");
    return first == std::string::npos ? std::string() : s.substr(first, last - first + 1);
  }

  const std::filesystem::path& file_;
  std::map<std::string, std::string> value_;
  std::size_t line_ = 0, end_ = 0;
};

/// Bytes of the voxels, decompressed.
std::vector<char> read_bytes(const std::filesystem::path& file, const Header& header, std::size_t bytes) {
  const std::string name = header.text("ElementDataFile");
  const bool local = name == "LOCAL";
  if (name == "LIST" || name.find('%') != std::string::npos) refuse(file, "expected voxels in one file", '\'' + name + '\'', "join its slices");
  const std::filesystem::path data = local ? file : file.parent_path() / name;
  std::ifstream in(data, std::ios::binary | std::ios::ate);
  if (!in) refuse(data, "expected the voxels of " + file.filename().string(), "no file that can be read", "ElementDataFile names it, relative to the header", ErrorKind::Io);
  const auto size = static_cast<std::size_t>(in.tellg());
  const double skipped = header.numbers({"HeaderSize"}, {0.0})[0];
  const bool packed = header.is_true("CompressedData");
  const std::size_t begin = local ? header.end() : skipped < 0.0 ? size - std::min(size, bytes) : static_cast<std::size_t>(std::min(skipped, 1e15));
  const auto expect = [&](bool good, std::size_t found) {
    if (!good) refuse(data, "expected " + std::to_string(bytes) + " bytes of voxels", std::to_string(found), "copy the file again, or correct DimSize and ElementType", ErrorKind::Io);
  };
  expect(begin <= size && (packed || size - begin >= bytes), size - std::min(begin, size));
  std::vector<char> stored(packed ? size - begin : bytes);
  in.seekg(static_cast<std::streamoff>(begin));
  in.read(stored.data(), static_cast<std::streamsize>(stored.size()));
  expect(static_cast<std::size_t>(in.gcount()) == stored.size(), static_cast<std::size_t>(in.gcount()));
  if (!packed) return stored;
  std::vector<char> out(bytes);
  const std::unique_ptr<libdeflate_decompressor, decltype(&libdeflate_free_decompressor)> tool(libdeflate_alloc_decompressor(), libdeflate_free_decompressor);
  std::size_t found = 0;
  const libdeflate_result result = libdeflate_zlib_decompress(tool.get(), stored.data(), stored.size(), out.data(), out.size(), &found);
  expect(result == LIBDEFLATE_SUCCESS && found == bytes, found);
  return out;
}

template <class T>
void convert(std::vector<char>& bytes, bool swap, std::vector<float>& out) {
  out.resize(bytes.size() / sizeof(T));
  for (std::size_t n = 0; n < out.size(); ++n) {
    char* at = bytes.data() + n * sizeof(T);
    if (swap) std::reverse(at, at + sizeof(T));
    T value;
    std::memcpy(&value, at, sizeof(T));
    out[n] = static_cast<float>(value);
  }
}

void convert_to(Type type, std::vector<char>& bytes, bool swap, std::vector<float>& out) {
  switch (type) {
    case Type::Int8: convert<std::int8_t>(bytes, swap, out); break;
    case Type::Uint8: convert<std::uint8_t>(bytes, swap, out); break;
    case Type::Int16: convert<std::int16_t>(bytes, swap, out); break;
    case Type::Uint16: convert<std::uint16_t>(bytes, swap, out); break;
    case Type::Int32: convert<std::int32_t>(bytes, swap, out); break;
    case Type::Uint32: convert<std::uint32_t>(bytes, swap, out); break;
    case Type::Float: convert<float>(bytes, swap, out); break;
    case Type::Double: convert<double>(bytes, swap, out); break;
  }
}

}  // namespace

Volume read_meta_image(const std::filesystem::path& file) {
  const Header header(file);
  if (header.text("NDims", "3") != "3" || header.text("ElementNumberOfChannels", "1") != "1") {
    refuse(file, "expected a volume of three axes and single values", header.text("NDims", "3") + " axes of " + header.text("ElementNumberOfChannels", "1"), "extract one");
  }
  const std::string type = header.text("ElementType");
  const auto known = std::find_if(kTypes.begin(), kTypes.end(), [&](const NamedType& t) { return type == t.name; });
  if (known == kTypes.end()) refuse(file, "expected an ElementType from MET_CHAR to MET_DOUBLE", '\'' + type + '\'', "convert the voxels to MET_FLOAT");
  const std::vector<double> count = header.numbers({"DimSize"}, {0.0, 0.0, 0.0});
  expect_voxels(file, {count[0], count[1], count[2]});
  Volume out;
  out.count = {static_cast<std::size_t>(count[0]), static_cast<std::size_t>(count[1]), static_cast<std::size_t>(count[2])};
  const std::vector<double> spacing = header.numbers({"ElementSpacing", "ElementSize"}, {1.0, 1.0, 1.0}), origin = header.numbers({"Offset", "Position", "Origin"}, {0.0, 0.0, 0.0});
  const std::vector<double> turn = header.numbers({"TransformMatrix", "Rotation", "Orientation"}, {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0});
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    for (Eigen::Index k = 0; k < 3; ++k) out.axes(k, axis) = kMillimetre * spacing[static_cast<std::size_t>(axis)] * turn[static_cast<std::size_t>(3 * axis + k)];
    out.origin[axis] = kMillimetre * origin[static_cast<std::size_t>(axis)];
  }
  expect_axes(file, out);
  std::vector<char> bytes = read_bytes(file, header, out.size() * known->bytes);
  const bool big = header.is_true("BinaryDataByteOrderMSB") || header.is_true("ElementByteOrderMSB");
  convert_to(known->type, bytes, big != (std::endian::native == std::endian::big), out.value);
  return out;
}

}  // namespace supple::fit
