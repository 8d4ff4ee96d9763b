#include "supple/core/neighbour_list.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>

#include "neighbours/packed_list.h"
#include "supple/core/error.h"

namespace supple::core {
namespace {

static_assert(packed::kReachUp % packed::kTile == 0);

/// Columns of cells of a block: with what they reach, kReach behind in x and to both sides in y, the next block but
/// one has no column in common.
constexpr std::uint32_t kBlockX = packed::kReach, kBlockY = 2 * packed::kReach;

/// Cells below and above those of the particles that have none.
constexpr std::array<std::uint32_t, 3> kBelow{0, packed::kReach, packed::kReachUp};
constexpr std::array<std::uint32_t, 3> kAbove{packed::kReach, packed::kReach, packed::kReachUp};
/// Extent in ranges up to which the squares of floats are finite with room to spare.
constexpr double kLargestExtent = 0x1p40;

std::size_t cell_limit(std::size_t points) { return 16 * points + 8192; }

}  // namespace

Vec3 PeriodicBox::nearest_image(const Vec3& r) const {
  return r - length.cwiseProduct(r.cwiseQuotient(length).array().round().matrix());
}

NeighbourList::NeighbourList(double range, double skin, const std::optional<PeriodicBox>& box)
    : impl_(std::make_unique<Impl>()) {
  SUPPLE_EXPECTS(range > 0.0 && skin > 0.0);
  SUPPLE_EXPECTS(!box || box->length.minCoeff() >= 2.0 * (range + skin));
  impl_->range = range;
  impl_->skin = skin;
  impl_->box = box;
}

NeighbourList::~NeighbourList() = default;
NeighbourList::NeighbourList(NeighbourList&&) noexcept = default;
NeighbourList& NeighbourList::operator=(NeighbourList&&) noexcept = default;

double NeighbourList::range() const { return impl_->range; }
const std::optional<PeriodicBox>& NeighbourList::box() const { return impl_->box; }

bool NeighbourList::update(std::span<const Vec3> positions, const Executor& executor) {
  Impl& list = *impl_;
  SUPPLE_EXPECTS(positions.size() < (std::size_t{1} << 28));
  const auto take = [&] {
    list.reference.assign(positions.begin(), positions.end());
    list.build(executor);
    return true;
  };
  if (list.reference.size() != positions.size()) return take();
  if (!list.built) list.build(executor);
  const std::size_t blocks = (positions.size() + kPointBlock - 1) / kPointBlock;
  list.block_move2.assign(blocks, 0.0);
  const auto body = [&](std::size_t begin, std::size_t end) {
    list.block_move2[begin / kPointBlock] =
        packed::largest_move2(positions[begin].data(), list.reference[begin].data(), end - begin);
  };
  executor.for_blocks(positions.size(), kPointBlock, std::cref(body));
  double move2 = 0.0;
  for (const double m : list.block_move2) move2 = std::max(move2, m);
  if (move2 > 0.25 * list.skin * list.skin) return take();
  list.stage(positions, executor);
  return false;
}

/// Cells of the particles, in a box wrapped into it, and of the images that they see: those of whole boxes ahead in x,
/// or level with them, by the order in which a list takes its neighbours.
void NeighbourList::Impl::find_points(const Executor& executor) {
  const auto n = static_cast<std::uint32_t>(reference.size());
  const double reach = range + skin;
  Box bounds;
  if (box) {
    bounds = {box->origin, box->origin + box->length};
  } else {
    for (const Vec3& x : reference) bounds.include(x);
  }
  origin = bounds.lower;
  const Vec3 extent = box ? box->length : bounds.extent();
  SUPPLE_EXPECTS(extent.maxCoeff() < kLargestExtent * reach);
  Vec3 edge = reach * (1.0 + 0x1p-10) * Vec3(1.0 / packed::kReach, 1.0 / packed::kReach, 1.0 / packed::kReachUp);
  const auto cells_along = [&](std::size_t k) {
    const double whole = std::floor(extent[static_cast<int>(k)] / edge[static_cast<int>(k)]);
    return box ? std::max(whole, 1.0) : whole + 1.0;
  };
  const auto all_along = [&](std::size_t k) { return cells_along(k) + kBelow[k] + kAbove[k] + packed::kTile; };
  while (all_along(0) * all_along(1) * all_along(2) > static_cast<double>(cell_limit(n))) edge *= 1.26;
  for (std::size_t k = 0; k < 3; ++k) {
    inner[k] = static_cast<std::uint32_t>(cells_along(k));
    grid.cells[k] = inner[k] + kBelow[k] + kAbove[k];
    // In a box cells are as far apart as their images.
    const auto axis = static_cast<int>(k);
    inverse_edge[axis] = box ? inner[k] / box->length[axis] : 1.0 / edge[axis];
  }
  grid.cells[2] = (grid.cells[2] + packed::kTile - 1) / packed::kTile * packed::kTile;
  // Coordinates are rounded to 2^-24 of the extent, so differences are known to four times that.
  const double margin = 0x1p-22 * (extent.maxCoeff() + (box ? 2.0 * reach : 0.0));
  grid.range2 = static_cast<float>((reach + margin) * (reach + margin) * (1.0 + 0x1p-20));

  cell.resize(n);
  image_source.clear();
  unsorted_shift.clear();
  const auto index_of = [this](std::uint32_t x, std::uint32_t y, std::uint32_t z) {
    return ((x + kBelow[0]) * grid.cells[1] + y + kBelow[1]) * grid.cells[2] + z + kBelow[2];
  };
  const auto cell_along = [this](double u, std::size_t k) {
    const double c = std::max(u * inverse_edge[static_cast<int>(k)], 0.0);
    return std::min(static_cast<std::uint32_t>(c), inner[k] - 1);
  };
  if (!box) {
    const auto body = [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const Vec3 u = reference[i] - origin;
        cell[i] = index_of(cell_along(u.x(), 0), cell_along(u.y(), 1), cell_along(u.z(), 2));
      }
    };
    executor.for_blocks(n, kPointBlock, std::cref(body));
    return;
  }
  unsorted_shift.resize(n);
  for (std::uint32_t i = 0; i < n; ++i) {
    const Vec3 u = reference[i] - origin;
    const Vec3 home = -box->length.cwiseProduct(u.cwiseQuotient(box->length).array().floor().matrix());
    unsorted_shift[i] = home;
    struct Place {
      std::uint32_t cell;
      double shift;
    };
    std::array<std::array<Place, 2>, 3> place;
    std::array<std::size_t, 3> places{1, 1, 1};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto axis = static_cast<int>(k);
      const double w = u[axis] + home[axis], length = box->length[axis];
      const std::uint32_t c = cell_along(w, k);
      place[k][0] = {c, 0.0};
      if (w < reach) place[k][places[k]++] = {c + inner[k], length};
      else if (k != 0 && w > length - reach) place[k][places[k]++] = {c - inner[k], -length};
    }
    cell[i] = index_of(place[0][0].cell, place[1][0].cell, place[2][0].cell);
    if (places[0] * places[1] * places[2] == 1) continue;
    for (std::size_t a = 0; a < places[0]; ++a) {
      for (std::size_t b = 0; b < places[1]; ++b) {
        for (std::size_t c = 0; c < places[2]; ++c) {
          if (a + b + c == 0) continue;
          image_source.push_back(i);
          unsorted_shift.push_back(home + Vec3(place[0][a].shift, place[1][b].shift, place[2][c].shift));
          cell.push_back(index_of(place[0][a].cell, place[1][b].cell, place[2][c].cell));
        }
      }
    }
  }
}

/// Points sorted by cell, in order of points within one.
void NeighbourList::Impl::sort_points(const Executor& executor) {
  const auto n = static_cast<std::uint32_t>(reference.size());
  const auto points = static_cast<std::uint32_t>(cell.size());
  grid.start.assign(std::size_t{grid.cells[0]} * grid.cells[1] * grid.cells[2] + 1, 0);
  for (const std::uint32_t c : cell) ++grid.start[c];
  std::uint32_t sum = 0;
  for (std::uint32_t& s : grid.start) s = sum += s;
  // Filled from the back, which turns the ends in `start` into beginnings.
  order.resize(points);
  for (std::uint32_t p = points; p-- > 0;) order[--grid.start[cell[p]]] = p;

  source.resize(points);
  shift.resize(unsorted_shift.size());
  grid.image.resize(points);
  images.clear();
  for (std::vector<float>* v : {&grid.x, &grid.y, &grid.z}) v->resize(points + packed::kFloatRoom);
  position.resize(points + blocks());
  const auto body = [&](std::size_t begin, std::size_t end) {
    for (std::size_t e = begin; e < end; ++e) {
      const std::uint32_t p = order[e];
      const std::uint32_t i = p < n ? p : image_source[p - n];
      Vec3 x = reference[i];
      if (!shift.empty()) x += shift[e] = unsorted_shift[p];
      source[e] = i;
      grid.image[e] = p < n ? 0 : 1;
      position[e] = {x.x(), x.y(), x.z(), 0.0};
      const Vec3 u = x - origin;
      grid.x[e] = static_cast<float>(u.x());
      grid.y[e] = static_cast<float>(u.y());
      grid.z[e] = static_cast<float>(u.z());
    }
  };
  executor.for_blocks(points, kPointBlock, std::cref(body));
  if (points == n) return;
  for (std::uint32_t e = 0; e < points; ++e) {
    if (grid.image[e] != 0) images.push_back(e);
  }
}

void NeighbourList::Impl::lay_blocks() {
  cells.clear();
  const std::uint32_t highest = kBelow[2] + (inner[2] + packed::kTile - 1) / packed::kTile * packed::kTile;
  for (std::uint32_t c = 0; c < kColours; ++c) {
    colour[c] = cells.size();
    for (std::uint32_t x = c % 2 * kBlockX; x < inner[0]; x += 2 * kBlockX) {
      for (std::uint32_t y = c / 2 * kBlockY; y < inner[1]; y += 2 * kBlockY) {
        cells.push_back({.begin = {kBelow[0] + x, kBelow[1] + y},
                         .end = {kBelow[0] + std::min(x + kBlockX, inner[0]),
                                 kBelow[1] + std::min(y + kBlockY, inner[1])},
                         .lowest = kBelow[2],
                         .highest = highest});
      }
    }
  }
  colour[kColours] = cells.size();
  if (block.size() < cells.size()) block.resize(cells.size());
}

void NeighbourList::Impl::build(const Executor& executor) {
  built = true;
  colour = {};
  if (reference.empty()) return;
  find_points(executor);
  lay_blocks();
  sort_points(executor);
  const auto points = static_cast<std::uint32_t>(source.size());
  const Vec3 away = origin + (box ? box->length : Vec3(inverse_edge.cwiseInverse().cwiseProduct(
                                                      Vec3(inner[0], inner[1], inner[2])))) +
                    Vec3::Constant(4.0 * (range + skin));
  std::fill(position.begin() + points, position.end(), packed::Row{away.x(), away.y(), away.z(), 0.0});
  const auto body = [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b) {
      block[b].filler = 4 * (points + static_cast<std::uint32_t>(b));
      packed::search_cells(grid, cells[b], block[b]);
    }
  };
  executor.for_blocks(blocks(), 1, std::cref(body));
}

void NeighbourList::Impl::stage(std::span<const Vec3> positions, const Executor& executor) {
  const auto body = [&](std::size_t begin, std::size_t end) {
    if (shift.empty()) {
      for (std::size_t e = begin; e < end; ++e) {
        const Vec3& x = positions[source[e]];
        position[e] = {x.x(), x.y(), x.z(), 0.0};
      }
    } else {
      for (std::size_t e = begin; e < end; ++e) {
        const Vec3& x = positions[source[e]];
        const Vec3& s = shift[e];
        position[e] = {x.x() + s.x(), x.y() + s.y(), x.z() + s.z(), 0.0};
      }
    }
  };
  executor.for_blocks(source.size(), kPointBlock, std::cref(body));
}

packed::Fixed NeighbourList::Impl::stage_fixed(const Executor& executor) {
  // Neighbours are at most twice the reach apart, a quarter of what 32 bits hold.
  constexpr double kQuanta = 0x1p29;
  const double turns = kQuanta / (range + skin) * 0x1p-32;
  fixed.resize(position.size());
  const auto quanta = [turns](double x) {
    // A sum with 3 2^51 rounds to a whole number and leaves its low bits at the end.
    constexpr double kWhole = 0x1.8p52;
    const double t = x * turns;
    const double q = (t - ((t + kWhole) - kWhole)) * 0x1p32 + kWhole;
    return std::bit_cast<float>(static_cast<std::uint32_t>(std::bit_cast<std::uint64_t>(q)));
  };
  const auto body = [&](std::size_t begin, std::size_t end) {
    for (std::size_t e = begin; e < end; ++e) {
      const packed::Row& x = position[e];
      fixed[e] = {quanta(x.x), quanta(x.y), quanta(x.z), 0.0F};
    }
  };
  executor.for_blocks(position.size(), kPointBlock, std::cref(body));
  return {.rows = &fixed.data()->x,
          .quantum = static_cast<float>((range + skin) / kQuanta),
          .outside = static_cast<float>(4.0 * range)};
}

void NeighbourList::Impl::stage_single_normals(std::span<const Vec3> normals, const Executor& executor) {
  single_normal.resize(position.size());
  std::fill(single_normal.begin() + static_cast<std::ptrdiff_t>(source.size()), single_normal.end(),
            packed::SingleRow{});
  const auto body = [&](std::size_t begin, std::size_t end) {
    for (std::size_t e = begin; e < end; ++e) {
      const Eigen::Vector3f n = normals[source[e]].cast<float>();
      single_normal[e] = {n.x(), n.y(), n.z(), 0.0F};
    }
  };
  executor.for_blocks(source.size(), kPointBlock, std::cref(body));
}

void NeighbourList::Impl::clear(std::vector<packed::Row>& rows, const Executor& executor) const {
  rows.resize(position.size());
  const auto body = [&](std::size_t begin, std::size_t end) {
    std::fill(rows.data() + begin, rows.data() + end, packed::Row{});
  };
  executor.for_blocks(rows.size(), kPointBlock, std::cref(body));
}

void NeighbourList::Impl::stage_normals(std::span<const Vec3> normals, const Executor& executor) {
  normal.resize(position.size());
  std::fill(normal.begin() + static_cast<std::ptrdiff_t>(source.size()), normal.end(), packed::Row{});
  const auto body = [&](std::size_t begin, std::size_t end) {
    for (std::size_t e = begin; e < end; ++e) {
      const Vec3& n = normals[source[e]];
      normal[e] = {n.x(), n.y(), n.z(), 0.0};
    }
  };
  executor.for_blocks(source.size(), kPointBlock, std::cref(body));
}

void accumulate_geometric(NeighbourList& list, const TwelveSix& law, const Executor& executor, Loads& loads,
                          Precision precision) {
  NeighbourList::Impl& impl = list.impl();
  SUPPLE_EXPECTS(loads.force.size() == impl.reference.size());
  const double s2 = law.sigma * law.sigma;
  const double s6 = s2 * s2 * s2;
  const packed::TwelveSixNumbers numbers{.range2 = impl.range * impl.range,
                                         .twelve = 48.0 * law.epsilon * s6 * s6,
                                         .six = 24.0 * law.epsilon * s6};
  impl.clear(impl.force, executor);
  if (precision == Precision::SingleForces) {
    const packed::Fixed fixed = impl.stage_fixed(executor);
    impl.for_lists(executor, [&](const packed::ListBlock& block) {
      packed::twelve_six_forces(numbers, block, fixed, impl.force.data());
    });
  } else {
    impl.for_lists(executor, [&](const packed::ListBlock& block) {
      packed::twelve_six_forces(numbers, block, impl.position.data(), impl.force.data());
    });
  }
  impl.for_points(executor, [&](std::size_t i, std::size_t point) {
    const packed::Row& f = impl.force[point];
    loads.force[i] += Vec3(f.x, f.y, f.z);
  });
}

void accumulate_geometric(NeighbourList& list, const SurfaceLaws& law, std::span<const Vec3> normals,
                          const Executor& executor, Loads& loads, Precision precision) {
  NeighbourList::Impl& impl = list.impl();
  const std::size_t n = impl.reference.size();
  SUPPLE_EXPECTS(normals.size() == n && loads.force.size() == n && loads.torque.size() == n);
  const double h2 = impl.range * impl.range;
  const packed::SurfaceNumbers numbers{.range = impl.range,
                                       .inverse_h2 = 1.0 / h2,
                                       .slope = -3.0 / h2,
                                       .inverse_r0 = law.cohesion.f0 == 0.0 ? 0.0 : 1.0 / law.cohesion.r0,
                                       .cohesion = law.cohesion.f0 * law.cohesion.r0,
                                       .a = law.cohesion.a,
                                       .form4 = 4.0 * law.form,
                                       .curvature = law.curvature,
                                       .half_curvature = 0.5 * law.curvature,
                                       .form_offset2 = 2.0 * law.form * law.curvature * law.curvature,
                                       .flatness2 = 2.0 * (law.coplanarity + law.cocircularity),
                                       .conormality2 = 2.0 * law.conormality,
                                       .conormality4 = 4.0 * law.conormality,
                                       .cocircularity2 = 2.0 * law.cocircularity};
  impl.clear(impl.force, executor);
  impl.clear(impl.turn, executor);
  if (precision == Precision::SingleForces) {
    const packed::Fixed fixed = impl.stage_fixed(executor);
    impl.stage_single_normals(normals, executor);
    impl.for_lists(executor, [&](const packed::ListBlock& block) {
      packed::surface_loads(numbers, block, fixed, &impl.single_normal.data()->x, impl.force.data(), impl.turn.data());
    });
  } else {
    impl.stage_normals(normals, executor);
    impl.for_lists(executor, [&](const packed::ListBlock& block) {
      packed::surface_loads(numbers, block, impl.position.data(), impl.normal.data(), impl.force.data(),
                            impl.turn.data());
    });
  }
  impl.for_points(executor, [&](std::size_t i, std::size_t point) {
    const packed::Row& f = impl.force[point];
    const packed::Row& t = impl.turn[point];
    loads.force[i] += Vec3(f.x, f.y, f.z);
    loads.torque[i] += Vec3(t.x, t.y, t.z).cross(normals[i]);
  });
}

std::vector<IndexPair> NeighbourList::pairs() const {
  std::vector<IndexPair> out;
  const Impl& list = *impl_;
  for (std::size_t b = 0; b < list.blocks(); ++b) {
    const packed::ListBlock& block = list.block[b];
    for (std::size_t k = 0; k < packed::kBatch * block.batches; ++k) {
      if (block.neighbour[k] == block.filler) continue;
      const std::uint32_t i = list.source[block.owner[k / packed::kBatch] / 4];
      const std::uint32_t j = list.source[block.neighbour[k] / 4];
      out.push_back({std::min(i, j), std::max(i, j)});
    }
  }
  std::sort(out.begin(), out.end());
  return out;
}

std::size_t NeighbourList::entries() const {
  std::size_t count = 0;
  for (std::size_t b = 0; b < impl_->blocks(); ++b) count += packed::kBatch * impl_->block[b].batches;
  return count;
}

std::size_t NeighbourList::bytes() const {
  const auto size_of = [](const auto&... v) { return ((v.capacity() * sizeof(v[0])) + ...); };
  const Impl& l = *impl_;
  std::size_t total = size_of(l.reference, l.source, l.images, l.shift, l.position, l.normal, l.force, l.turn, l.fixed,
                              l.single_normal, l.cells,
                              l.cell, l.order, l.unsorted_shift, l.image_source, l.grid.start, l.grid.x, l.grid.y,
                              l.grid.z, l.grid.image, l.block, l.block_move2);
  for (const std::vector<packed::Row>& rows : l.ellipsoid) total += size_of(rows);
  for (const packed::ListBlock& b : l.block) {
    total += size_of(b.owner, b.neighbour, b.near_x, b.near_y, b.near_z, b.near_index);
  }
  return total;
}

void NeighbourList::save(StateWriter& out) const { out.write(impl_->reference); }

void NeighbourList::load(StateReader& in) {
  in.read(impl_->reference);
  impl_->built = false;
}

void NeighbourList::hash(Hasher& hasher) const { hasher.add(impl_->reference); }

}  // namespace supple::core
