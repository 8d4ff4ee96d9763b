#include "supple/core/hash.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <algorithm>
#include <bit>
#include <cstring>

#include "supple/core/error.h"

namespace supple {

static_assert(std::endian::native == std::endian::little, "saved states are little-endian");
static_assert(sizeof(Vec3) == 3 * sizeof(double) && sizeof(Quat) == 4 * sizeof(double));

struct Hasher::Impl {
  XXH3_state_t state;
};

Hasher::Hasher() : impl_(std::make_unique<Impl>()) { XXH3_64bits_reset(&impl_->state); }
Hasher::~Hasher() = default;

void Hasher::add(double value) {
  value += 0.0;  // -0 + 0 is +0
  XXH3_64bits_update(&impl_->state, &value, sizeof value);
}

void Hasher::add(std::uint64_t value) { XXH3_64bits_update(&impl_->state, &value, sizeof value); }

void Hasher::add(std::string_view text) {
  add(static_cast<std::uint64_t>(text.size()));
  XXH3_64bits_update(&impl_->state, text.data(), text.size());
}

void Hasher::add(std::span<const double> values) {
  add(static_cast<std::uint64_t>(values.size()));
  std::array<double, 128> buffer;
  while (!values.empty()) {
    const std::size_t count = std::min(values.size(), buffer.size());
    for (std::size_t i = 0; i < count; ++i) buffer[i] = values[i] + 0.0;
    XXH3_64bits_update(&impl_->state, buffer.data(), count * sizeof(double));
    values = values.subspan(count);
  }
}

void Hasher::add(std::span<const Vec3> values) {
  add(values.empty() ? std::span<const double>{} : std::span<const double>(values.front().data(), 3 * values.size()));
}

void Hasher::add(std::span<const Quat> values) {
  add(values.empty() ? std::span<const double>{}
                     : std::span<const double>(values.front().coeffs().data(), 4 * values.size()));
}

std::uint64_t Hasher::value() const { return XXH3_64bits_digest(&impl_->state); }

std::string to_hex(std::uint64_t value) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text(16, '0');
  for (std::size_t i = 16; i-- > 0; value >>= 4) text[i] = kDigits[value & 15U];
  return text;
}

std::uint64_t hash_bytes(std::span<const std::byte> bytes) { return XXH3_64bits(bytes.data(), bytes.size()); }

namespace {

void append(std::vector<std::byte>& bytes, const void* data, std::size_t size) {
  if (size == 0) return;
  const std::size_t offset = bytes.size();
  bytes.resize(offset + size);
  std::memcpy(bytes.data() + offset, data, size);
}

template <class T>
void append_array(std::vector<std::byte>& bytes, std::span<const T> values) {
  const std::uint64_t count = values.size();
  append(bytes, &count, sizeof count);
  append(bytes, values.data(), values.size_bytes());
}

void extract(std::span<const std::byte> bytes, std::size_t& offset, void* data, std::size_t size) {
  if (bytes.size() - offset < size) {
    throw Error(ErrorKind::Corrupt, Fault{.place = {},
                                          .key = {},
                                          .expected = "expected " + std::to_string(size) + " more bytes of saved state",
                                          .found = std::to_string(bytes.size() - offset),
                                          .hint = {}});
  }
  if (size == 0) return;
  std::memcpy(data, bytes.data() + offset, size);
  offset += size;
}

template <class Array>
void extract_array(std::span<const std::byte> bytes, std::size_t& offset, Array& values) {
  using T = typename Array::value_type;
  std::uint64_t count = 0;
  extract(bytes, offset, &count, sizeof count);
  // Checked before the allocation: a damaged count must not allocate all memory.
  if (count > (bytes.size() - offset) / sizeof(T)) {
    throw Error(ErrorKind::Corrupt,
                Fault{.place = {},
                      .key = {},
                      .expected = "expected an array that fits the saved state",
                      .found = std::to_string(count) + " elements in " + std::to_string(bytes.size() - offset) +
                               " bytes",
                      .hint = {}});
  }
  values.resize(count);
  extract(bytes, offset, static_cast<void*>(values.data()), count * sizeof(T));
}

}  // namespace

void StateWriter::write(std::uint64_t value) { append(bytes_, &value, sizeof value); }
void StateWriter::write(double value) { append(bytes_, &value, sizeof value); }
void StateWriter::write(std::string_view text) { append_array(bytes_, std::span<const char>(text)); }
void StateWriter::write(std::span<const double> values) { append_array(bytes_, values); }
void StateWriter::write(std::span<const std::uint32_t> values) { append_array(bytes_, values); }
void StateWriter::write(std::span<const std::uint8_t> values) { append_array(bytes_, values); }
void StateWriter::write(std::span<const Vec3> values) { append_array(bytes_, values); }
void StateWriter::write(std::span<const Quat> values) { append_array(bytes_, values); }

void StateReader::read(std::uint64_t& value) { extract(bytes_, offset_, &value, sizeof value); }
void StateReader::read(double& value) { extract(bytes_, offset_, &value, sizeof value); }
void StateReader::read(std::string& text) { extract_array(bytes_, offset_, text); }
void StateReader::read(std::vector<double>& values) { extract_array(bytes_, offset_, values); }
void StateReader::read(std::vector<std::uint32_t>& values) { extract_array(bytes_, offset_, values); }
void StateReader::read(std::vector<std::uint8_t>& values) { extract_array(bytes_, offset_, values); }
void StateReader::read(std::vector<Vec3>& values) { extract_array(bytes_, offset_, values); }
void StateReader::read(std::vector<Quat>& values) { extract_array(bytes_, offset_, values); }

}  // namespace supple
