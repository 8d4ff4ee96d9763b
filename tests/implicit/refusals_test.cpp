/// What is too large to be made is refused before memory is taken for it.
#include <gtest/gtest.h>

#include <functional>

#include "implicit/analytic_fields.h"
#include "implicit/bodies.h"
#include "implicit/mesh_checks.h"
#include "support/allocations.h"
#include "supple/core/error.h"
#include "supple/implicit/march_cubes.h"
#include "supple/implicit/mesh_limits.h"
#include "supple/implicit/polygonise.h"
#include "supple/implicit/surface_grid.h"

namespace supple::implicit {
using namespace testing;
namespace {

/// Bytes that `act` holds at most until it is refused.
std::uint64_t bytes_of_refusal(const std::function<void()>& act) {
  const std::uint64_t before = test::most_bytes(true);
  try {
    act();
    ADD_FAILURE() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.faults().size(), 1u);
  }
  return test::most_bytes() - before;
}

// All of them ask for a billion nodes or more, 4 GB in single precision.
TEST(Refusals, TakeNoMemory) {
  const Body body = body_of({{wyvill_point(1.0), Vec3::Zero()}});
  const FunctionField ball = sphere(Vec3::Zero(), 0.5);
  const std::vector<FieldView> bodies{ball, ball};
  const Executor executor(1);
  const auto grid = [](double cell) {
    GridOptions options;
    options.lattice = lattice_of(cell);
    return options;
  };
  const std::pair<const char*, std::function<void()>> refused[] = {
      {"cubes", [&] { (void)march_cubes(body.field, {.lattice = lattice_of(0.0018)}, executor); }},
      {"cubes, node numbers", [&] { (void)march_cubes(body.field, {.lattice = lattice_of(1e-12)}, executor); }},
      {"cubes to an error", [&] { (void)march_cubes(body.field, {.lattice = lattice_of(0.0), .error = 1e-12}, executor); }},
      {"tetrahedra", [&] { (void)polygonise(ball, lattice_of(1e-6), executor); }},
      {"tetrahedra of two", [&] { (void)polygonise_partition(bodies, lattice_of(1e-6), executor); }},
      {"grid", [&] { (void)make_surface_grid(ball, grid(1e-6), executor); }},
  };
  // At most as many blocks as are allowed are listed, and the largest list is that of a grid: 48 bytes for each of 390,625
  // blocks with its candidate and a box between them, thrice where a list moves to twice the room.
  for (const auto& [name, act] : refused) EXPECT_LT(bytes_of_refusal(act), 3 * 48 * 390'625 + 4'000'000) << name;
}

/// Whatever their size, numbers of nodes are compared before anything is looked for on the lattice.
TEST(Refusals, OfCellsFarTooSmallNameCellsThatFit) {
  const Body ball = body_of({{wyvill_point(1.0), Vec3::Zero()}});
  for (const double cell : {1e-12, 1e-50}) {
    try {
      expect_marchable(ball.field, lattice_of(cell), Executor(1));
      ADD_FAILURE() << cell;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Limit);
      EXPECT_EQ(error.faults().front().key, "lattice.cell");
      EXPECT_EQ(error.faults().front().expected, "expected node numbers up to 1.07e+09");
    }
  }
  EXPECT_NO_THROW(expect_marchable(ball.field, lattice_of(0.1), Executor(1)));
}

}  // namespace
}  // namespace supple::implicit
