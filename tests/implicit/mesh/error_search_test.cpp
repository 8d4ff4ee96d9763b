#include "mesh/error_search.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "implicit/analytic_fields.h"
#include "supple/core/error.h"
#include "supple/implicit/march_cubes.h"

namespace supple::implicit {
namespace {

using namespace testing;

/// Levels that were tried, and what was said when none reached the error.
struct Search {
  std::vector<int> level;
  std::string refused;
  double hint = 0.0;
};

/// Errors that start at 1 and shrink by `factor` from level to level; `levels` fit, errors from level `telling` on are telling.
Search search(double wanted, double factor, int levels, int telling = 4) {
  Search out;
  try {
    make_within({.error = wanted, .first = 1.0}, [&](int level) {
      out.level.push_back(level);
      return LevelTry{.error = std::pow(factor, level), .telling = level >= telling, .levels_left = levels - level};
    });
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Limit);
    out.refused = error.what();
    const std::string& hint = error.faults().front().hint;
    out.hint = std::stod(hint.substr(hint.find("least ") + 6));
  }
  return out;
}

constexpr double kTwo = 0.5, kOne = 0.5 * std::numbers::sqrt2;  // factors of order two and one

TEST(ErrorSearch, MemoryThatAMesherKeepsDoesNotDecideHowFineMeshesMayBe) {
  const Mesh none;
  const auto levels = [&](std::uint64_t tiles, std::uint64_t bytes) {
    return tried(0.1, none, MarchCounts{.blocks = 1, .tiles = tiles, .bytes = bytes}).levels_left;
  };
  const int of_few = levels(10'000, 4'000'000);  // 400 bytes a tile: 2^10 of 8 GB remain
  EXPECT_EQ(of_few, 10);
  EXPECT_EQ(levels(10'000, 0), of_few);
  EXPECT_EQ(levels(10'000, 8'000'000'000), of_few);
  EXPECT_EQ(levels(10'000'000, 0), 1);
}

TEST(ErrorSearch, EndsAtTheFirstLevelThatIsSureToDoAndTriesFew) {
  for (const double factor : {kTwo, kOne}) {
    for (const double wanted : {0.9, 0.3, 1e-2, 1.3e-4, 1e-5}) {
      const Search found = search(wanted, factor, 100);
      EXPECT_TRUE(found.refused.empty()) << found.refused;
      const double reached = std::pow(factor, found.level.back());
      EXPECT_LE(reached, wanted);
      EXPECT_GT(reached, 0.9 * factor * wanted * (1.0 - 1e-9)) << factor;  // a tenth is left for what lattices differ by
      EXPECT_LE(found.level.size(), 3 + found.level.back() / (factor == kTwo ? 4u : 2u));
    }
  }
  EXPECT_EQ(search(2.0, kTwo, 0).level, std::vector<int>{0});
}

// A mesher that knows only that so many levels are left, at least, tries and refuses what one does that knows how many.
TEST(ErrorSearch, CountsLevelsThatAreLeftOnlyWhereThatMayMatter) {
  for (const double factor : {kTwo, kOne}) {
    for (const double wanted : {0.3, 1e-2, 1e-3, 1e-12}) {
      for (const int levels : {0, 1, 3, 6, 9, 20}) {
        const Search known = search(wanted, factor, levels);
        for (const int fewer : {0, 1, 2, 5, 30}) {
          Search found;
          int counted = 0;
          try {
            make_within({.error = wanted, .first = 1.0}, [&](int level) {
              found.level.push_back(level);
              return LevelTry{.error = std::pow(factor, level), .telling = level >= 4, .levels_left = std::max(levels - level - fewer, 0),
                              .count_levels_left = [&counted, levels, level] { return ++counted, levels - level; }};
            });
          } catch (const Error& error) {
            found.refused = error.what();
          }
          EXPECT_EQ(found.level, known.level) << factor << ' ' << wanted << ' ' << levels << ' ' << fewer;
          EXPECT_EQ(found.refused, known.refused);
          if (levels == 20 && fewer < 5 && wanted >= 1e-2) {
            EXPECT_EQ(counted, 0) << wanted;
          }
        }
      }
    }
  }
}

TEST(ErrorSearch, RefusesEarlyWithAHintThatHolds) {
  for (const double factor : {kTwo, kOne}) {
    for (const int levels : {5, 12, 23}) {
      const Search refused = search(1e-12, factor, levels);
      EXPECT_LE(refused.level.back(), 6);
      EXPECT_NE(refused.refused.find("mesh.error: expected an error of at most 1e-12 m, found"), std::string::npos) << refused.refused;
      EXPECT_GE(refused.hint, std::pow(factor, levels));
      EXPECT_LE(refused.hint, 1.06 * std::pow(factor, levels - 1));
      const Search followed = search(refused.hint, factor, levels);
      EXPECT_TRUE(followed.refused.empty()) << followed.refused;
      EXPECT_LE(followed.level.back(), levels);
    }
  }
}

TEST(ErrorSearch, RefusesFromTheThreeCoarsestMeshesWhereTheyAreTelling) {
  for (const double factor : {kTwo, kOne}) {
    constexpr int kLevels = 12;
    const Search refused = search(1e-12, factor, kLevels, 0);
    EXPECT_EQ(refused.level, (std::vector<int>{0, 1, 2}));
    EXPECT_GE(refused.hint, std::pow(factor, kLevels));
    EXPECT_LE(refused.hint, 1.06 * std::pow(factor, kLevels - 1));
    const Search followed = search(refused.hint, factor, kLevels, 0);
    EXPECT_TRUE(followed.refused.empty()) << followed.refused;
  }
}

TEST(ErrorSearch, StepsNoFartherThanTwoLevelsTowardsAnErrorOutOfReach) {
  EXPECT_EQ(search(1e-12, kTwo, 12, 5).level, (std::vector<int>{0, 2, 4, 6}));
  EXPECT_EQ(search(1e-12, kOne, 12, 5).level, (std::vector<int>{0, 2, 4, 6}));
}

// Errors that fall fast once and slowly from then on, as where a small edge shows late: what a refusal names is reached.
TEST(ErrorSearch, NamesAnErrorThatIsReachedWhereErrorsFallMoreSlowlyThanOnce) {
  constexpr int kLevels = 14;
  const auto refused_at = [&](double wanted) {
    double hint = 0.0;
    try {
      make_within({.error = wanted, .first = 1.0}, [&](int level) {
        const double error = level < 4 ? std::pow(kOne, level) : 0.1 * std::pow(kOne, level - 4);
        return LevelTry{.error = error, .telling = level >= 4, .levels_left = kLevels - level};
      });
    } catch (const Error& error) {
      const std::string& text = error.faults().front().hint;
      hint = std::stod(text.substr(text.find("least ") + 6));
    }
    return hint;
  };
  const double hint = refused_at(1e-9);
  EXPECT_GE(hint, 0.1 * std::pow(kOne, kLevels - 4));
  EXPECT_LE(hint, 0.1 * std::pow(kOne, kLevels - 6));
  EXPECT_EQ(refused_at(hint), 0.0);
}

TEST(ErrorSearch, TellsTheSizesOfMeshesInTermsOfErrors) {
  const Error size(ErrorKind::Limit, {.key = "lattice.cell", .expected = "expected few", .found = "many", .hint = "use cells of at least 2 m"});
  const auto refused_at = [&](int last, bool stated) -> std::string {
    try {
      make_within({.error = 0.01, .first = 1.0, .stated = stated}, [&](int level) {
        if (level == last) throw size;
        return LevelTry{.error = 0.125, .telling = false, .levels_left = 9};
      });
    } catch (const Error& error) {
      return error.what();
    }
    return {};
  };
  EXPECT_EQ(refused_at(0, false), "mesh.error: expected few in the coarsest mesh, found many; remove the error and use cells of at least 2 m");
  EXPECT_EQ(refused_at(0, true), "lattice.cell: expected few, found many; use cells of at least 2 m");
  EXPECT_EQ(refused_at(2, false), "mesh.error: expected an error of at most 0.01 m, found 0.125 m with triangles of 1 m, and a mesh that "
                                  "meets it is too large; allow at least 0.131 m");
  EXPECT_THROW(make_within({.error = 1.0, .first = 1.0}, [](int) -> LevelTry { throw Error(ErrorKind::Internal, {.key = "a"}); }), Error);
}

/// A triangle on top of a point.
Mesh triangle_over(const Vec3& centre, double size, const Vec3& normal) {
  Mesh mesh;
  const Vec3 u = normal.unitOrthogonal(), v = normal.cross(u);
  for (const double angle : {0.3, 0.3 + 2.0 * std::numbers::pi / 3.0, 0.3 + 4.0 * std::numbers::pi / 3.0}) {
    mesh.position.push_back(centre + size * (std::cos(angle) * u + std::sin(angle) * v));
    mesh.normal.push_back(normal);
  }
  mesh.triangle.push_back({0, 1, 2});
  return mesh;
}

// Two half-spaces united: from within, the nearest point of their surface is on the valley, farther than either plane.
TEST(CentroidError, IsNoLessThanTheDistanceToACrease) {
  for (const double half : {0.2, 0.5, 1.0}) {  // of the angle of the valley
    const Vec3 a(std::cos(half), 0, -std::sin(half)), b(-std::cos(half), 0, -std::sin(half));
    const FunctionField valley{.function =
                                   [&](const Vec3& p, Vec3& gradient) {
                                     gradient = a.dot(p) >= b.dot(p) ? a : b;
                                     return std::max(a.dot(p), b.dot(p));
                                   },
                               .box = Box{Vec3(-1, -1, -1), Vec3(1, 1, 1)}};
    const double depth = 0.01;
    const double below = centroid_error(valley, triangle_over(Vec3(1e-4, 0.1, -depth), 0.1, Vec3::UnitZ()), Executor(1));
    EXPECT_GE(below, std::hypot(1e-4, depth) * (1.0 - 1e-9)) << half;
    EXPECT_LE(below, 0.1) << half;  // a vertex
    EXPECT_NEAR(centroid_error(valley, triangle_over(Vec3(-1e-4, 0.1, -depth), 0.002, Vec3::UnitZ()), Executor(1)), 0.002, 1e-12);
    // In the air of the valley a plane is nearest.
    const double above = centroid_error(valley, triangle_over(Vec3(0, 0.1, depth), 0.1, Vec3::UnitZ()), Executor(1));
    EXPECT_NEAR(above, depth * std::sin(half), 1e-12);
  }
}

TEST(CentroidError, IsTheDistanceToABall) {
  const FunctionField ball = sphere(Vec3::Zero(), 1.0);
  const Vec3 up = Vec3(0.3, -0.4, 0.8).normalized();
  for (const double off : {-0.003, 0.002}) {
    EXPECT_NEAR(centroid_error(ball, triangle_over((1.0 + off) * up, 0.01, up), Executor(1)), std::abs(off), 1e-12);
  }
  EXPECT_EQ(centroid_error(ball, Mesh{}, Executor(1)), 0.0);
}

}  // namespace
}  // namespace supple::implicit
