#include "supple/core/io/particle_files.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <span>
#include <system_error>

#include "io/number_text.h"
#include "supple/core/counted.h"
#include "supple/core/error.h"
#include "supple/core/io/atomic_file.h"
#include "supple/core/io/mesh_files.h"
#include "supple/core/io/number_range.h"

namespace supple::io {
namespace {

constexpr std::string_view kBetween = " \t,;\r";

[[noreturn]] void refuse_file(const std::string& place, std::string expected, std::string found, std::string hint = {}) {
  throw Error(ErrorKind::Scene, Fault{.place = place, .key = {}, .expected = std::move(expected), .found = std::move(found), .hint = std::move(hint)});
}

std::string text_of_file(const std::filesystem::path& path) {
  const std::vector<std::byte> bytes = read_file(path, kLargestInput);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// The words of the next line that has some. @return whether there is one
bool next_words(std::string_view& text, std::size_t& number, std::vector<std::string_view>& words) {
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    ++number;
    line = line.substr(0, line.find('#'));
    words.clear();
    for (std::size_t at = line.find_first_not_of(kBetween); at != std::string_view::npos;) {
      const std::size_t stop = std::min(line.find_first_of(kBetween, at), line.size());
      words.push_back(line.substr(at, stop - at));
      at = line.find_first_not_of(kBetween, stop);
    }
    if (!words.empty()) return true;
  }
  return false;
}

std::optional<double> finite_number(std::string_view word) {
  if (word.starts_with('+')) word.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

/// "vx" of "vx_m_s".
std::string_view without_unit(std::string_view name) {
  for (const std::string_view unit : {"_m_s", "_m", "_kg"}) {
    if (name.size() > unit.size() && name.ends_with(unit)) return name.substr(0, name.size() - unit.size());
  }
  return name;
}

/// The columns of a group of names; empty where none of them is there.
class Groups {
 public:
  Groups(const NumberTable& table, const std::string& place) : table_(table), place_(place) {}
  template <std::size_t N>
  std::vector<std::span<const double>> take(const std::array<std::string_view, N>& names) const {
    std::vector<std::span<const double>> columns;
    std::string missing;
    for (const std::string_view name : names) {
      const auto at = std::find_if(table_.name.begin(), table_.name.end(), [&](const std::string& other) { return without_unit(other) == name; });
      if (at == table_.name.end()) {
        missing += (missing.empty() ? "" : ", ") + std::string(name);
      } else {
        columns.emplace_back(table_.column[static_cast<std::size_t>(at - table_.name.begin())]);
      }
    }
    if (!columns.empty() && columns.size() < N) refuse_file(place_, "expected all columns of a group", "none named " + missing);
    for (std::size_t k = 0; k < columns.size(); ++k) expect_sizes(names[k], columns[k]);
    return columns;
  }
  std::vector<Vec3> vectors(const std::array<std::string_view, 3>& names) const {
    const auto columns = take(names);
    std::vector<Vec3> out;
    for (std::size_t i = 0; !columns.empty() && i < columns[0].size(); ++i) out.emplace_back(columns[0][i], columns[1][i], columns[2][i]);
    return out;
  }
  std::vector<double> positive(std::string_view name) const {
    const auto columns = take(std::array{name});
    if (columns.empty()) return {};
    const auto bad = std::find_if_not(columns[0].begin(), columns[0].end(), [](double v) { return v >= kSmallestNumber; });
    if (bad != columns[0].end()) fail(bad - columns[0].begin(), "expected '" + std::string(name) + "' > 0" + (*bad > 0.0 ? ", at least 1e-50" : ""), text_of(*bad));
    return {columns[0].begin(), columns[0].end()};
  }
  [[noreturn]] void fail(std::ptrdiff_t particle, std::string expected, std::string found) const {
    refuse_file(place_, std::move(expected), std::move(found) + " of particle " + std::to_string(particle));
  }

 private:
  static std::string text_of(double value) {
    std::string text;
    append_number(text, value);
    return text;
  }
  void expect_sizes(std::string_view name, std::span<const double> column) const {
    const auto bad = std::find_if_not(column.begin(), column.end(), [](double v) { return std::abs(v) <= kLargestNumber; });
    if (bad != column.end()) fail(bad - column.begin(), "expected '" + std::string(name) + "' up to 1e50 in size", text_of(*bad));
  }

  const NumberTable& table_;
  const std::string& place_;
};

core::Arrangement particles_of(const NumberTable& table, const std::string& place) {
  const Groups groups(table, place);
  core::Arrangement out;
  out.position = groups.vectors({"x", "y", "z"});
  if (out.position.empty()) refuse_file(place, "expected columns x, y and z with particles", table.name.empty() ? "none" : "others, or no row");
  std::vector<Vec3> normal = groups.vectors({"nx", "ny", "nz"});
  for (std::size_t i = 0; i < normal.size(); ++i) {
    if (!(normal[i].norm() > 0.0)) groups.fail(static_cast<std::ptrdiff_t>(i), "expected a normal that is not zero", "a zero");
    normal[i].normalize();
  }
  const auto turns = groups.take(std::array<std::string_view, 4>{"qw", "qx", "qy", "qz"});
  for (std::size_t i = 0; i < out.position.size(); ++i) {
    Quat q = Quat::Identity();
    if (!turns.empty()) q = Quat(turns[0][i], turns[1][i], turns[2][i], turns[3][i]);
    else if (!normal.empty()) q = Quat::FromTwoVectors(Vec3::UnitZ(), normal[i]);
    if (!(q.norm() > 0.0)) groups.fail(static_cast<std::ptrdiff_t>(i), "expected an orientation that is not zero", "a zero");
    out.orientation.push_back(q.normalized());
  }
  if (!turns.empty()) {
    for (std::size_t i = 0; i < normal.size(); ++i) out.normal.emplace_back((out.orientation[i].conjugate() * normal[i]).normalized());
  }
  out.velocity = groups.vectors({"vx", "vy", "vz"});
  out.mass = groups.positive("mass");
  out.inertia_radius = groups.positive("radius");
  return out;
}

bool is_name(std::string_view word) {
  const char c = word.empty() ? '0' : word.front();
  return ((c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_') && word != "nan" && word != "inf";
}

}  // namespace

NumberTable read_csv_columns(const std::filesystem::path& path) {
  const std::string whole = text_of_file(path);
  std::string_view text = whole;
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  NumberTable table;
  std::size_t number = 0;
  std::vector<std::string_view> words;
  if (!next_words(text, number, words)) return table;
  table.name.assign(words.begin(), words.end());
  table.column.resize(words.size());
  while (next_words(text, number, words)) {
    const std::string place = path.string() + ':' + std::to_string(number);
    if (words.size() != table.name.size()) {
      refuse_file(place, "expected " + counted(table.name.size(), "number") + ", one of each name in the first line", std::to_string(words.size()));
    }
    for (std::size_t k = 0; k < words.size(); ++k) {
      const std::optional<double> value = finite_number(words[k]);
      if (!value) refuse_file(place, "expected finite numbers", '\'' + std::string(words[k].substr(0, 60)) + '\'');
      table.column[k].push_back(*value);
    }
  }
  return table;
}

core::Arrangement read_particles(const std::filesystem::path& path, std::size_t most) {
  const std::string place = path.string();
  NumberTable table;
  if (path.extension() == ".ply") {
    table = read_ply_vertices(path);
  } else {
    const std::string whole = text_of_file(path);
    std::string_view text = whole;
    if (text.starts_with("ply\n") || text.starts_with("ply\r\n")) {
      refuse_file(place, "expected CSV", "a PLY file", "give the file a name that ends in .ply");
    }
    std::size_t number = 0;
    std::vector<std::string_view> words;
    const bool named = next_words(text, number, words) && words.size() > 3 && std::all_of(words.begin(), words.end(), is_name);
    if (!named) {
      core::Arrangement out;
      out.position = read_points_csv(path, most);
      out.orientation.assign(out.position.size(), Quat::Identity());
      return out;
    }
    table = read_csv_columns(path);
  }
  core::Arrangement out = particles_of(table, place);
  if (out.size() > most) refuse_file(place, "expected at most " + std::to_string(most) + " particles", std::to_string(out.size()), "divide them among several objects");
  return out;
}

}  // namespace supple::io
