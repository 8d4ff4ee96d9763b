// What benchmark programs answer before they measure anything, and that all of them do.
#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "benchmarks/usage.h"
#include "support/source_dir.h"

namespace supple::benchmarks {
namespace {

/// Ends with 7 where the arguments are taken.
void call(std::vector<std::string> words) {
  words.insert(words.begin(), "program");
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  answer_usage(static_cast<int>(argv.size()), argv.data(), "program [--seed N] [--both] [FILE]", 3, {{"--seed", 1}, {"--both"}});
  std::exit(7);
}

TEST(BenchmarkUsageDeathTest, IsAnsweredBeforeAnythingElse) {
  using testing::ExitedWithCode;
  for (const char* word : {"-h", "--help"}) {
    EXPECT_EXIT(call({word}), ExitedWithCode(0), "");
    EXPECT_EXIT(call({"plot.svg", word}), ExitedWithCode(0), "");
  }
  EXPECT_EXIT(call({"--sede", "3"}), ExitedWithCode(2), "found '--sede'\nusage: program \\[--seed N\\]");
  EXPECT_EXIT(call({"-v"}), ExitedWithCode(2), "found '-v'");
  EXPECT_EXIT(call({"plot.svg", "--seed"}), ExitedWithCode(2), "expected a value after every option, found '--seed'");
  EXPECT_EXIT(call({"a", "b", "c", "d"}), ExitedWithCode(2), "expected no more arguments, found 'd'");
  for (const std::vector<std::string>& taken : {std::vector<std::string>{}, {"plot.svg"}, {"--seed", "3", "plot.svg"}, {"--both"}, {"-1"}, {"-.5"}, {"-"}}) {
    EXPECT_EXIT(call(taken), ExitedWithCode(7), "");
  }
}

TEST(BenchmarkUsageDeathTest, RefusesWhatIsNoNumberOrNoKnownWord) {
  using testing::ExitedWithCode;
  for (const char* word : {"ten", "", "0", "-5", "10x", "1.5", "1e3", "99999999999"}) {
    EXPECT_EXIT(std::exit(whole_number("program [N]", word)), ExitedWithCode(2),
                "expected a whole number >= 1, found '" + std::string(word) + "'\nusage: program \\[N\\]");
  }
  EXPECT_EXIT(std::exit(static_cast<int>(whole_number("", "abc", 0U))), ExitedWithCode(2), "expected a whole number >= 0, found 'abc'");
  EXPECT_EQ(whole_number("", "10"), 10);
  EXPECT_EQ(whole_number("", "0", 0U), 0U);
  for (const char* word : {"x", "0", "-.5", "nan", "inf", "1 m"}) {
    EXPECT_EXIT(positive_number("program [SIZE]", word), ExitedWithCode(2), "expected a number > 0, found '" + std::string(word) + '\'');
  }
  EXPECT_EQ(positive_number("", "2.5e-3"), 2.5e-3);
  constexpr std::array<std::string_view, 2> kWords{"equal", "radii"};
  EXPECT_EXIT(expect_word("program [CASE]", "spheres", kWords), ExitedWithCode(2), "expected one of equal, radii, found 'spheres'\nusage: program");
  expect_word("", "radii", kWords);
}

TEST(BenchmarkUsage, IsAskedForByEveryProgram) {
  int programs = 0;
  for (const auto& entry : std::filesystem::directory_iterator(source_dir() / "tests/benchmarks")) {
    if (entry.path().extension() != ".cpp") continue;
    std::ifstream file(entry.path());
    std::stringstream text;
    text << file.rdbuf();
    if (text.str().find("int supple::benchmarks::programs::") == std::string::npos) continue;
    ++programs;
    EXPECT_NE(text.str().find("answer_usage(argc, argv"), std::string::npos) << entry.path();
    for (const char* lenient : {"atoi(", "atof(", "strto", "stoi("}) {  // they take what is no number
      EXPECT_EQ(text.str().find(lenient), std::string::npos) << entry.path();
    }
  }
  EXPECT_GE(programs, 18);
}

}  // namespace
}  // namespace supple::benchmarks
