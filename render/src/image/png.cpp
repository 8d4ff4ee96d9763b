// PNG, Portable Network Graphics, third edition (W3C 2025): one IDAT chunk, 8-bit truecolour, the Sub filter.
#include <libdeflate.h>

#include <array>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string_view>

#include "supple/core/error.h"
#include "supple/core/io/atomic_file.h"
#include "supple/render/image.h"

namespace supple::render {
namespace {

using Bytes = std::vector<std::byte>;

constexpr std::array<unsigned char, 8> kSignature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
// Smooth pictures: level 6 costs twice the time for 4 to 7 per cent of the size.
constexpr int kLevel = 4;
constexpr std::string_view kFingerprint("Fingerprint\0", 12);  // the keyword of a text chunk ends with a zero
constexpr int kLargestEdge = 65536;
constexpr std::size_t kLargestFile = std::size_t{1} << 30;

void put_u32(std::byte* to, std::uint32_t value) {
  for (int i = 0; i < 4; ++i) to[i] = static_cast<std::byte>(value >> (24 - 8 * i));
}

std::uint32_t get_u32(const std::byte* from) {
  std::uint32_t value = 0;
  for (int i = 0; i < 4; ++i) value = (value << 8) | static_cast<std::uint32_t>(from[i]);
  return value;
}

/// Closes the chunk whose 8-byte header begins at `start` of `file` and whose data run to the end.
void close_chunk(Bytes& file, std::size_t start, std::string_view type) {
  put_u32(&file[start], static_cast<std::uint32_t>(file.size() - start - 8));
  std::memcpy(&file[start + 4], type.data(), 4);
  const std::uint32_t crc = libdeflate_crc32(0, &file[start + 4], file.size() - start - 4);
  file.resize(file.size() + 4);
  put_u32(&file[file.size() - 4], crc);
}

void add_chunk(Bytes& file, std::string_view type, std::span<const std::byte> data) {
  const std::size_t start = file.size();
  file.resize(start + 8);
  file.insert(file.end(), data.begin(), data.end());
  close_chunk(file, start, type);
}

void add_pixels(Bytes& file, const Image& image) {
  const std::size_t row = 3 * static_cast<std::size_t>(image.width);
  std::vector<std::uint8_t> filtered((row + 1) * static_cast<std::size_t>(image.height));
  for (std::size_t y = 0; y < static_cast<std::size_t>(image.height); ++y) {
    std::uint8_t* to = &filtered[y * (row + 1)];
    const std::uint8_t* from = &image.pixels[y * row];
    *to++ = 1;
    std::memcpy(to, from, 3);
    for (std::size_t x = 3; x < row; ++x) to[x] = static_cast<std::uint8_t>(from[x] - from[x - 3]);
  }
  const std::unique_ptr<libdeflate_compressor, decltype(&libdeflate_free_compressor)> compressor(
      libdeflate_alloc_compressor(kLevel), libdeflate_free_compressor);
  if (compressor == nullptr) throw std::bad_alloc();
  const std::size_t start = file.size();
  file.resize(start + 8 + libdeflate_zlib_compress_bound(compressor.get(), filtered.size()));
  const std::size_t used = libdeflate_zlib_compress(compressor.get(), filtered.data(), filtered.size(),
                                                    &file[start + 8], file.size() - start - 8);
  SUPPLE_EXPECTS(used > 0);
  file.resize(start + 8 + used);
  close_chunk(file, start, "IDAT");
}

[[noreturn]] void corrupt(const std::filesystem::path& path, const std::string& expected, const std::string& found) {
  throw Error(ErrorKind::Corrupt,
              Fault{.place = path.string(), .key = {}, .expected = expected, .found = found, .hint = {}});
}

struct Header {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::size_t channels = 0;
};

Header read_header(const std::filesystem::path& path, std::span<const std::byte> data) {
  if (data.size() != 13) corrupt(path, "expected a 13 byte IHDR chunk", std::to_string(data.size()) + " bytes");
  const auto field = [&](std::size_t i) { return static_cast<int>(data[i]); };
  Header header{.width = get_u32(&data[0]), .height = get_u32(&data[4]), .channels = 0};
  if (header.width < 1 || header.height < 1 || header.width > kLargestEdge || header.height > kLargestEdge)
    corrupt(path, "expected a size of 1 to " + std::to_string(kLargestEdge) + " pixels",
            std::to_string(header.width) + " x " + std::to_string(header.height));
  if (field(8) == 8 && field(9) == 2) header.channels = 3;
  if (field(8) == 8 && field(9) == 6) header.channels = 4;
  if (header.channels == 0 || field(10) != 0 || field(11) != 0 || field(12) != 0)
    corrupt(path, "expected 8-bit RGB or RGBA without interlacing",
            std::to_string(field(8)) + " bits, colour type " + std::to_string(field(9)) + ", interlace " +
                std::to_string(field(12)));
  return header;
}

int paeth(int left, int above, int corner) {
  const int estimate = left + above - corner;
  const int to_left = std::abs(estimate - left);
  const int to_above = std::abs(estimate - above);
  const int to_corner = std::abs(estimate - corner);
  if (to_left <= to_above && to_left <= to_corner) return left;
  return to_above <= to_corner ? above : corner;
}

/// Undoes the filter of one row in place; `above` is null for the first row. False for an unknown filter.
bool unfilter(int filter, std::uint8_t* row, const std::uint8_t* above, std::size_t size, std::size_t channels) {
  if (filter > 4) return false;
  for (std::size_t i = 0; i < size; ++i) {
    const int a = i < channels ? 0 : row[i - channels];
    const int b = above == nullptr ? 0 : above[i];
    const int c = above == nullptr || i < channels ? 0 : above[i - channels];
    const std::array<int, 5> prediction = {0, a, b, (a + b) / 2, paeth(a, b, c)};
    row[i] = static_cast<std::uint8_t>(row[i] + prediction[static_cast<std::size_t>(filter)]);
  }
  return true;
}

Image decode(const std::filesystem::path& path, const Header& header, const Bytes& packed) {
  const std::size_t row = header.channels * header.width;
  // 1032 is the largest ratio deflate can reach; a header that promises more cannot be true.
  const std::size_t size = (row + 1) * header.height;
  if (size / 1032 > packed.size())
    corrupt(path, "expected " + std::to_string(size) + " bytes of pixels", "a file too short to hold them");
  std::vector<std::uint8_t> data(size);
  const std::unique_ptr<libdeflate_decompressor, decltype(&libdeflate_free_decompressor)> decompressor(
      libdeflate_alloc_decompressor(), libdeflate_free_decompressor);
  if (decompressor == nullptr) throw std::bad_alloc();
  std::size_t actual = 0;
  const libdeflate_result result = libdeflate_zlib_decompress(decompressor.get(), packed.data(), packed.size(),
                                                              data.data(), data.size(), &actual);
  if (result != LIBDEFLATE_SUCCESS || actual != size)
    corrupt(path, "expected " + std::to_string(size) + " bytes of pixels", "a damaged stream");

  Image image{.width = static_cast<int>(header.width), .height = static_cast<int>(header.height), .pixels = {}};
  image.pixels.resize(std::size_t{3} * header.width * header.height);
  std::uint8_t* out = image.pixels.data();
  for (std::size_t y = 0; y < header.height; ++y) {
    std::uint8_t* line = &data[y * (row + 1)];
    const std::uint8_t* above = y == 0 ? nullptr : line - row;
    if (!unfilter(line[0], line + 1, above, row, header.channels))
      corrupt(path, "expected a row filter of 0 to 4", std::to_string(line[0]));
    for (std::size_t x = 0; x < header.width; ++x)
      for (std::size_t c = 0; c < 3; ++c) *out++ = line[1 + x * header.channels + c];
  }
  return image;
}

}  // namespace

void write_png(const std::filesystem::path& path, const Image& image, std::string_view fingerprint) {
  SUPPLE_EXPECTS(image.width > 0 && image.height > 0);
  SUPPLE_EXPECTS(image.pixels.size() ==
                 3 * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
  Bytes file;
  for (const unsigned char byte : kSignature) file.push_back(static_cast<std::byte>(byte));

  std::array<std::byte, 13> header{};
  put_u32(&header[0], static_cast<std::uint32_t>(image.width));
  put_u32(&header[4], static_cast<std::uint32_t>(image.height));
  header[8] = std::byte{8};
  header[9] = std::byte{2};
  add_chunk(file, "IHDR", header);
  add_chunk(file, "sRGB", std::array<std::byte, 1>{});  // perceptual intent
  constexpr std::string_view text("Software\0supple", 15);
  add_chunk(file, "tEXt", std::as_bytes(std::span(text)));
  if (!fingerprint.empty()) {
    const std::string entry = std::string(kFingerprint) + std::string(fingerprint);
    add_chunk(file, "tEXt", std::as_bytes(std::span<const char>(entry)));
  }
  add_pixels(file, image);
  add_chunk(file, "IEND", {});
  io::write_atomically(path, file);
}

std::string png_fingerprint(const std::filesystem::path& path) {
  constexpr std::size_t kHead = 1024;  // our chunks before the pixels are far shorter
  std::array<std::byte, kHead> head{};
  const std::string_view text(reinterpret_cast<const char*>(head.data()), io::read_start_if_there(path, head));
  if (text.size() < kSignature.size() || std::memcmp(text.data(), kSignature.data(), kSignature.size()) != 0) return {};
  for (std::size_t at = kSignature.size(); at + 8 <= text.size();) {
    const std::size_t length = get_u32(reinterpret_cast<const std::byte*>(text.data() + at));
    const std::string_view type = text.substr(at + 4, 4);
    if (type == "IDAT" || length > text.size() - at - 8) return {};
    const std::string_view data = text.substr(at + 8, length);
    if (type == "tEXt" && data.starts_with(kFingerprint)) return std::string(data.substr(kFingerprint.size()));
    at += 12 + length;
  }
  return {};
}

Image read_png(const std::filesystem::path& path) {
  const Bytes file = io::read_file(path, kLargestFile);
  if (file.size() < kSignature.size() || std::memcmp(file.data(), kSignature.data(), kSignature.size()) != 0)
    corrupt(path, "expected a PNG file", "another signature");

  Header header;
  Bytes packed;
  for (std::size_t at = kSignature.size();;) {
    if (file.size() - at < 12) corrupt(path, "expected an IEND chunk", "the end of the file");
    const std::size_t length = get_u32(&file[at]);
    if (length > file.size() - at - 12) corrupt(path, "expected a whole chunk", "the end of the file");
    const std::string_view type(reinterpret_cast<const char*>(&file[at + 4]), 4);
    const std::span<const std::byte> data(&file[at + 8], length);
    if (libdeflate_crc32(0, &file[at + 4], length + 4) != get_u32(&file[at + 8 + length]))
      corrupt(path, "expected the checksum of its content in each chunk", "another one");
    if (type == "IHDR") header = read_header(path, data);
    if (type == "IDAT") packed.insert(packed.end(), data.begin(), data.end());
    if (type == "IEND") break;
    at += 12 + length;
  }
  if (header.channels == 0) corrupt(path, "expected an IHDR chunk", "none");
  return decode(path, header, packed);
}

}  // namespace supple::render
