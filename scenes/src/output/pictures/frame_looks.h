/// @file frame_looks.h
/// The look of the frames of a run: a film and a contact sheet show frames of a single look. The look is everything besides the state
/// that a picture depends on: the scene's keys for pictures, the context and the build of the program.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace supple::scenes {

/// Width and height of a PNG, from its header; zeros for another file.
using PictureSize = std::pair<int, int>;
[[nodiscard]] PictureSize picture_size(const std::filesystem::path& path);

/// Fingerprint of a picture; look_in gives the look that it begins with.
[[nodiscard]] std::string picture_fingerprint(const std::string& look, std::uint64_t state_hash);
[[nodiscard]] std::string look_in(const std::string& fingerprint);

/// Frames by the look of their PNGs, from the first one of the run (1, unless it is a variation) to the last, ascending.
struct FrameLooks {
  std::string look;          ///< the most frequent one; among equals that of the first frame
  std::vector<int> most;     ///< with this look
  std::vector<int> others;   ///< with another one
  std::vector<int> absent;   ///< without a picture
  std::string sheet;         ///< mark of a contact sheet of `most`: it begins with the look
  bool sizes_differ = false;
};
[[nodiscard]] FrameLooks look_at_frames(const std::filesystem::path& folder, const std::string& name, int last);

/// "frame 8 of k has another look than the others"; empty where all are there in one look.
[[nodiscard]] std::string describe_looks(const FrameLooks& looks, const std::string& name);

/// The comment in a film file of frames 1 .. last with this look.
[[nodiscard]] std::string film_note_of(const std::string& look, int last);
/// Removes NAME.mp4 if a run made it from other frames or with another look.
/// @param last  0: any number of frames   @return whether there was such a film
bool remove_stale_film(const std::filesystem::path& folder, const std::string& name, const std::string& look, int last);
/// Removes NAME_sheet.png if a run made it with another look.
void remove_stale_sheet(const std::filesystem::path& folder, const std::string& name, const std::string& look);

/// Whether frames 1 .. last all have a PNG with this look. Frames after `from` are looked at first, those up to it at last.
[[nodiscard]] bool all_have_look(const std::filesystem::path& folder, const std::string& name, const std::string& look, int last, int from);

/// NAME_sheet.png: twelve frames spread over those with the most frequent look, 3 rows of 4, each with its number. Empty when there are none. A sheet of the same
/// pictures stays.
std::filesystem::path write_contact_sheet(const std::filesystem::path& folder, const std::string& name, const FrameLooks& looks);

}  // namespace supple::scenes
