/// @file supple/render/image.h
/// 8-bit sRGB images, PNG files, contact sheets, films.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace supple::render {

/// RGB, 3 bytes per pixel, rows from top to bottom.
struct Image {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels;  ///< shape [height][width][3]
};

/// Linear light before exposure and tone curve, for compositing; rows from top to bottom. The background is display-referred and
/// not included.
struct LinearImage {
  int width = 0;
  int height = 0;
  /// Radiance in Rec. 709 primaries, relative to that of the sky (0.93, 1.00, 1.10), times coverage; and coverage, in [0, 1].
  /// Shape [height][width][4].
  std::vector<float> rgba;
};

/// Writes a PNG (sRGB chunk, text chunks for `software` and, unless empty, `fingerprint`) by temporary file and rename.
/// @throws Error{Io}
void write_png(const std::filesystem::path& path, const Image& image, std::string_view fingerprint = {});
/// The fingerprint in a PNG of `write_png`; empty for any other file, or none. Reads its header only.
[[nodiscard]] std::string png_fingerprint(const std::filesystem::path& path);
/// Reads an 8-bit RGB or RGBA PNG (alpha dropped). @throws Error{Io}, Error{Corrupt}
[[nodiscard]] Image read_png(const std::filesystem::path& path);

/// Averages boxes of pixels down to `width` (height in proportion), in linear light. @pre 1 <= width <= image.width
[[nodiscard]] Image downscale(const Image& image, int width);
/// A grid of equally sized images, `columns` per row, with `gap` pixels of white between and around.
/// @pre !images.empty(), columns >= 1, gap >= 0
[[nodiscard]] Image contact_sheet(std::span<const Image> images, int columns, int gap);

/// Difference of two pictures, by their 8-bit sRGB values.
struct ImageDifference {
  double psnr = 0.0;   ///< 10 log10(255^2 / mean squared difference) [dB]; infinite for equal pictures
  int largest = 0;     ///< largest difference of a channel, 0 .. 255
  Image picture;       ///< absolute difference of each channel, times a gain
};
/// @pre pictures of equal size, gain > 0
[[nodiscard]] ImageDifference compare(const Image& a, const Image& b, double gain);

/// The pictures of a film: folder/stem.0001.png ..., first to last.
struct FilmSource {
  std::filesystem::path folder;
  std::string stem;
  int first = 1, last = 1;
  double frame_rate = 24.0;  ///< [1/s]
  std::string note{};        ///< comment about the pictures, stored in the film (printable, without semicolon)
};

/// Encodes pictures to an MP4 (H.264, yuv420p, bt709, faststart) by the ffmpeg program, in a temporary folder beside `film` that
/// goes with it, and renames it when ffmpeg ended well. The environment variable SUPPLE_FFMPEG names another program or its
/// path. Odd sizes are stretched to even ones. A film there that already holds the same pictures at the
/// same rate and note (stored in its comment) is kept. ffmpeg never outlives the call, also where the process is killed.
/// @param interrupt  ends ffmpeg when set by another thread or a signal; null: never
/// @throws Error{Io} when ffmpeg is absent (hint: the package to install; the frames are kept) or fails (its last line),
///   Interrupted; no new film is left then
void encode_film(const FilmSource& source, const std::filesystem::path& film, const std::atomic<int>* interrupt = nullptr);

/// The note of a film that `encode_film` made; nothing for any other file, or none. Reads its header only.
[[nodiscard]] std::optional<std::string> film_note(const std::filesystem::path& film);

/// Finds the program that `encode_film` starts. @throws Error{Io} when it is absent
void find_film_program();

}  // namespace supple::render
