#include "output/meshes/search_files.h"

#include <string_view>
#include <system_error>

#include "output/files/output_files.h"
#include "output/run/spare_memory.h"
#include "supple/core/io/atomic_file.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr const char* kFolder = "searches";
constexpr std::size_t kLargestFile = std::size_t{1} << 28;  // [bytes]

std::uint64_t count_at(const ordered_json& object, std::string_view key) {
  const auto at = object.find(key);
  return at != object.end() && at->is_number_unsigned() ? at->get<std::uint64_t>() : 0;
}

double number_at(const ordered_json& object, std::string_view key, double otherwise) {
  const auto at = object.find(key);
  return at != object.end() && at->is_number() ? at->get<double>() : otherwise;
}

SearchCounts searches_of(const ordered_json& json) {
  SearchCounts counts{.pieces = count_at(json, "pieces"), .undecided = count_at(json, "undecided"), .crossings = count_at(json, "crossings"), .unsearched = {}, .blunt = {}, .short_bulges = {}};
  if (const auto blunt = json.find("blunt"); blunt != json.end() && blunt->is_object()) {
    for (const auto& [object, cells] : blunt->items()) {
      if (cells.is_number_unsigned()) counts.blunt[object] = cells.get<std::uint64_t>();
    }
  }
  if (const auto bulges = json.find("short_bulges"); bulges != json.end() && bulges->is_array()) {
    for (const ordered_json& b : *bulges) {
      if (!b.is_object() || !b.contains("of") || !b["of"].is_string() || !b.contains("around") || !b["around"].is_string()) continue;
      const ShortBulges read{.count = count_at(b, "contacts"), .held = number_at(b, "held", 1.0), .time = number_at(b, "time_s", 0.0)};
      counts.short_bulges[b["of"].get<std::string>()][b["around"].get<std::string>()] = read;
    }
  }
  const auto unsearched = json.find("unsearched");
  if (unsearched == json.end() || !unsearched->is_object()) return counts;
  for (const auto& [object, meshes] : unsearched->items()) {
    if (!meshes.is_object()) continue;
    for (std::size_t k = 0; k < kUnsearchedNames.size(); ++k) counts.unsearched[object][k] = count_at(meshes, kUnsearchedNames[k]);
  }
  return counts;
}

/// Counts in a file; none where it is absent or not ours.
SearchCounts read_counts(const fs::path& path) {
  if (!fs::exists(path)) return {};
  const std::vector<std::byte> text = io::read_file(path, kLargestFile);
  const char* begin = reinterpret_cast<const char*>(text.data());
  const SpareMemory spare(kSpareForJson);
  const ordered_json json = ordered_json::parse(begin, begin + text.size(), nullptr, false);
  return json.is_object() ? searches_of(json) : SearchCounts{};
}

}  // namespace

ordered_json json_of(const SearchCounts& counts) {
  ordered_json unsearched = ordered_json::object();
  for (const auto& [object, meshes] : counts.unsearched) {
    for (std::size_t k = 0; k < meshes.size(); ++k) {
      if (meshes[k] > 0) unsearched[object][std::string(kUnsearchedNames[k])] = meshes[k];
    }
  }
  ordered_json bulges = ordered_json::array();
  for (const auto& [object, around] : counts.short_bulges) {
    for (const auto& [body, b] : around) bulges.push_back({{"of", object}, {"around", body}, {"contacts", b.count}, {"held", b.held}, {"time_s", b.time}});
  }
  return {{"pieces", counts.pieces},   {"undecided", counts.undecided}, {"crossings", counts.crossings},
          {"unsearched", unsearched}, {"blunt", counts.blunt},         {"short_bulges", bulges}};
}

void write_searches(const fs::path& folder, const std::string& name, int frame, const SearchCounts& counts) {
  const fs::path path = folder / kFolder / numbered(name, frame, ".json");
  if (counts.empty()) {
    std::error_code absent;
    fs::remove(path, absent);
    return;
  }
  io::make_writable_folder(path.parent_path());
  const SpareMemory spare(kSpareForJson);
  io::write_atomically(path, std::string_view(json_of(counts).dump() + "\n"));
}

void write_short_bulges(const fs::path& folder, const std::string& name, int frame, const SearchCounts& counts) {
  SearchCounts all = read_counts(folder / kFolder / numbered(name, frame, ".json"));
  all.short_bulges = counts.short_bulges;
  write_searches(folder, name, frame, all);
}

SearchCounts read_searches(const fs::path& folder, const std::string& name, const std::set<int>& frames, int last) {
  SearchCounts all;
  for (int frame = 1; frame <= last; ++frame) {
    const fs::path path = folder / kFolder / numbered(name, frame, ".json");
    if (frames.empty() || frames.contains(frame)) all.add(read_counts(path));
  }
  return all;
}

}  // namespace supple::scenes
