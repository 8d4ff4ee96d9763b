#include "supple/scenes/inspect.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "output/files/folder_lock.h"
#include "output/files/output_files.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "supple/core/io/atomic_file.h"
#include "supple/core/io/mesh_files.h"
#include "supple/render/image.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr const char* kComparison = "compare";  // name of its pictures and of its film
constexpr std::size_t kLargestReport = std::size_t{1} << 24;
constexpr double kUsualRate = 24.0;

[[noreturn]] void fail(ErrorKind kind, const fs::path& place, std::string expected, std::string found, std::string hint = {}) {
  throw Error(kind, Fault{.place = place.string(),
                          .key = {},
                          .expected = std::move(expected),
                          .found = std::move(found),
                          .hint = std::move(hint)});
}

ordered_json read_report(const fs::path& folder) {
  const fs::path path = folder / "result.json";
  const std::vector<std::byte> bytes = io::read_file(path, kLargestReport);
  const char* text = reinterpret_cast<const char*>(bytes.data());
  ordered_json report = ordered_json::parse(text, text + bytes.size(), nullptr, false);
  if (!report.is_object() || !report.contains("outcome") || !report["outcome"].is_string()) fail(ErrorKind::Corrupt, path, "expected the report of a run", "something else");
  return report;
}

std::string line(const char* format, auto... values) {
  std::string text(static_cast<std::size_t>(std::max(std::snprintf(nullptr, 0, format, values...), 0)), '\0');
  std::snprintf(text.data(), text.size() + 1, format, values...);
  return text + '\n';
}

double number_at(const ordered_json& object, const char* key) {
  const auto at = object.find(key);
  return at != object.end() && at->is_number() ? at->get<double>() : 0.0;
}

std::string text_at(const ordered_json& object, const char* key) {
  const auto at = object.find(key);
  return at != object.end() && at->is_string() ? at->get<std::string>() : "";
}

std::string files_text(const fs::path& folder) {
  struct Kind {
    std::size_t files = 0;
    std::uintmax_t bytes = 0;
  };
  std::map<std::string, Kind> kinds;
  for (const auto& entry : fs::recursive_directory_iterator(folder, fs::directory_options::skip_permission_denied)) {
    if (!entry.is_regular_file() || entry.path().filename().string().starts_with('.')) continue;
    const fs::path relative = fs::relative(entry.path(), folder);
    const std::string part = relative.has_parent_path() ? relative.begin()->string() + "/*" + entry.path().extension().string()
                                                        : relative.string();
    kinds[part].files += 1;
    kinds[part].bytes += entry.file_size();
  }
  std::string text = "files\n";
  for (const auto& [part, kind] : kinds) {
    text += line("  %-34s %6zu %10.2f MB", part.c_str(), kind.files, 1e-6 * static_cast<double>(kind.bytes));
  }
  return text;
}

/// Lines for one object; empty where it has no volume control.
std::string volumes_text(const ordered_json& object) {
  if (!object.contains("volume")) return {};
  const ordered_json& held = object["volume"];
  if (!(held.contains("target_m3") && held.contains("volume_m3") && held.contains("scale"))) return {};
  const ordered_json &targets = held["target_m3"], &volumes = held["volume_m3"], &scales = held["scale"];
  std::string text;
  constexpr std::size_t kMost = 8;
  const std::size_t n = std::min({targets.size(), volumes.size(), scales.size()});
  for (std::size_t k = 0; k < std::min(n, kMost); ++k) {
    const std::string what = n == 1 ? "volume" : "volume of " + text_at(held, "of") + ' ' + std::to_string(k);
    if (!targets[k].is_number() || !scales[k].is_number()) continue;
    if (volumes[k].is_number()) {
      text += line("    %s: %.4g m^3, target %.4g m^3, kernels scaled by %.3g", what.c_str(), volumes[k].get<double>(), targets[k].get<double>(),
                   scales[k].get<double>());
    } else {
      text += line("    %s: target %.4g m^3, from the first step on", what.c_str(), targets[k].get<double>());
    }
  }
  if (n > kMost) text += line("    %zu more volumes", n - kMost);
  return text;
}

/// Empty without entries.
std::string searches_text(const ordered_json& searches) {
  std::string text;
  for (const auto& [key, what] : {std::pair{"pieces", "added to meshes"}, {"undecided", "undecided cells"}, {"crossings", "pairs of triangles that intersect"}}) {
    if (number_at(searches, key) > 0.0) text += line("  %-34s %8.0f", what, number_at(searches, key));
  }
  if (searches.contains("unsearched")) {
    for (const auto& [object, meshes] : searches["unsearched"].items()) {
      for (const auto& [why, count] : meshes.items()) {
        if (!count.is_number()) continue;
        std::string what = "meshes of " + object;
        what += " not searched, " + why;
        text += line("  %-34s %8.0f", what.c_str(), count.get<double>());
      }
    }
  }
  if (searches.contains("blunt")) {
    for (const auto& [object, cells] : searches["blunt"].items()) {
      if (!cells.is_number()) continue;
      const std::string what = "cells of " + object + " with a cut crease";
      text += line("  %-34s %8.0f", what.c_str(), cells.get<double>());
    }
  }
  return text.empty() ? text : "pieces between the nodes of the lattice\n" + text;
}

/// Empty without entries.
std::string short_bulges_text(const ordered_json& searches) {
  if (!searches.contains("short_bulges")) return {};
  std::string text;
  for (const auto& bulges : searches["short_bulges"]) {
    if (!bulges.is_object()) continue;
    const std::string what = text_at(bulges, "of") + " around " + text_at(bulges, "around");
    text += line("  %-34s %8.3g at %.6g s", what.c_str(), number_at(bulges, "held"), number_at(bulges, "time_s"));
  }
  return text.empty() ? text : "smallest shares of the displaced volume that bulges hold\n" + text;
}

struct FrameName {
  std::string name;
  int frame = 0;
};

/// Of "name.0012.png".
std::optional<FrameName> frame_name(const fs::path& path) {
  const std::string stem = path.stem().string();
  const std::size_t dot = stem.rfind('.');
  if (path.extension() != ".png" || dot == std::string::npos) return std::nullopt;
  FrameName out{.name = stem.substr(0, dot), .frame = 0};
  const auto [end, error] = std::from_chars(stem.data() + dot + 1, stem.data() + stem.size(), out.frame);
  if (error != std::errc() || end != stem.data() + stem.size()) return std::nullopt;
  return out;
}

/// Of the only camera, or of the one that `camera` names.
std::map<int, fs::path> frames_of(const fs::path& folder, const std::string& camera) {
  std::map<std::string, std::map<int, fs::path>> pictures;
  if (fs::is_directory(folder / "frames")) {
    for (const auto& entry : fs::directory_iterator(folder / "frames")) {
      if (const auto file = frame_name(entry.path())) pictures[file->name][file->frame] = entry.path();
    }
  }
  if (pictures.empty()) fail(ErrorKind::Io, folder, "expected a run folder with frames", "none");
  if (pictures.size() == 1) return pictures.begin()->second;
  std::string known;
  for (const auto& [name, frames] : pictures) {
    if (!camera.empty() && name.ends_with('.' + camera)) return frames;
    known += (known.empty() ? "" : ", ") + name;
  }
  fail(ErrorKind::Usage, folder, "expected the frames of one camera, or --camera with the name of one", known);
}

std::string size_text(const render::Image& image) { return std::to_string(image.width) + " x " + std::to_string(image.height); }

}  // namespace

std::string describe_run(const fs::path& folder) {
  const ordered_json report = read_report(folder);
  std::string text = text_at(report, "title") + '\n';
  const std::string reason = text_at(report, "reason");
  text += line("  outcome     %s%s%s", text_at(report, "outcome").c_str(), reason.empty() ? "" : ": ", reason.c_str());
  text += line("  frames      %.0f of %.0f", number_at(report, "frames"), number_at(report, "frame_count"));
  text += line("  state       %s", text_at(report, "state_hash").c_str());
  text += line("  wall time   %.2f s, CPU time %.2f s, peak memory %.0f MB", number_at(report, "wall_s"), number_at(report, "cpu_s"),
               number_at(report, "peak_memory_mb"));
  if (report.contains("steps")) {
    text += line("  simulated   %.4g s in %.0f steps, the last of %.3g s", number_at(report, "simulated_s"), number_at(report, "steps"),
                 number_at(report, "time_step_s"));
  }
  if (report.contains("audits")) {
    text += "audits\n";
    for (const auto& [key, value] : report["audits"].items()) {
      if (value.is_number()) text += line("  %-34s %.3g", key.c_str(), value.get<double>());
    }
  }
  if (report.contains("errors")) {
    text += "estimated errors of positions\n";
    for (const auto& [key, error] : report["errors"].items()) {
      if (!error.is_object()) continue;
      text += line("  %-34s %.3g m, %.3g of the size of %s", key.c_str(), number_at(error, "position_m"), number_at(error, "share"),
                   text_at(error, "object").c_str());
    }
  }
  if (report.contains("objects")) {
    text += "objects\n";
    for (const auto& [name, object] : report["objects"].items()) {
      const double particles = number_at(object, "particles"), pieces = number_at(object, "pieces");
      text += line("  %-20s %6.0f particle%s in %.0f piece%s, largest deformation %.3g, final %.3g", name.c_str(), particles,
                   particles == 1.0 ? "" : "s", pieces, pieces == 1.0 ? "" : "s", number_at(object, "largest_deformation"),
                   number_at(object, "final_shape_error"));
      text += volumes_text(object);
    }
  }
  if (report.contains("searches")) text += searches_text(report["searches"]) + short_bulges_text(report["searches"]);
  if (report.contains("stages")) {
    text += "stages                                  calls      cpu s\n";
    for (const auto& [name, stage] : report["stages"].items()) {
      if (number_at(stage, "calls") > 0.0) {
        text += line("  %-34s %8.0f %10.3f", name.c_str(), number_at(stage, "calls"), number_at(stage, "cpu_s"));
      }
    }
  }
  return text + files_text(folder);
}

Comparison compare_runs(const ComparisonOptions& options) {
  const std::map<int, fs::path> first = frames_of(options.first, options.camera),
                                second = frames_of(options.second, options.camera);
  io::make_writable_folder(options.folder / "frames");
  const FolderLock lock(options.folder);
  remove_temporaries(options.folder, kComparison);
  std::error_code absent;
  fs::remove(options.folder / "compare.mp4", absent);  // of an earlier comparison
  constexpr int kGap = 2;
  Comparison result;
  for (const auto& [frame, path] : first) {
    heed(options.interrupt);
    const auto other = second.find(frame);
    if (other == second.end()) {
      ++result.only_first;
      continue;
    }
    const std::array<render::Image, 2> pair{render::read_png(path), render::read_png(other->second)};
    if (pair[0].width != pair[1].width || pair[0].height != pair[1].height) {
      fail(ErrorKind::Usage, other->second, "expected a picture of " + size_text(pair[0]) + ", as in the other run", size_text(pair[1]),
           "draw one of them again: supple render SCENE --set 'output.images={size: [...]}'");
    }
    const render::ImageDifference difference = render::compare(pair[0], pair[1], options.gain);
    const std::array<render::Image, 3> row{pair[0], pair[1], difference.picture};
    render::write_png(frame_path(options.folder, kComparison, frame), render::contact_sheet(row, 3, kGap));
    result.frames.push_back({frame, difference.psnr, difference.largest});
  }
  result.only_second = static_cast<int>(second.size() - result.frames.size());
  if (result.frames.empty()) fail(ErrorKind::Io, options.second, "expected a frame that the other run has, too", "none");

  std::array<std::vector<double>, 3> columns;
  for (const FrameComparison& f : result.frames) {
    columns[0].push_back(f.frame);
    columns[1].push_back(f.psnr);
    columns[2].push_back(f.largest);
  }
  const std::array<io::TableColumn, 3> table{{{"frame", columns[0]}, {"psnr_db", columns[1]}, {"largest", columns[2]}}};
  io::write_csv(options.folder / "compare.csv", table);

  const int begin = result.frames.front().frame, end = result.frames.back().frame;
  if (options.film && static_cast<std::size_t>(end - begin + 1) == result.frames.size()) {
    double rate = kUsualRate;
    if (fs::exists(options.first / "result.json")) rate = number_at(read_report(options.first), "frame_rate");
    result.film = options.folder / "compare.mp4";
    render::encode_film({options.folder / "frames", kComparison, begin, end, rate > 0.0 ? rate : kUsualRate}, result.film, options.interrupt);
  }
  return result;
}

}  // namespace supple::scenes
