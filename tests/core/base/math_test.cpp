// Errors are measured against the long double functions of the C library (64-bit significand: their own error is
// below 0.001 ulp of a double).
#include "supple/core/math.h"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "laws/lanes.h"

namespace {

using namespace supple;

constexpr int kDraws = 200000;

/// |value - exact| in units in the last place of the exact result.
double ulp_error(double value, long double exact) {
  const double rounded = std::abs(static_cast<double>(exact));
  const double below = std::nextafter(rounded, 0.0);
  const double ulp = rounded == below ? std::numeric_limits<double>::denorm_min() : rounded - below;
  return static_cast<double>(std::abs(static_cast<long double>(value) - exact) / ulp);
}

class Draw {
 public:
  explicit Draw(std::uint64_t seed) : engine_(seed) {}
  double uniform(double lower, double upper) {
    return lower + (upper - lower) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }

 private:
  std::mt19937_64 engine_;
};

TEST(Exponential, IsWithinOneUlp) {
  Draw draw(1);
  double worst = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = i % 2 == 0 ? draw.uniform(-708.0, 709.0) : draw.uniform(-2.0, 2.0);
    worst = std::max(worst, ulp_error(math::exp(x), std::exp(static_cast<long double>(x))));
  }
  EXPECT_LE(worst, 1.0);
  EXPECT_EQ(math::exp(0.0), 1.0);
}

TEST(Exponential, HasItsLimits) {
  EXPECT_EQ(math::exp(-709.0), 0.0);
  EXPECT_EQ(math::exp(710.0), std::numeric_limits<double>::infinity());
  EXPECT_LE(ulp_error(math::exp(709.5), std::exp(709.5L)), 1.0);
  EXPECT_TRUE(std::isnan(math::exp(std::numeric_limits<double>::quiet_NaN())));
}

TEST(Exponential, OfLanesHasTheSameBits) {
  const double infinity = std::numeric_limits<double>::infinity(), limit = 0x1.62e42fefa39efp+9;
  std::vector<double> x{0.0, -0.0, 1.0, -1.0, -708.0, std::nextafter(-708.0, -infinity), -745.0, -1e300, -infinity, limit,
                        std::nextafter(limit, infinity), infinity, std::numeric_limits<double>::quiet_NaN(), 709.5, -707.5, 1e-300};
  Draw draw(8);
  while (x.size() < 20000) x.push_back(draw.uniform(-720.0, 720.0));
  for (std::size_t i = 0; i + 4 <= x.size(); i += 4) {
    std::array<double, 4> y{};
    core::exp(core::Lanes::load_any(&x[i])).store_any(y.data());
    for (std::size_t k = 0; k < 4; ++k) {
      const double expected = math::exp(x[i + k]);
      if (std::isnan(expected)) {
        EXPECT_TRUE(std::isnan(y[k]));
      } else {
        EXPECT_EQ(std::bit_cast<std::uint64_t>(y[k]), std::bit_cast<std::uint64_t>(expected)) << x[i + k];
      }
    }
  }
}

TEST(Logarithm, IsWithinOneAndAHalfUlp) {
  Draw draw(2);
  double worst = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = i % 2 == 0 ? std::exp(draw.uniform(-700.0, 700.0)) : draw.uniform(0.4, 2.5);
    worst = std::max(worst, ulp_error(math::log(x), std::log(static_cast<long double>(x))));
  }
  EXPECT_LE(worst, 1.5);
  EXPECT_EQ(math::log(1.0), 0.0);
  EXPECT_LE(ulp_error(math::log(4.9e-320), std::log(static_cast<long double>(4.9e-320))), 1.5);
}

TEST(Logarithm, HasItsLimits) {
  EXPECT_EQ(math::log(0.0), -std::numeric_limits<double>::infinity());
  EXPECT_TRUE(std::isnan(math::log(-1.0)));
  EXPECT_EQ(math::log(std::numeric_limits<double>::infinity()), std::numeric_limits<double>::infinity());
}

TEST(SineAndCosine, AreWithinOneAndAHalfUlpUpToAHundredThousand) {
  Draw draw(3);
  double worst = 0.0;
  const auto check = [&](double x) {
    const math::SinCos value = math::sin_cos(x);
    worst = std::max(worst, ulp_error(value.sin, std::sin(static_cast<long double>(x))));
    worst = std::max(worst, ulp_error(value.cos, std::cos(static_cast<long double>(x))));
  };
  for (int i = 0; i < kDraws; ++i) check(i % 2 == 0 ? draw.uniform(-1e5, 1e5) : draw.uniform(-4.0, 4.0));
  // The doubles next to multiples of pi/2, where the reduction cancels most. (The long double sine itself is exact
  // to its last place there.)
  for (int n = 1; n < 60000; n += 7) {
    const double near = n * 1.5707963267948966;
    check(near);
    check(std::nextafter(near, 1e9));
    check(-near);
  }
  EXPECT_LE(worst, 1.5);
  EXPECT_EQ(math::sin_cos(0.0).sin, 0.0);
  EXPECT_EQ(math::sin_cos(0.0).cos, 1.0);
  EXPECT_TRUE(std::isnan(math::sin_cos(std::numeric_limits<double>::infinity()).sin));
}

TEST(ArcTangent, IsWithinTwoUlp) {
  Draw draw(4);
  double worst = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    const double scale = std::exp(draw.uniform(-8.0, 8.0));
    const double x = draw.uniform(-1.0, 1.0);
    const double y = draw.uniform(-1.0, 1.0) * scale;
    worst = std::max(worst, ulp_error(math::atan2(y, x),
                                      std::atan2(static_cast<long double>(y), static_cast<long double>(x))));
  }
  EXPECT_LE(worst, 2.0);
}

TEST(ArcTangent, CoversTheWholeCircleAndExtremeScales) {
  const double pi = 3.141592653589793;
  EXPECT_EQ(math::atan2(0.0, 1.0), 0.0);
  EXPECT_EQ(math::atan2(0.0, -1.0), pi);
  EXPECT_EQ(math::atan2(-0.0, -1.0), pi);
  EXPECT_EQ(math::atan2(1.0, 0.0), pi / 2);
  EXPECT_EQ(math::atan2(-1.0, 0.0), -pi / 2);
  EXPECT_EQ(math::atan2(0.0, 0.0), 0.0);
  EXPECT_DOUBLE_EQ(math::atan2(1e300, 1e300), pi / 4);
  EXPECT_DOUBLE_EQ(math::atan2(1e-310, 1e-310), pi / 4);
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_DOUBLE_EQ(math::atan2(infinity, -infinity), 3.0 * pi / 4);
  EXPECT_TRUE(std::isnan(math::atan2(std::numeric_limits<double>::quiet_NaN(), 1.0)));
}

TEST(Power, KeepsItsStatedRelativeError) {
  Draw draw(5);
  for (int i = 0; i < kDraws / 4; ++i) {
    const double x = std::exp(draw.uniform(-20.0, 20.0));
    const double y = draw.uniform(-30.0, 30.0);
    const long double exact = std::pow(static_cast<long double>(x), static_cast<long double>(y));
    if (exact > 1e300L || exact < 1e-300L) continue;
    const double error = static_cast<double>(std::abs(math::pow(x, y) / exact - 1.0L));
    ASSERT_LE(error, 1e-15 * (1.0 + std::abs(y * std::log(x)))) << x << ' ' << y;
  }
  EXPECT_EQ(math::pow(7.0, 0.0), 1.0);
}

TEST(ErrorFunction, IsWithinItsAbsoluteError) {
  Draw draw(6);
  double worst = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = draw.uniform(-6.5, 6.5);
    worst = std::max(worst, std::abs(static_cast<double>(math::erf(x) - std::erf(static_cast<long double>(x)))));
  }
  EXPECT_LE(worst, 2e-16);
  EXPECT_EQ(math::erf(0.0), 0.0);
  EXPECT_EQ(math::erf(-40.0), -1.0);
}

// The bits themselves are a contract (docs/determinism.md): one hash over many results, equal on every CPU.
TEST(Transcendentals, HaveTheSameBitsOnEveryMachine) {
  Draw draw(7);
  std::uint64_t mixed = 0;
  const auto mix = [&mixed](double value) {
    mixed = (mixed ^ std::bit_cast<std::uint64_t>(value)) * 0x9e3779b97f4a7c15ULL;
    mixed ^= mixed >> 29;
  };
  for (int i = 0; i < 10000; ++i) {
    const double x = draw.uniform(-30.0, 30.0);
    mix(math::exp(x));
    mix(math::log(std::abs(x) + 1e-3));
    const math::SinCos value = math::sin_cos(x);
    mix(value.sin);
    mix(value.cos);
    mix(math::atan2(x, 1.5));
    mix(math::erf(0.2 * x));
  }
  EXPECT_EQ(mixed, 4882696131823024123ULL);
}

}  // namespace
