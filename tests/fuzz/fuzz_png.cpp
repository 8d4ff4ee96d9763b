// A picture, as of a texture. Checksums of chunks are made right, so that what reads the content is reached. Pictures that a short file may hold but that take
// milliseconds to decode are left out; larger ones, which no file of this size can hold, are not.
#include <array>
#include <span>
#include <string_view>
#include <vector>

#include "fuzz_target.h"
#include "supple/render/image.h"

namespace {

constexpr std::size_t kSignature = 8, kHead = 8, kCheck = 4;  // of a file, and before and after the data of a chunk
constexpr std::uint64_t kMostPixels = 512, kLargestRatio = 1032;  // of pictures that are decoded; of deflate

constexpr std::array<std::uint32_t, 256> kSums = [] {
  std::array<std::uint32_t, 256> sums{};
  for (std::uint32_t byte = 0; byte < sums.size(); ++byte) {
    std::uint32_t sum = byte;
    for (int bit = 0; bit < 8; ++bit) sum = (sum >> 1U) ^ ((sum & 1U) != 0 ? 0xEDB88320U : 0U);
    sums[byte] = sum;
  }
  return sums;
}();

/// CRC-32 of PNG (ISO 3309).
std::uint32_t checksum(std::span<const std::uint8_t> bytes) {
  std::uint32_t sum = ~0U;
  for (const std::uint8_t byte : bytes) sum = (sum >> 8U) ^ kSums[(sum ^ byte) & 255U];
  return ~sum;
}

std::uint32_t number_at(std::span<const std::uint8_t> bytes, std::size_t at) {
  std::uint32_t number = 0;
  for (std::size_t k = 0; k < 4; ++k) number = number << 8U | bytes[at + k];
  return number;
}

/// Makes the checksums right, up to the last chunk that is read. @return whether the picture takes little time
bool mend(std::vector<std::uint8_t>& file) {
  bool little = true;
  for (std::size_t at = kSignature; at + kHead + kCheck <= file.size();) {
    const std::size_t length = number_at(file, at);
    if (length > file.size() - at - kHead - kCheck) break;
    const std::string_view type(reinterpret_cast<const char*>(&file[at + 4]), 4);
    if (type == "IHDR" && length >= 2 * sizeof(std::uint32_t)) {
      const std::uint64_t pixels = std::uint64_t{number_at(file, at + kHead)} * number_at(file, at + kHead + 4);
      little = pixels <= kMostPixels || pixels > kLargestRatio * file.size();
    }
    const std::uint32_t sum = checksum(std::span(file).subspan(at + 4, 4 + length));
    for (std::size_t k = 0; k < kCheck; ++k) file[at + kHead + length + k] = static_cast<std::uint8_t>(sum >> (24U - 8U * k));
    if (type == "IEND") break;
    at += kHead + length + kCheck;
  }
  return little;
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static supple::fuzz::InputFile input("fuzz.png");
  std::vector<std::uint8_t> file(data, data + size);
  if (!mend(file)) return 0;
  return supple::fuzz::used_or_refused([&] { (void)supple::render::read_png(input.with(file)); });
}
