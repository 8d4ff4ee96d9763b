#include "supple/core/hash.h"

#include <gtest/gtest.h>

#include "supple/core/error.h"
#include "supple/core/particles.h"

namespace {

using namespace supple;

std::uint64_t hash_of(const auto& value) {
  Hasher hasher;
  hasher.add(value);
  return hasher.value();
}

TEST(Hashes, OfBytesAreXxh3) {
  EXPECT_EQ(to_hex(hash_bytes({})), "2d06800538d394c2");  // the published XXH3_64bits of nothing
  EXPECT_EQ(to_hex(255), "00000000000000ff");
}

TEST(Hashes, CountMinusZeroAsZero) {
  EXPECT_EQ(hash_of(-0.0), hash_of(0.0));
  const std::vector<Vec3> plus(200, Vec3(0.0, 1.0, 2.0)), minus(200, Vec3(-0.0, 1.0, 2.0));
  EXPECT_EQ(hash_of(std::span<const Vec3>(plus)), hash_of(std::span<const Vec3>(minus)));
}

TEST(Hashes, SeeEveryNumberAndTheLengths) {
  std::vector<double> values(1000, 1.0);
  const std::uint64_t before = hash_of(std::span<const double>(values));
  for (const std::size_t i : {0U, 127U, 128U, 999U}) {
    std::vector<double> changed = values;
    changed[i] = std::nextafter(1.0, 2.0);
    EXPECT_NE(hash_of(std::span<const double>(changed)), before) << i;
  }
  Hasher split, joined;
  split.add(std::string_view("ab"));
  split.add(std::string_view("c"));
  joined.add(std::string_view("a"));
  joined.add(std::string_view("bc"));
  EXPECT_NE(split.value(), joined.value());
}

TEST(SavedStates, ReadBackAsWritten) {
  StateWriter out;
  out.write(std::uint64_t{7});
  out.write(-0.5);
  out.write(std::string_view("name"));
  out.write(std::span<const double>(std::vector<double>{1.0, 2.0}));
  out.write(std::span<const std::uint32_t>(std::vector<std::uint32_t>{3, 4, 5}));
  out.write(std::span<const std::uint8_t>(std::vector<std::uint8_t>{6}));
  out.write(std::span<const Vec3>(std::vector<Vec3>{Vec3(1, 2, 3)}));
  out.write(std::span<const Quat>(std::vector<Quat>{Quat(1, 2, 3, 4)}));
  StateReader in(out.bytes());
  std::uint64_t count = 0;
  double number = 0.0;
  std::string text;
  std::vector<double> numbers;
  std::vector<std::uint32_t> indices;
  std::vector<std::uint8_t> flags;
  std::vector<Vec3> vectors;
  std::vector<Quat> rotations;
  in.read(count);
  in.read(number);
  in.read(text);
  in.read(numbers);
  in.read(indices);
  in.read(flags);
  in.read(vectors);
  in.read(rotations);
  EXPECT_TRUE(in.at_end());
  EXPECT_EQ(count, 7U);
  EXPECT_EQ(number, -0.5);
  EXPECT_EQ(text, "name");
  EXPECT_EQ(numbers, (std::vector<double>{1.0, 2.0}));
  EXPECT_EQ(indices, (std::vector<std::uint32_t>{3, 4, 5}));
  EXPECT_EQ(flags, (std::vector<std::uint8_t>{6}));
  EXPECT_EQ(vectors.at(0), Vec3(1, 2, 3));
  EXPECT_EQ(rotations.at(0).coeffs(), Quat(1, 2, 3, 4).coeffs());
}

TEST(SavedStates, ThatAreCutOrDamagedAreRefused) {
  StateWriter out;
  out.write(std::span<const double>(std::vector<double>{1.0, 2.0}));
  std::vector<double> values;
  for (std::size_t length = 0; length < out.bytes().size(); ++length) {
    StateReader in(std::span(out.bytes()).first(length));
    try {
      in.read(values);
      FAIL() << length;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Corrupt);
    }
  }
  std::vector<std::byte> huge = out.bytes();
  huge[7] = std::byte{0x7f};
  StateReader in(huge);
  EXPECT_THROW(in.read(values), Error);
}

TEST(ParticleStates, RefuseArraysOfDifferentLengths) {
  core::ParticleState state;
  state.resize(3);
  state.velocity.pop_back();
  StateWriter out;
  state.save(out);
  core::ParticleState loaded;
  StateReader in(out.bytes());
  EXPECT_THROW(loaded.load(in), Error);
}

}  // namespace
