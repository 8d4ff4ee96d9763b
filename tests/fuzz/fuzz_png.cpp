// A picture, as of a texture. Checksums of chunks are made right, so that what reads the content is reached.
#include <span>
#include <vector>

#include "fuzz_target.h"
#include "supple/render/image.h"

namespace {

constexpr std::size_t kSignature = 8, kHead = 8, kCheck = 4;  // of a file, and before and after the data of a chunk

/// CRC-32 of PNG (ISO 3309).
std::uint32_t checksum(std::span<const std::uint8_t> bytes) {
  std::uint32_t sum = ~0U;
  for (const std::uint8_t byte : bytes) {
    sum ^= byte;
    for (int bit = 0; bit < 8; ++bit) sum = (sum >> 1U) ^ ((sum & 1U) != 0 ? 0xEDB88320U : 0U);
  }
  return ~sum;
}

void mend(std::vector<std::uint8_t>& file) {
  for (std::size_t at = kSignature; at + kHead + kCheck <= file.size();) {
    std::size_t length = 0;
    for (std::size_t k = 0; k < 4; ++k) length = length << 8U | file[at + k];
    if (length > file.size() - at - kHead - kCheck) return;
    const std::uint32_t sum = checksum(std::span(file).subspan(at + 4, 4 + length));
    for (std::size_t k = 0; k < kCheck; ++k) file[at + kHead + length + k] = static_cast<std::uint8_t>(sum >> (24U - 8U * k));
    at += kHead + length + kCheck;
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::vector<std::uint8_t> file(data, data + size);
  mend(file);
  return supple::fuzz::used_or_refused([&] { (void)supple::render::read_png(supple::fuzz::as_file("fuzz.png", file)); });
}
