#include "supple/core/io/read_mesh.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "io/number_text.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "supple/core/io/atomic_file.h"
#include "supple/core/io/number_range.h"
#include "supple/core/io/particle_files.h"

namespace supple::io {
namespace {


[[noreturn]] void refuse(const std::string& place, const std::string& expected, const std::string& found) {
  throw Error(ErrorKind::Scene, Fault{.place = place, .key = {}, .expected = expected, .found = found, .hint = {}});
}

/// The words of a text, line by line.
class Lines {
 public:
  explicit Lines(std::string_view text) : rest_(text) {
    constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
    if (rest_.starts_with(kByteOrderMark)) rest_.remove_prefix(kByteOrderMark.size());
  }
  /// The next line, with its continuation lines after a backslash at the end.
  /// @param whole  receives the text of lines that were joined   @return false at the end
  bool next_joined(std::string_view& line, std::string& whole) {
    if (!next(line)) return false;
    if (!line.ends_with('\\')) return true;
    whole.clear();
    do {
      line.remove_suffix(1);
      whole.append(line).push_back(' ');
      if (!next(line)) line = {};
    } while (line.ends_with('\\'));
    whole.append(line);
    line = whole;
    return true;
  }
  /// @return false at the end
  bool next(std::string_view& line) {
    if (rest_.empty()) return false;
    const std::size_t end = rest_.find('\n');
    line = rest_.substr(0, end);
    rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    ++number_;
    return true;
  }
  [[nodiscard]] std::size_t number() const { return number_; }
  [[nodiscard]] std::string_view rest() const { return rest_; }

 private:
  std::string_view rest_;
  std::size_t number_ = 0;
};

std::string_view take_word(std::string_view& line) {
  const std::size_t begin = std::min(line.find_first_not_of(" \t"), line.size());
  const std::size_t end = std::min(line.find_first_of(" \t", begin), line.size());
  const std::string_view word = line.substr(begin, end - begin);
  line.remove_prefix(end);
  return word;
}

template <class Number>
std::optional<Number> parse(std::string_view word) {
  if (word.starts_with('+')) word.remove_prefix(1);
  Number value{};
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size()) return std::nullopt;
  if constexpr (std::is_floating_point_v<Number>) {
    if (!std::isfinite(value)) return std::nullopt;
  }
  return value;
}

/// Whether x lies in a triangle of the plane or on its border; counter-clockwise along `normal`.
bool lies_in(const Vec3& x, const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& normal) {
  const auto left = [&](const Vec3& p, const Vec3& q) { return (q - p).cross(x - p).dot(normal) >= 0.0; };
  return left(a, b) && left(b, c) && left(c, a);
}

/// Appends the triangles of a face: a fan, or where corners point inwards, triangles that no other corner lies in, cut off one after another
/// (Meisters 1975, "Polygons Have Ears").
void add_face(std::vector<std::uint32_t> corner, const std::string& place, Mesh& mesh) {
  constexpr std::size_t kMostCorners = 4096;  // as the test is quadratic in the number of corners
  const auto at = [&](std::size_t k) -> const Vec3& { return mesh.position[corner[k]]; };
  Vec3 normal = Vec3::Zero();
  for (std::size_t k = 2; k < corner.size(); ++k) normal += (at(k - 1) - at(0)).cross(at(k) - at(0));
  const auto turns_left = [&](std::size_t k) {
    const std::size_t n = corner.size();
    return (at(k) - at((k + n - 1) % n)).cross(at((k + 1) % n) - at(k)).dot(normal) > 0.0;
  };
  bool convex = true;
  for (std::size_t k = 0; k < corner.size(); ++k) convex = convex && turns_left(k);
  if (!convex && corner.size() > kMostCorners) {
    refuse(place, "expected at most " + std::to_string(kMostCorners) + " corners of a face that is not convex", std::to_string(corner.size()));
  }
  const auto is_ear = [&](std::size_t k) {
    if (convex) return true;
    const std::size_t n = corner.size(), last = (k + n - 1) % n, next = (k + 1) % n;
    if (!turns_left(k)) return false;
    for (std::size_t i = (next + 1) % n; i != last; i = (i + 1) % n) {
      const bool is_corner = corner[i] == corner[last] || corner[i] == corner[k] || corner[i] == corner[next];
      if (!is_corner && lies_in(at(i), at(last), at(k), at(next), normal)) return false;
    }
    return true;
  };
  std::size_t ear = 1;  // of convex faces always the second corner, which makes a fan
  for (std::size_t n = corner.size(); n > 3; n = corner.size()) {
    std::size_t tried = 0;
    while (tried < n && !is_ear(ear % n)) {
      ++ear;
      ++tried;
    }
    ear %= n;  // any where there is none: the face crosses itself, or has no area
    mesh.triangle.push_back({corner[(ear + n - 1) % n], corner[ear], corner[(ear + 1) % n]});
    corner.erase(corner.begin() + static_cast<std::ptrdiff_t>(ear));
  }
  if (corner.size() == 3) mesh.triangle.push_back({corner[0], corner[1], corner[2]});
}

Mesh read_obj(std::string_view text, const std::string& path) {
  Mesh mesh;
  Lines lines(text);
  std::string_view line;
  std::string joined;
  std::vector<std::uint32_t> corner;
  for (std::size_t first = 1; lines.next_joined(line, joined); first = lines.number() + 1) {
    heed_scope();
    const std::string whole(line.substr(0, 60));
    const std::string place = path + ':' + std::to_string(first);
    line = line.substr(0, line.find('#'));
    const std::string_view kind = take_word(line);
    if (kind == "v") {
      Vec3 x;
      for (int k = 0; k < 3; ++k) {
        const std::optional<double> value = parse<double>(take_word(line));
        if (!value) refuse(place, "expected 'v' and three finite numbers", '\'' + whole + '\'');
        x[k] = *value;
      }
      mesh.position.push_back(x);
    } else if (kind == "f") {
      corner.clear();
      for (std::string_view word = take_word(line); !word.empty(); word = take_word(line)) {
        const std::optional<long long> index = parse<long long>(word.substr(0, word.find('/')));
        const auto count = static_cast<long long>(mesh.position.size());
        const long long at = !index ? -1 : *index > 0 ? *index - 1 : count + *index;  // negative ones count from the last
        if (!index || *index == 0 || at < 0 || at >= count) {
          refuse(place, "expected 'f' and numbers of vertices above it", '\'' + whole + '\'');
        }
        corner.push_back(static_cast<std::uint32_t>(at));
      }
      if (corner.size() < 3) refuse(place, "expected a face of at least three corners", '\'' + whole + '\'');
      add_face(corner, place, mesh);
    }
  }
  return mesh;
}

enum class PlyFormat { Text, LittleEndian, BigEndian };

enum class PlyType { Int8, Uint8, Int16, Uint16, Int32, Uint32, Float, Double };

std::optional<PlyType> ply_type(std::string_view name) {
  if (name == "char" || name == "int8") return PlyType::Int8;
  if (name == "uchar" || name == "uint8") return PlyType::Uint8;
  if (name == "short" || name == "int16") return PlyType::Int16;
  if (name == "ushort" || name == "uint16") return PlyType::Uint16;
  if (name == "int" || name == "int32") return PlyType::Int32;
  if (name == "uint" || name == "uint32") return PlyType::Uint32;
  if (name == "float" || name == "float32") return PlyType::Float;
  if (name == "double" || name == "float64") return PlyType::Double;
  return std::nullopt;
}

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::Float;
  std::optional<PlyType> count;  ///< of a list
};

struct PlyElement {
  std::string name;
  std::size_t count = 0;
  std::vector<PlyProperty> properties;
};

/// Numbers of a PLY file one after another, from text or from bytes.
class PlyNumbers {
 public:
  PlyNumbers(std::string_view content, PlyFormat format, const std::string& path) : rest_(content), format_(format), path_(path) {}

  double next(PlyType type) {
    if (format_ == PlyFormat::Text) {
      const std::size_t begin = std::min(rest_.find_first_not_of(" \t\r\n"), rest_.size());
      const std::size_t end = std::min(rest_.find_first_of(" \t\r\n", begin), rest_.size());
      const std::string_view word = rest_.substr(begin, end - begin);
      rest_.remove_prefix(end);
      const std::optional<double> value = parse<double>(word);
      if (!value) refuse(path_, "expected a finite number for every property", word.empty() ? "the end of the file" : '\'' + std::string(word.substr(0, 60)) + '\'');
      return *value;
    }
    switch (type) {
      case PlyType::Int8: return take<std::int8_t>();
      case PlyType::Uint8: return take<std::uint8_t>();
      case PlyType::Int16: return take<std::int16_t>();
      case PlyType::Uint16: return take<std::uint16_t>();
      case PlyType::Int32: return take<std::int32_t>();
      case PlyType::Uint32: return take<std::uint32_t>();
      case PlyType::Float: return static_cast<double>(take<float>());
      case PlyType::Double: return take<double>();
    }
    return 0.0;
  }

 private:
  template <class Number>
  Number take() {
    Number value{};
    if (rest_.size() < sizeof value) refuse(path_, "expected a number for every property", "the end of the file");
    std::array<char, sizeof value> bytes;
    std::copy_n(rest_.data(), sizeof value, bytes.data());
    const bool swapped = (format_ == PlyFormat::BigEndian) != (std::endian::native == std::endian::big);
    if (swapped) std::reverse(bytes.begin(), bytes.end());
    std::memcpy(&value, bytes.data(), sizeof value);
    rest_.remove_prefix(sizeof value);
    return value;
  }

  std::string_view rest_;
  PlyFormat format_;
  const std::string& path_;
};

struct PlyHeader {
  PlyFormat format = PlyFormat::Text;
  std::vector<PlyElement> elements;
  std::string_view content;  ///< after the header
};

PlyHeader read_ply_header(std::string_view text, const std::string& path) {
  Lines lines(text);
  std::string_view line;
  PlyHeader header;
  PlyFormat& format = header.format;
  std::vector<PlyElement>& elements = header.elements;
  bool ended = false, first = true;
  while (!ended && lines.next(line)) {
    const std::string place = path + ':' + std::to_string(lines.number());
    const std::string whole(line.substr(0, 60));
    const std::string_view kind = take_word(line);
    if (first && kind != "ply") refuse(place, "expected a file that begins with 'ply'", '\'' + whole + '\'');
    first = false;
    if (kind == "format") {
      const std::string_view name = take_word(line);
      if (name == "binary_little_endian") format = PlyFormat::LittleEndian;
      else if (name == "binary_big_endian") format = PlyFormat::BigEndian;
      else if (name != "ascii") refuse(place, "expected ascii, binary_little_endian or binary_big_endian", '\'' + whole + '\'');
    } else if (kind == "element") {
      PlyElement element{.name = std::string(take_word(line)), .count = 0, .properties = {}};
      const std::optional<std::size_t> count = parse<std::size_t>(take_word(line));
      if (!count || *count > text.size()) refuse(place, "expected an element with a number not beyond the file's size", '\'' + whole + '\'');
      element.count = *count;
      elements.push_back(std::move(element));
    } else if (kind == "property") {
      PlyProperty property;
      std::string_view type = take_word(line);
      const bool list = type == "list";
      if (list) {
        property.count = ply_type(take_word(line));
        type = take_word(line);
      }
      const std::optional<PlyType> known = ply_type(type);
      if (elements.empty() || !known || (list && !property.count)) refuse(place, "expected a property of a known type", '\'' + whole + '\'');
      property.type = *known;
      property.name = take_word(line);
      elements.back().properties.push_back(std::move(property));
    } else if (kind == "end_header") {
      ended = true;
    }
  }
  if (!ended) refuse(path, "expected 'end_header'", "the end of the file");
  header.content = lines.rest();
  return header;
}

Mesh read_ply(std::string_view text, const std::string& path) {
  const auto [format, elements, content] = read_ply_header(text, path);
  Mesh mesh;
  PlyNumbers numbers(content, format, path);
  std::vector<std::uint32_t> corner;
  for (const PlyElement& element : elements) {
    for (std::size_t k = 0; k < element.count; ++k) {
      heed_scope();
      Vec3 x = Vec3::Zero();
      for (const PlyProperty& property : element.properties) {
        if (!property.count) {
          const double value = numbers.next(property.type);
          for (int axis = 0; axis < 3; ++axis) {
            if (property.name.size() == 1 && property.name[0] == "xyz"[axis]) x[axis] = value;
          }
          continue;
        }
        const bool faces = element.name == "face" && (property.name == "vertex_indices" || property.name == "vertex_index");
        corner.clear();
        const double length = numbers.next(*property.count);
        for (std::uint64_t i = 0; static_cast<double>(i) < length; ++i) {
          const double index = numbers.next(property.type);
          if (!faces) continue;
          if (!(index >= 0.0) || index >= static_cast<double>(mesh.position.size())) {
            std::string found = "vertex ";
            append_number(found, index);
            refuse(path, "expected faces of the vertices before them", found);
          }
          corner.push_back(static_cast<std::uint32_t>(index));
        }
        add_face(corner, path, mesh);
      }
      if (element.name != "vertex") continue;
      if (!x.allFinite()) refuse(path, "expected finite positions", "vertex " + std::to_string(k));
      mesh.position.push_back(x);
    }
  }
  return mesh;
}

/// A mesh as long as 1e-50 m to 1e50 m; vertices that no face uses do not count.
void expect_sizes(const Mesh& mesh, const std::string& place) {
  Box box;
  for (const auto& t : mesh.triangle) {
    for (const std::uint32_t v : t) box.include(mesh.position[v]);
  }
  const double largest = std::max(box.lower.cwiseAbs().maxCoeff(), box.upper.cwiseAbs().maxCoeff()), side = box.extent().maxCoeff();
  std::string found;
  if (!(largest <= kLargestNumber)) {
    append_number(found, largest);
    refuse(place, "expected coordinates up to 1e50 m in size", found + " m");
  }
  if (side > 0.0 && side < kSmallestNumber) {
    append_number(found, side);
    refuse(place, "expected a mesh whose longest side is at least 1e-50 m", found + " m");
  }
}

}  // namespace

NumberTable read_ply_vertices(const std::filesystem::path& path) {
  const std::vector<std::byte> bytes = read_file(path, kLargestInput);
  const std::string place = path.string();
  const PlyHeader header = read_ply_header({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, place);
  NumberTable table;
  PlyNumbers numbers(header.content, header.format, place);
  for (const PlyElement& element : header.elements) {
    const bool vertices = element.name == "vertex";
    for (std::size_t k = 0; vertices && k < element.properties.size(); ++k) {
      if (!element.properties[k].count) table.name.push_back(element.properties[k].name);
    }
    if (vertices) table.column.resize(table.name.size());
    for (std::size_t row = 0; row < element.count; ++row) {
      heed_scope();
      std::size_t column = 0;
      for (const PlyProperty& property : element.properties) {
        const double length = property.count ? numbers.next(*property.count) : 1.0;
        for (std::uint64_t i = 0; static_cast<double>(i) < length; ++i) {
          const double value = numbers.next(property.type);
          if (!vertices || property.count) continue;
          if (!std::isfinite(value)) refuse(place, "expected finite numbers", "another of vertex " + std::to_string(row));
          table.column[column++].push_back(value);
        }
      }
    }
    if (vertices) break;
  }
  return table;
}

Mesh read_mesh(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (extension != ".obj" && extension != ".ply") refuse(path.string(), "expected a mesh in a file .obj or .ply", "'" + extension + '\'');
  const std::vector<std::byte> bytes = read_file(path, kLargestInput);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  Mesh mesh = extension == ".obj" ? read_obj(text, path.string()) : read_ply(text, path.string());
  if (mesh.triangle.empty()) refuse(path.string(), "expected a mesh with faces", "none");
  expect_sizes(mesh, path.string());
  return mesh;
}

}  // namespace supple::io
