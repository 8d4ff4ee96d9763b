#include "supple/core/nearest_word.h"

#include <gtest/gtest.h>

#include <array>

namespace supple {
namespace {

TEST(NearestWord, IsWithinAThirdOfTheLettersOrOne) {
  constexpr std::array<std::string_view, 4> kWords{"run", "render", "check", "info"};
  EXPECT_EQ(nearest_word("rn", kWords), "run");
  EXPECT_EQ(nearest_word("rnu", kWords), "run");        // neighbours that are swapped count once
  EXPECT_EQ(nearest_word("rendre", kWords), "render");
  EXPECT_EQ(nearest_word("cheeek", kWords), "check");   // two of six letters
  EXPECT_EQ(nearest_word("chk", kWords), "");           // two of three
  EXPECT_EQ(nearest_word("simulate", kWords), "");
  EXPECT_EQ(nearest_word("", kWords), "");
  EXPECT_EQ(nearest_word("run", {}), "");
}

}  // namespace
}  // namespace supple
