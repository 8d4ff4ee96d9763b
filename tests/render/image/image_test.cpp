#include "supple/render/image.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <iterator>

#include "image/srgb.h"
#include "render/support.h"

namespace supple::render::test {
namespace {

/// Every byte from a hash of its index, so that no filter or repetition hides a misplaced one.
Image noise(int width, int height) {
  Image image{.width = width, .height = height, .pixels = {}};
  image.pixels.resize(std::size_t{3} * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  std::uint32_t state = 7;
  for (std::uint8_t& byte : image.pixels) {
    state = state * 1664525U + 1013904223U;
    byte = static_cast<std::uint8_t>(state >> 24);
  }
  return image;
}

Image plain(int width, int height, std::array<std::uint8_t, 3> colour) {
  Image image{.width = width, .height = height, .pixels = {}};
  for (int i = 0; i < width * height; ++i)
    for (const std::uint8_t channel : colour) image.pixels.push_back(channel);
  return image;
}

std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

void write_bytes(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

TEST(Png, ReadsBackWhatWasWritten) {
  const Folder folder;
  for (const auto& [width, height] : {std::pair{1, 1}, std::pair{5, 3}, std::pair{257, 64}}) {
    const Image image = noise(width, height);
    write_png(folder / "a.png", image);
    const Image back = read_png(folder / "a.png");
    EXPECT_EQ(back.width, width);
    EXPECT_EQ(back.height, height);
    EXPECT_EQ(back.pixels, image.pixels);
  }
  EXPECT_EQ(folder.file_count(), 1U);
}

TEST(Png, HoldsItsColourSpaceAndItsMaker) {
  const Folder folder;
  write_png(folder / "a.png", noise(4, 4));
  const std::string bytes = bytes_of(folder / "a.png");
  EXPECT_NE(bytes.find("sRGB"), std::string::npos);
  EXPECT_NE(bytes.find(std::string("Software\0supple", 15)), std::string::npos);
}

// 2 x 4 RGBA rows filtered by Sub, Up, Average and Paeth, made by hand from the definitions of the PNG standard
// (section 9.2) and packed in a stored deflate block (RFC 1950, RFC 1951).
TEST(Png, ReadsEveryRowFilterAndDropsAlpha) {
  const Folder folder;
  std::string raw;
  const auto row = [&raw](std::initializer_list<int> bytes) {
    for (const int byte : bytes) raw.push_back(static_cast<char>(byte));
  };
  row({1, 10, 20, 30, 255, 5, 5, 5, 0});      // Sub: 10 20 30 | 15 25 35
  row({2, 1, 1, 1, 0, 2, 2, 2, 0});           // Up: 11 21 31 | 17 27 37
  row({3, 15, 10, 10, 0, 248, 10, 10, 0});    // Average: 15 + 11/2 .. = 20 20 25 | 248 + (20 + 17)/2 .. = 10 33 41
  row({4, 20, 1, 1, 0, 250, 250, 250, 0});    // Paeth: 40 21 26 | 34 27 35; red ties left and corner: left wins
  std::uint32_t a = 1;
  std::uint32_t b = 0;
  for (const char c : raw) {
    a = (a + static_cast<unsigned char>(c)) % 65521;
    b = (b + a) % 65521;
  }
  const auto u32 = [](std::uint32_t v) {
    std::string text;
    for (int i = 3; i >= 0; --i) text.push_back(static_cast<char>(v >> (8 * i)));
    return text;
  };
  const auto crc = [](const std::string& text) {
    std::uint32_t value = ~0U;
    for (const char c : text) {
      value ^= static_cast<unsigned char>(c);
      for (int k = 0; k < 8; ++k) value = (value >> 1) ^ (0xedb88320U & (0U - (value & 1U)));
    }
    return ~value;
  };
  const auto chunk = [&](const std::string& type, const std::string& data) {
    return u32(static_cast<std::uint32_t>(data.size())) + type + data + u32(crc(type + data));
  };
  const auto length = static_cast<std::uint16_t>(raw.size());
  std::string packed = {'\x78', '\x01', '\x01', static_cast<char>(length & 255), static_cast<char>(length >> 8),
                        static_cast<char>(~length & 255), static_cast<char>((~length >> 8) & 255)};
  packed += raw + u32((b << 16) | a);
  const std::string header = u32(2) + u32(4) + std::string("\x08\x06\x00\x00\x00", 5);
  write_bytes(folder / "a.png", std::string("\x89PNG\r\n\x1a\n", 8) + chunk("IHDR", header) + chunk("IDAT", packed) +
                                    chunk("IEND", ""));
  const Image image = read_png(folder / "a.png");
  const std::vector<std::uint8_t> expected = {10, 20, 30, 15, 25, 35, 11, 21, 31, 17, 27, 37,
                                              20, 20, 25, 10, 33, 41, 40, 21, 26, 34, 27, 35};
  EXPECT_EQ(image.pixels, expected);
}

TEST(Png, RefusesDamagedFiles) {
  const Folder folder;
  write_png(folder / "a.png", noise(16, 16));
  const std::string good = bytes_of(folder / "a.png");
  const auto expect_corrupt = [&](const std::string& bytes) {
    write_bytes(folder / "b.png", bytes);
    expect_error(ErrorKind::Corrupt, {"b.png"}, [&] { static_cast<void>(read_png(folder / "b.png")); });
  };
  for (const std::size_t size : {0UL, 7UL, 8UL, 20UL, good.size() / 2, good.size() - 1})
    expect_corrupt(good.substr(0, size));
  // Each byte is covered by the signature, a length or a checksum.
  for (std::size_t i = 0; i < good.size(); i += 13) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ 0x20);
    expect_corrupt(bad);
  }
}

TEST(Png, NamesTheFileThatCannotBeReadOrWritten) {
  const Folder folder;
  expect_error(ErrorKind::Io, {"absent.png"}, [&] { static_cast<void>(read_png(folder / "absent.png")); });
  expect_error(ErrorKind::Io, {"no/such"}, [&] { write_png(folder / "no/such/a.png", noise(2, 2)); });
}

TEST(Srgb, IsTheNearestToTheCurve) {
  const auto curve = [](double v) { return v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1.0 / 2.4) - 0.055; };
  constexpr int kSteps = 100003;  // prime: no step of the table falls on one of these
  for (int i = -5; i <= kSteps + 5; ++i) {
    const double light = static_cast<double>(i) / kSteps;
    const double exact = 255.0 * curve(std::clamp(light, 0.0, 1.0));
    EXPECT_NEAR(srgb_of_linear(light), exact, 0.5 + 1e-4) << light;  // the two parts of the curve meet to 4e-7 of 1
  }
  for (int value = 0; value < 256; ++value) EXPECT_EQ(srgb_of_linear(linear_of_srgb()[static_cast<std::size_t>(value)]), value);
}

TEST(Srgb, OfManyNumbersIsThatOfEach) {
  std::vector<float> light = {-1.0F, 0.0F, 1.0F, 2.0F};
  for (int value = 1; value < 256; ++value) {
    // The steps, between neighbouring numbers.
    float below = 0.0F, above = 1.0F;
    for (float middle = 0.5F; middle > below && middle < above; middle = 0.5F * (below + above))
      (srgb_of_linear(static_cast<double>(middle)) < value ? below : above) = middle;
    light.insert(light.end(), {below, above});
  }
  std::vector<std::uint8_t> values(light.size());
  srgb_of_linear(light, values);
  for (std::size_t i = 0; i < light.size(); ++i) EXPECT_EQ(values[i], srgb_of_linear(static_cast<double>(light[i]))) << light[i];
}

TEST(Downscale, AveragesInLinearLight) {
  Image image = plain(2, 2, {0, 0, 0});
  for (const std::size_t i : {0UL, 1UL, 2UL, 9UL, 10UL, 11UL}) image.pixels[i] = 255;
  // Half of white is .5 in linear light: 1.055 .5^(1/2.4) - .055 = .7354, and 255 times that is 187.5.
  const Image small = downscale(image, 1);
  ASSERT_EQ(small.pixels.size(), 3U);
  for (const std::uint8_t channel : small.pixels) EXPECT_EQ(channel, 188);
}

TEST(Downscale, KeepsAPlainColourAtEveryWidth) {
  const Image image = plain(31, 17, {200, 90, 10});
  for (int width = 1; width <= 31; ++width) {
    const Image small = downscale(image, width);
    EXPECT_EQ(small.width, width);
    EXPECT_EQ(small.height, std::max(1L, std::lround(17.0 * width / 31.0)));
    EXPECT_EQ(small.pixels, plain(small.width, small.height, {200, 90, 10}).pixels);
  }
  EXPECT_EQ(downscale(noise(9, 5), 9).pixels, noise(9, 5).pixels);
}

TEST(ContactSheet, PlacesImagesRowByRow) {
  const std::array images = {plain(3, 2, {10, 0, 0}), plain(3, 2, {20, 0, 0}), plain(3, 2, {30, 0, 0})};
  const Image sheet = contact_sheet(images, 2, 1);
  EXPECT_EQ(sheet.width, 1 + 2 * (3 + 1));
  EXPECT_EQ(sheet.height, 1 + 2 * (2 + 1));
  EXPECT_EQ(pixel(sheet, 1, 1)[0], 10);
  EXPECT_EQ(pixel(sheet, 3, 2)[0], 10);
  EXPECT_EQ(pixel(sheet, 4, 1)[0], 255);
  EXPECT_EQ(pixel(sheet, 5, 1)[0], 20);
  EXPECT_EQ(pixel(sheet, 1, 4)[0], 30);
  EXPECT_EQ(pixel(sheet, 5, 4)[0], 255);
  EXPECT_EQ(contact_sheet(images, 5, 0).width, 9);
  EXPECT_THROW(static_cast<void>(contact_sheet({}, 2, 1)), ContractViolation);
}

TEST(Png, CarriesAFingerprintThatItsHeadShows) {
  const Folder folder;
  write_png(folder / "a.png", noise(40, 30), "0123abcd");
  EXPECT_EQ(png_fingerprint(folder / "a.png"), "0123abcd");
  EXPECT_EQ(read_png(folder / "a.png").pixels, noise(40, 30).pixels);
  write_png(folder / "b.png", noise(40, 30));
  EXPECT_EQ(png_fingerprint(folder / "b.png"), "");
  EXPECT_EQ(png_fingerprint(folder / "none.png"), "");
}

TEST(Compare, GoesByTheValuesOfTheChannels) {
  Image a{.width = 2, .height = 1, .pixels = {10, 20, 30, 40, 50, 60}}, b = a;
  EXPECT_EQ(compare(a, b, 8.0).largest, 0);
  EXPECT_TRUE(std::isinf(compare(a, b, 8.0).psnr));
  b.pixels[1] = 23;
  b.pixels[5] = 20;
  const ImageDifference difference = compare(a, b, 8.0);
  EXPECT_EQ(difference.largest, 40);
  EXPECT_NEAR(difference.psnr, 10.0 * std::log10(255.0 * 255.0 * 6.0 / (9.0 + 1600.0)), 1e-12);
  EXPECT_EQ(difference.picture.pixels, (std::vector<std::uint8_t>{0, 24, 0, 0, 0, 255}));
}

}  // namespace
}  // namespace supple::render::test
