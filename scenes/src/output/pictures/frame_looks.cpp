#include "output/pictures/frame_looks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include "output/files/output_files.h"
#include "output/files/saved_frames.h"
#include "output/run/run_origin.h"
#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/core/io/atomic_file.h"
#include "supple/render/image.h"
#include "supple/render/overlay.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kHashDigits = 16;
constexpr int kSheetColumns = 4;
constexpr int kSheetRows = 3;
constexpr int kSheetImageWidth = 320;
constexpr int kSheetGap = 4;
constexpr const char* kFrames = "frames";

/// Names of the files in a folder: of several machines, a folder is up to date when it is opened, while single names may be remembered.
std::set<std::string> files_in(const fs::path& folder) {
  std::set<std::string> names;
  std::error_code error;
  const fs::directory_iterator begin(folder, error);
  if (error == std::errc::no_such_file_or_directory) return names;
  if (error) throw Error(ErrorKind::Io, Fault{.place = folder.string(), .key = {}, .expected = "cannot be read: " + error.message(), .found = {}, .hint = {}});
  for (const auto& entry : begin) names.insert(entry.path().filename().string());
  return names;
}

fs::path sheet_path(const fs::path& folder, const std::string& name) { return folder / (name + "_sheet.png"); }

/// The number of a frame at the upper left of its small picture, dark on bright ground and bright on dark.
void number(render::Image& image, int frame) {
  const std::string text = std::to_string(frame);
  const double height = std::max(image.height / 18.0, 7.0);
  const int right = std::min(image.width, static_cast<int>(height + render::text_width(text, height))), bottom = std::min(image.height, static_cast<int>(2.0 * height));
  double sum = 0.0;
  for (int y = 0; y < bottom; ++y) {
    const std::uint8_t* row = &image.pixels[3 * static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width)];
    for (int k = 0; k < 3 * right; ++k) sum += row[k];
  }
  constexpr double kHalf = 127.5;
  const bool bright = sum > kHalf * 3.0 * right * bottom;
  render::draw_text(image, 0.5 * height, 1.5 * height, height, text, bright ? 0.1 : 0.95);
}

}  // namespace

PictureSize picture_size(const fs::path& path) {
  std::array<std::byte, 24> head{};
  if (io::read_start_if_there(path, head) < head.size()) return {};
  const auto number = [&head](std::size_t at) {
    const auto byte = [&](std::size_t k) { return std::to_integer<std::uint32_t>(head[at + k]); };
    return static_cast<int>(byte(0) << 24U | byte(1) << 16U | byte(2) << 8U | byte(3));
  };
  return {number(16), number(20)};
}

std::string picture_fingerprint(const std::string& look, std::uint64_t state_hash) { return look + to_hex(state_hash); }

std::string look_in(const std::string& fingerprint) { return fingerprint.substr(0, kHashDigits); }

FrameLooks look_at_frames(const fs::path& folder, const std::string& name, int last) {
  FrameLooks out;
  using Look = std::pair<std::string, PictureSize>;
  std::map<Look, std::vector<int>> frames;
  std::vector<std::string> marks(static_cast<std::size_t>(last) + 1);
  const std::set<std::string> present = files_in(folder / kFrames);
  for (int frame = first_frame_of(folder); frame <= last; ++frame) {
    const fs::path path = frame_path(folder, name, frame);
    if (present.contains(path.filename().string())) {
      std::string& mark = marks[static_cast<std::size_t>(frame)] = render::png_fingerprint(path);
      frames[{look_in(mark), picture_size(path)}].push_back(frame);
    } else {
      out.absent.push_back(frame);
    }
  }
  const auto most = std::max_element(frames.begin(), frames.end(), [](const auto& a, const auto& b) {
    return a.second.size() != b.second.size() ? a.second.size() < b.second.size() : a.second.front() > b.second.front();
  });
  if (most == frames.end()) return out;
  out.look = most->first.first;
  out.most = most->second;
  Hasher shown;
  for (const int frame : out.most) {
    shown.add(static_cast<std::uint64_t>(frame));
    shown.add(std::string_view(marks[static_cast<std::size_t>(frame)]));
  }
  out.sheet = picture_fingerprint(out.look, shown.value());
  for (const auto& [look, with] : frames) {
    if (look == most->first) continue;
    out.others.insert(out.others.end(), with.begin(), with.end());
    out.sizes_differ = out.sizes_differ || look.second != most->first.second;
  }
  std::sort(out.others.begin(), out.others.end());
  return out;
}

std::string describe_looks(const FrameLooks& looks, const std::string& name) {
  const std::vector<int>& frames = looks.others.empty() ? looks.absent : looks.others;
  if (frames.empty()) return {};
  const std::string has = frames_text(frames) + " of " + name + (frames.size() == 1 ? " has " : " have ");
  if (looks.others.empty()) return has + "no picture";
  return has + "another " + (looks.sizes_differ ? "size" : "look") + " than the others";
}

std::string film_note_of(const std::string& look, int last) { return look + " of " + std::to_string(last); }

bool remove_stale_film(const fs::path& folder, const std::string& name, const std::string& look, int last) {
  const fs::path film = folder / (name + ".mp4");
  const std::optional<std::string> note = render::film_note(film);
  if (!note) return false;
  const bool current = last > 0 ? *note == film_note_of(look, last) : look_in(*note) == look;
  std::error_code ignored;
  return !current && fs::remove(film, ignored);
}

void remove_stale_sheet(const fs::path& folder, const std::string& name, const std::string& look) {
  const std::string mark = render::png_fingerprint(sheet_path(folder, name));
  std::error_code ignored;
  if (!mark.empty() && look_in(mark) != look) fs::remove(sheet_path(folder, name), ignored);
}

bool all_have_look(const fs::path& folder, const std::string& name, const std::string& look, int last, int from) {
  const std::set<std::string> present = files_in(folder / kFrames);
  for (int k = 0; k < last; ++k) {
    const fs::path path = frame_path(folder, name, (from + k) % last + 1);
    if (!present.contains(path.filename().string()) || look_in(render::png_fingerprint(path)) != look) return false;
  }
  return true;
}

fs::path write_contact_sheet(const fs::path& folder, const std::string& name, const FrameLooks& looks) {
  const std::vector<int>& present = looks.most;
  if (present.empty()) return {};
  if (render::png_fingerprint(sheet_path(folder, name)) == looks.sheet) return sheet_path(folder, name);
  const int wanted = std::min<int>(kSheetColumns * kSheetRows, static_cast<int>(present.size()));
  std::vector<render::Image> images;
  for (int k = 0; k < wanted; ++k) {
    const std::size_t index =
        wanted == 1 ? 0 : static_cast<std::size_t>(std::lround(k * (static_cast<double>(present.size()) - 1) / (wanted - 1)));
    const render::Image frame = render::read_png(frame_path(folder, name, present[index]));
    images.push_back(render::downscale(frame, std::min(kSheetImageWidth, frame.width)));
    number(images.back(), present[index]);
  }
  render::write_png(sheet_path(folder, name), render::contact_sheet(images, kSheetColumns, kSheetGap), looks.sheet);
  return sheet_path(folder, name);
}

}  // namespace supple::scenes
