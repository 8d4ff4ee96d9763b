#include "supple/core/error.h"

#include <gtest/gtest.h>

#include "supple/core/printable.h"

namespace {

using namespace supple;

TEST(Faults, ReadAsPlaceKeyExpectationFindingAndHint) {
  const Fault fault{.place = "two_drops.yaml:7:27",
                    .key = "objects[0].skeleton.radius",
                    .expected = "expected a length > 0 [m]",
                    .found = "-0.2",
                    .hint = "did you mean 0.2?"};
  EXPECT_EQ(fault.message(),
            "two_drops.yaml:7:27: objects[0].skeleton.radius: expected a length > 0 [m], found -0.2; "
            "did you mean 0.2?");
}

TEST(Faults, LeaveEmptyPartsOut) {
  const Fault unwritable{.place = "out/x.ply", .key = {}, .expected = "cannot be written", .found = {}, .hint = {}};
  EXPECT_EQ(unwritable.message(), "out/x.ply: cannot be written");
  EXPECT_EQ((Fault{.place = {}, .key = "dt", .expected = {}, .found = "0", .hint = "give a step"}.message()),
            "dt: found 0; give a step");
}

TEST(Faults, ShowWhatATerminalWouldObeyByItsBytes) {
  const Fault fault{.place = "a\nb.csv:1", .key = {}, .expected = "expected text", .found = "'\x1b[2J \u00e9 \xff \xe2\x82'", .hint = "\x7f"};
  EXPECT_EQ(fault.message(), "a\\x0ab.csv:1: expected text, found '\\x1b[2J \u00e9 \\xff \\xe2\\x82'; \\x7f");
}

TEST(Faults, ShowControlsBeyondAsciiByTheirBytes) {
  EXPECT_EQ(printable("a\u009b31m\u0085 \u00a0\u00e9"), "a\\xc2\\x9b31m\\xc2\\x85 \u00a0\u00e9");
  // Right-to-left override and isolate, line separator; their neighbours are printed.
  EXPECT_EQ(printable("\u202e\u2066\u2069\u2028"), "\\xe2\\x80\\xae\\xe2\\x81\\xa6\\xe2\\x81\\xa9\\xe2\\x80\\xa8");
  EXPECT_EQ(printable("\u2027\u202f\u2065\u206a"), "\u2027\u202f\u2065\u206a");
}

TEST(Errors, HoldAllFaultsAndTheirKind) {
  const Error error(ErrorKind::Scene, {Fault{.place = "a", .key = {}, .expected = "x", .found = {}, .hint = {}},
                                       Fault{.place = "b", .key = {}, .expected = "y", .found = {}, .hint = {}}});
  EXPECT_STREQ(error.what(), "a: x\nb: y");
  EXPECT_EQ(error.faults().size(), 2U);
  EXPECT_EQ(static_cast<int>(error.kind()), 3);
  EXPECT_THROW(Error(ErrorKind::Io, std::vector<Fault>{}), ContractViolation);
}

TEST(Contracts, NameTheBrokenCondition) {
  const auto halve = [](int even) {
    SUPPLE_EXPECTS(even % 2 == 0);
    return even / 2;
  };
  EXPECT_EQ(halve(4), 2);
  try {
    halve(3);
    FAIL();
  } catch (const ContractViolation& violation) {
    EXPECT_NE(std::string(violation.what()).find("even % 2 == 0"), std::string::npos);
    EXPECT_NE(std::string(violation.what()).find("error_test.cpp"), std::string::npos);
  }
}

}  // namespace
