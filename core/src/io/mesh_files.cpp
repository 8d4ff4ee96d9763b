#include "supple/core/io/mesh_files.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <system_error>
#include <utility>

#include "io/number_text.h"
#include "supple/core/error.h"
#include "supple/core/io/atomic_file.h"
#include "supple/core/io/number_range.h"

namespace supple::io {
namespace {

constexpr std::size_t kMaxPointFile = std::size_t{1} << 27;
constexpr std::size_t kMaxFaults = 20;

template <class T>
void append(std::string& bytes, T value) {
  std::array<char, sizeof(T)> raw;
  std::memcpy(raw.data(), &value, sizeof(T));
  bytes.append(raw.data(), raw.size());
}

/// PLY property names are single words.
std::string word(std::string name) {
  for (char& c : name) {
    if (static_cast<unsigned char>(c) <= ' ') c = '_';
  }
  return name;
}

bool is_separator(char c) { return c == ',' || c == ';' || c == ' ' || c == '\t' || c == '\r'; }

bool parse_number(std::string_view text, double& value) {
  if (text.size() > 1 && text.front() == '+' && text[1] != '-') text.remove_prefix(1);
  const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
  return result.ec == std::errc() && result.ptr == text.data() + text.size() && std::isfinite(value);
}

/// True when the line is exactly three finite numbers.
bool parse_point(std::string_view line, Vec3& point) {
  for (int k = 0; k < 3; ++k) {
    std::size_t length = 0;
    while (length < line.size() && !is_separator(line[length])) ++length;
    if (!parse_number(line.substr(0, length), point[k])) return false;
    line.remove_prefix(length);
    // At most one comma between two numbers: an empty cell is a mistake, not a separator.
    std::size_t commas = 0;
    while (!line.empty() && is_separator(line.front())) {
      if (line.front() == ',' || line.front() == ';') ++commas;
      line.remove_prefix(1);
    }
    if (commas > 1) return false;
  }
  return line.empty();
}

bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }

bool starts_like_a_name(std::string_view line) {
  const char c = line.front();
  return is_letter(c) || c == '"' || c == '_';
}

/// Whether a header names columns x, y, z, but in another order. Units may follow ("x [m]", "x_m"); other names have no effect.
bool swaps_axes(std::string_view head) {
  std::string axes;
  while (!head.empty()) {
    if (is_separator(head.front()) || head.front() == '"') {
      head.remove_prefix(1);
      continue;
    }
    const bool alone = head.size() == 1 || !is_letter(head[1]);
    axes += alone && is_letter(head.front()) ? static_cast<char>(head.front() | 0x20) : '?';
    std::size_t end = 1;
    const auto ends = [&] { return is_separator(head[end]) && !(head[end] == ' ' && end + 1 < head.size() && !is_letter(head[end + 1])); };
    while (end < head.size() && !ends()) ++end;
    head.remove_prefix(end);
  }
  return axes.size() == 3 && axes != "xyz" && std::is_permutation(axes.begin(), axes.end(), "xyz");
}

}  // namespace

void write_ply(const std::filesystem::path& path, const Mesh& mesh) {
  const std::size_t n = mesh.vertex_count();
  SUPPLE_EXPECTS(mesh.normal.size() == n);
  for (const Mesh::Column& column : mesh.columns) SUPPLE_EXPECTS(column.values.size() == n);

  std::string bytes = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(n) + '\n';
  for (const char* name : {"x", "y", "z"}) bytes += std::string("property double ") + name + '\n';
  for (const char* name : {"nx", "ny", "nz"}) bytes += std::string("property float ") + name + '\n';
  for (const Mesh::Column& column : mesh.columns) bytes += "property float " + word(column.name) + '\n';
  bytes += "element face " + std::to_string(mesh.triangle_count()) +
           "\nproperty list uchar int vertex_indices\nend_header\n";
  bytes.reserve(bytes.size() + n * 4 * (9 + mesh.columns.size()) + 13 * mesh.triangle_count());

  for (std::size_t i = 0; i < n; ++i) {
    for (int k = 0; k < 3; ++k) append(bytes, mesh.position[i][k]);
    for (int k = 0; k < 3; ++k) append(bytes, static_cast<float>(mesh.normal[i][k]));
    for (const Mesh::Column& column : mesh.columns) append(bytes, static_cast<float>(column.values[i]));
  }
  for (const auto& t : mesh.triangle) {
    append(bytes, std::uint8_t{3});
    for (const std::uint32_t v : t) append(bytes, static_cast<std::int32_t>(v));
  }
  write_atomically(path, bytes);
}

void write_obj(const std::filesystem::path& path, const Mesh& mesh) {
  SUPPLE_EXPECTS(mesh.normal.size() == mesh.vertex_count());
  std::string text;
  text.reserve(100 * mesh.vertex_count() + 40 * mesh.triangle_count());
  for (const Vec3& p : mesh.position) {
    text += "v ";
    append_vector<double>(text, p, " ");
    text += '\n';
  }
  for (const Vec3& n : mesh.normal) {
    text += "vn ";
    append_vector(text, n, " ");
    text += '\n';
  }
  for (const auto& t : mesh.triangle) {
    text += 'f';
    for (const std::uint32_t v : t) {
      const std::string number = std::to_string(v + 1);  // counted from 1
      text.append(" ").append(number).append("//").append(number);
    }
    text += '\n';
  }
  write_atomically(path, text);
}

void write_csv(const std::filesystem::path& path, std::span<const TableColumn> columns) {
  std::string text;
  for (const TableColumn& column : columns) {
    SUPPLE_EXPECTS(column.values.size() == columns.front().values.size());
    if (!text.empty()) text += ',';
    text += column.name;
  }
  text += '\n';
  const std::size_t rows = columns.empty() ? 0 : columns.front().values.size();
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t k = 0; k < columns.size(); ++k) {
      if (k > 0) text += ',';
      append_number(text, columns[k].values[row]);
    }
    text += '\n';
  }
  write_atomically(path, text);
}

std::vector<Vec3> read_points_csv(const std::filesystem::path& path, std::size_t most) {
  const std::vector<std::byte> bytes = read_file(path, kMaxPointFile);
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);

  std::vector<Vec3> points;
  std::vector<Fault> faults;
  bool header_allowed = true;
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::size_t end = text.find('\n');
    std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    line = line.substr(0, line.find('#'));
    while (!line.empty() && (line.back() == '\r' || line.back() == ' ' || line.back() == '\t')) line.remove_suffix(1);
    while (!line.empty() && (line.front() == ' ' || line.front() == '\t')) line.remove_prefix(1);
    if (line.empty()) continue;
    Vec3 point;
    if (parse_point(line, point)) {
      if (points.size() == most) {
        throw Error(ErrorKind::Scene, Fault{.place = path.string() + ':' + std::to_string(number),
                                            .key = {},
                                            .expected = "expected at most " + std::to_string(most) + " points",
                                            .found = "one more",
                                            .hint = "divide them among several files"});
      }
      if (!(point.cwiseAbs().maxCoeff() <= kLargestNumber)) {
        faults.push_back(Fault{.place = path.string() + ':' + std::to_string(number),
                               .key = {},
                               .expected = "expected three numbers up to 1e50 in size",
                               .found = '\'' + std::string(line.substr(0, 60)) + '\'',
                               .hint = {}});
        if (faults.size() == kMaxFaults) break;
      }
      points.push_back(point);
    } else if (header_allowed && swaps_axes(line)) {
      faults.push_back(Fault{.place = path.string() + ':' + std::to_string(number),
                             .key = {},
                             .expected = "expected the columns x, y, z in this order",
                             .found = '\'' + std::string(line.substr(0, 60)) + '\'',
                             .hint = {}});
    } else if (!(header_allowed && starts_like_a_name(line) && !line.starts_with("nan") && !line.starts_with("inf"))) {
      faults.push_back(Fault{.place = path.string() + ':' + std::to_string(number),
                             .key = {},
                             .expected = "expected three finite numbers",
                             .found = '\'' + std::string(line.substr(0, 60)) + '\'',
                             .hint = {}});
      if (faults.size() == kMaxFaults) break;
    }
    header_allowed = false;
  }
  if (!faults.empty()) throw Error(ErrorKind::Scene, std::move(faults));
  return points;
}

}  // namespace supple::io
