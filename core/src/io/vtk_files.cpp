#include "supple/core/io/vtk_files.h"

#include <cstddef>
#include <cstring>
#include <utility>

#include "io/number_text.h"
#include "supple/core/error.h"
#include "supple/core/io/atomic_file.h"
#include "supple/core/io/mesh_files.h"

namespace supple::io {
namespace {

std::string attribute(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&': out += "&amp;"; break;
      case '<': out += "&lt;"; break;
      case '"': out += "&quot;"; break;
      // Readers make spaces of these.
      case '\n': out += "&#10;"; break;
      case '\r': out += "&#13;"; break;
      case '\t': out += "&#9;"; break;
      default: out += c;
    }
  }
  return out;
}

/// The XML text of arrays whose numbers lie behind it, each after its length in bytes.
class AppendedArrays {
 public:
  template <class Number>
  std::string add(std::string_view type, std::string_view name, std::span<const std::string> component,
                  std::span<const Number> values) {
    std::string text = "        <DataArray type=\"" + std::string(type) + "\" Name=\"" + attribute(name) + '"';
    if (!component.empty()) text += " NumberOfComponents=\"" + std::to_string(component.size()) + '"';
    for (std::size_t k = 0; k < component.size(); ++k) {
      text += " ComponentName" + std::to_string(k) + "=\"" + attribute(component[k]) + '"';
    }
    text += " format=\"appended\" offset=\"" + std::to_string(bytes_.size()) + "\"/>\n";
    const std::uint64_t length = values.size_bytes();
    append(&length, sizeof length);
    append(values.data(), values.size_bytes());
    return text;
  }
  [[nodiscard]] std::span<const std::byte> bytes() const { return bytes_; }

 private:
  void append(const void* data, std::size_t size) {
    if (size == 0) return;
    const std::size_t end = bytes_.size();
    bytes_.resize(end + size);
    std::memcpy(bytes_.data() + end, data, size);
  }
  std::vector<std::byte> bytes_;
};

/// Vertices or lines: the points they run through, and where each ends in that list.
std::string cells(AppendedArrays& arrays, std::string_view tag, std::size_t count, std::size_t points_each,
                  std::span<const std::int64_t> connectivity) {
  std::vector<std::int64_t> offsets(count);
  for (std::size_t i = 0; i < count; ++i) offsets[i] = static_cast<std::int64_t>((i + 1) * points_each);
  const std::string name(tag);
  return "      <" + name + ">\n" + arrays.add<std::int64_t>("Int64", "connectivity", {}, connectivity) +
         arrays.add<std::int64_t>("Int64", "offsets", {}, offsets) + "      </" + name + ">\n";
}

constexpr std::string_view kHead = "<?xml version=\"1.0\"?>\n<VTKFile ";

}  // namespace

std::vector<double>& PointSet::add(std::string name, std::vector<std::string> component) {
  PointData& array = data.emplace_back(PointData{std::move(name), std::move(component), {}});
  array.values.assign(position.size() * array.components(), 0.0);
  return array.values;
}

void write_vtp(const std::filesystem::path& path, const PointSet& points) {
  const std::size_t n = points.position.size();
  AppendedArrays arrays;
  std::string text = std::string(kHead) +
                     "type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n"
                     "  <PolyData>\n    <Piece NumberOfPoints=\"" + std::to_string(n) + "\" NumberOfVerts=\"" +
                     std::to_string(n) + "\" NumberOfLines=\"" + std::to_string(points.line.size()) + "\">\n      <PointData>\n";
  for (const PointData& array : points.data) {
    SUPPLE_EXPECTS(array.values.size() == n * array.components());
    text += arrays.add<double>("Float64", array.name, array.component, array.values);
  }
  text += "      </PointData>\n      <Points>\n";
  static const std::vector<std::string> kAxes = {"x", "y", "z"};
  static_assert(sizeof(Vec3) == 3 * sizeof(double));
  text += arrays.add<double>("Float64", "position_m", kAxes,
                             {n == 0 ? nullptr : points.position.front().data(), 3 * n});
  text += "      </Points>\n";
  std::vector<std::int64_t> connectivity(n);
  for (std::size_t i = 0; i < n; ++i) connectivity[i] = static_cast<std::int64_t>(i);
  text += cells(arrays, "Verts", n, 1, connectivity);
  connectivity.clear();
  for (const auto& line : points.line) connectivity.insert(connectivity.end(), line.begin(), line.end());
  text += cells(arrays, "Lines", points.line.size(), 2, connectivity);
  text += "    </Piece>\n  </PolyData>\n  <AppendedData encoding=\"raw\">\n_";
  AtomicFile file(path);
  file.append(text);
  file.append(arrays.bytes());
  file.append("\n  </AppendedData>\n</VTKFile>\n");
  file.commit();
}

void write_points_csv(const std::filesystem::path& path, const PointSet& points) {
  const std::size_t n = points.position.size();
  struct Column {
    std::string name;
    std::vector<double> values;
  };
  std::vector<Column> columns;
  const auto add = [&](std::string name, std::size_t components, std::size_t k, const double* tuples) {
    Column& column = columns.emplace_back(Column{std::move(name), std::vector<double>(n)});
    for (std::size_t i = 0; i < n; ++i) column.values[i] = tuples[i * components + k];
  };
  const double* position = n == 0 ? nullptr : points.position.front().data();
  for (std::size_t k = 0; k < 3; ++k) add(std::string(1, "xyz"[k]) + "_m", 3, k, position);
  for (const PointData& array : points.data) {
    SUPPLE_EXPECTS(array.values.size() == n * array.components());
    for (std::size_t k = 0; k < array.components(); ++k) {
      add(array.component.empty() ? array.name : array.component[k], array.components(), k, array.values.data());
    }
  }
  std::vector<TableColumn> table;
  table.reserve(columns.size());
  for (const Column& column : columns) table.push_back({column.name, column.values});
  write_csv(path, table);
}

void write_pvd(const std::filesystem::path& path, std::span<const TimedFile> files) {
  std::string text = std::string(kHead) + "type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n  <Collection>\n";
  for (const TimedFile& entry : files) {
    text += "    <DataSet timestep=\"";
    append_number(text, entry.time);
    text += "\" part=\"0\" file=\"" + attribute(entry.file.generic_string()) + "\"/>\n";
  }
  text += "  </Collection>\n</VTKFile>\n";
  write_atomically(path, text);
}

}  // namespace supple::io
