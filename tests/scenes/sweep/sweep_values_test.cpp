#include "sweep/sweep_values.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "supple/core/error.h"

namespace supple::scenes {
namespace {

using Texts = std::vector<std::string>;
using Kind = SweepValues::Kind;

Texts list_of(const std::string& setting) {
  const SweepValues values = read_sweep_values(setting);
  EXPECT_EQ(values.kind, Kind::List) << setting;
  return values.list;
}

std::string message_of(const std::string& setting) {
  try {
    (void)read_sweep_values(setting);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Usage);
    return error.what();
  }
  return "no error";
}

TEST(SweepValues, AreStepsOrRatiosBetweenTwoNumbers) {
  EXPECT_EQ(list_of("a.b=0:0.5:6"), (Texts{"0", "0.1", "0.2", "0.3", "0.4", "0.5"}));
  EXPECT_EQ(list_of("a.b=1e3:1e6:log4"), (Texts{"1000", "10000", "100000", "1000000"}));
  EXPECT_EQ(list_of("a.b=1:-1:3"), (Texts{"1", "0", "-1"}));
  EXPECT_EQ(list_of("a.b= 4 : 1 : log3 "), (Texts{"4", "2", "1"}));
  EXPECT_EQ(read_sweep_values("a.b=0:1:2").key, "a.b");
}

TEST(SweepValues, KeepTheUnitOfTheFirstEnd) {
  EXPECT_EQ(list_of("r=1 cm:5 cm:3"), (Texts{"1 cm", "3 cm", "5 cm"}));
  EXPECT_EQ(list_of("r=1 cm:50 mm:3"), (Texts{"1 cm", "3 cm", "5 cm"}));
  EXPECT_EQ(list_of("p=1kPa:100 kPa:log3"), (Texts{"1 kPa", "10 kPa", "100 kPa"}));
}

TEST(SweepValues, AreListsOfAnything) {
  EXPECT_EQ(list_of("v=[1, 5 cm, auto, \"a: b\", [0, 0, -1], {x: 1, y: [2, 3]}, null]"),
            (Texts{"1", "5 cm", "auto", "\"a: b\"", "[0, 0, -1]", "{\"x\": 1, \"y\": [2, 3]}", "null"}));
}

TEST(SweepValues, AreOneValueForAllPointsOtherwise) {
  for (const std::string text : {"3", "5 cm", "auto", "true", "{x: 1}", "name:with:colons", "\"1:2\"", ""}) {
    const SweepValues values = read_sweep_values("k=" + text);
    EXPECT_EQ(values.kind, Kind::Fixed) << text;
    EXPECT_EQ(values.list, Texts{text});
  }
}

TEST(SweepValues, AreDrawnFromRangesAndLists) {
  const SweepValues linear = read_sweep_values("k=1 cm:3 cm"), ratio = read_sweep_values("k=1:100:log"), list = read_sweep_values("k=[a, b, c]");
  EXPECT_EQ(linear.kind, Kind::Range);
  EXPECT_EQ(linear.at(0.0), "1 cm");
  EXPECT_EQ(linear.at(0.25), "1.5 cm");
  EXPECT_EQ(ratio.at(0.5), "10");
  EXPECT_EQ(list.at(0.0), "a");
  EXPECT_EQ(list.at(0.34), "b");
  EXPECT_EQ(list.at(0.999999), "c");
}

TEST(SweepValues, SayWhatIsWrong) {
  EXPECT_EQ(message_of("modulus"), "--set modulus: expected path.to.key=values, found 'modulus'; values: a:b:N, a:b:logN, [x, y, z], or one value");
  EXPECT_EQ(message_of("k=1:10:lg3"), "--set k=1:10:lg3: expected a number of values from 2 to 100000, with 'log' before it for equal ratios, found 'lg3'; for example 1e3:1e6:log9");
  EXPECT_EQ(message_of("k=1:10:1"), "--set k=1:10:1: expected a number of values from 2 to 100000, with 'log' before it for equal ratios, found '1'; for example 1e3:1e6:log9");
  EXPECT_EQ(message_of("k=0:10:log3"), "--set k=0:10:log3: expected two numbers > 0 for equal ratios, found '0' and '10'");
  EXPECT_EQ(message_of("k=1 cm:3:3"), "--set k=1 cm:3:3: expected both ends with units of the same kind, or none, found '1 cm' and '3'");
  EXPECT_EQ(message_of("k=1 cm:3 s:3"), "--set k=1 cm:3 s:3: expected both ends with units of the same kind, or none, found '1 cm' and '3 s'");
  EXPECT_EQ(message_of("k=1:x:3"), "--set k=1:x:3: expected a:b:N, a:b:logN or, to draw samples, a:b or a:b:log, found '1:x:3'; put a text that holds colons in quotes");
  EXPECT_EQ(message_of("k=1:2:3:4"), "--set k=1:2:3:4: expected a:b:N, a:b:logN or, to draw samples, a:b or a:b:log, found '1:2:3:4'; put a text that holds colons in quotes");
  EXPECT_EQ(message_of("k=[]"), "--set k=[]: expected a list of values, found an empty list; a value that is itself a list is [[...]]");
}

TEST(SweepValues, RefuseAListThatDoesNotEnd) { EXPECT_THROW((void)read_sweep_values("k=[1, 2"), Error); }

}  // namespace
}  // namespace supple::scenes
