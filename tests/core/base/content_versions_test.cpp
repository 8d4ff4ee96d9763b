#include "supple/core/content_versions.h"

#include <gtest/gtest.h>

#include <limits>

namespace supple {
namespace {

std::uint64_t number(ContentVersions& versions, double value) {
  ContentWords words;
  words.add(value);
  return versions.of(words.view());
}

TEST(ContentVersions, AreEqualInTheNextFrameWhereAllBitsAre) {
  ContentVersions versions;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::uint64_t zero = number(versions, 0.0), one = number(versions, 1.0), none = number(versions, nan);
  versions.begin_frame();
  EXPECT_EQ(number(versions, 1.0), one);
  EXPECT_EQ(number(versions, 0.0), zero);
  EXPECT_EQ(number(versions, nan), none);
  EXPECT_NE(number(versions, -0.0), zero);
  EXPECT_NE(number(versions, std::nextafter(1.0, 2.0)), one);
}

TEST(ContentVersions, AreForgottenAfterAFrameWithoutThem) {
  ContentVersions versions;
  const std::uint64_t one = number(versions, 1.0);
  versions.begin_frame();
  versions.begin_frame();
  EXPECT_NE(number(versions, 1.0), one);
}

TEST(ContentVersions, DifferWithinAFrame) {
  ContentVersions versions;
  const std::uint64_t first = number(versions, 1.0), second = number(versions, 1.0);
  EXPECT_NE(first, second);
  versions.begin_frame();
  EXPECT_EQ(number(versions, 1.0), first);
  EXPECT_EQ(number(versions, 1.0), second);
}

TEST(ContentWords, KeepArraysApart) {
  ContentWords a, b;
  a.add(std::vector<double>{1.0, 2.0});
  a.add(std::vector<double>{});
  b.add(std::vector<double>{1.0});
  b.add(std::vector<double>{2.0});
  EXPECT_FALSE(std::equal(a.view().begin(), a.view().end(), b.view().begin(), b.view().end()));
}

}  // namespace
}  // namespace supple
