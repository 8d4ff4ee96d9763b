/// @file supple/core/hash.h
/// 64-bit hashes (xxh3) of states and results, and the byte streams of saved states.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "supple/core/types.h"

namespace supple {

/// Incremental hash. -0.0 counts as +0.0, so that skipping an exact zero cannot change it.
class Hasher {
 public:
  Hasher();
  ~Hasher();
  Hasher(const Hasher&) = delete;
  Hasher& operator=(const Hasher&) = delete;
  void add(double value);
  void add(std::uint64_t value);
  void add(std::string_view text);
  void add(std::span<const double> values);
  void add(std::span<const Vec3> values);
  void add(std::span<const Quat> values);
  [[nodiscard]] std::uint64_t value() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// 16 lower-case hexadecimal digits.
[[nodiscard]] std::string to_hex(std::uint64_t value);

/// Hash of raw bytes (xxh3, 64 bits).
[[nodiscard]] std::uint64_t hash_bytes(std::span<const std::byte> bytes);

/// Little-endian byte stream of a saved State. Every array is preceded by its length.
class StateWriter {
 public:
  void write(std::uint64_t value);
  void write(double value);
  void write(std::string_view text);
  void write(std::span<const double> values);
  void write(std::span<const std::uint32_t> values);
  void write(std::span<const std::uint8_t> values);
  void write(std::span<const Vec3> values);
  void write(std::span<const Quat> values);
  [[nodiscard]] const std::vector<std::byte>& bytes() const noexcept { return bytes_; }

 private:
  std::vector<std::byte> bytes_;
};

/// Reads the stream of a StateWriter, in the same order. @throws Error{Corrupt} when the stream is shorter than its lengths.
class StateReader {
 public:
  explicit StateReader(std::span<const std::byte> bytes) : bytes_(bytes) {}
  void read(std::uint64_t& value);
  void read(double& value);
  void read(std::string& text);
  void read(std::vector<double>& values);
  void read(std::vector<std::uint32_t>& values);
  void read(std::vector<std::uint8_t>& values);
  void read(std::vector<Vec3>& values);
  void read(std::vector<Quat>& values);
  [[nodiscard]] bool at_end() const noexcept { return offset_ == bytes_.size(); }

 private:
  std::span<const std::byte> bytes_;
  std::size_t offset_ = 0;
};

}  // namespace supple
