#include "supple/core/neighbour_list.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "packed_list.h"
#include "supple/core/error.h"

namespace supple::core {
namespace {

constexpr std::uint32_t kCellBlock = 256;
constexpr std::size_t kPointBlock = 4096;
static_assert(kCellBlock % packed::kTile == 0 && packed::kReachUp % packed::kTile == 0);

/// Cells on each side of the points that have no particle.
constexpr std::array<std::uint32_t, 3> kRing{packed::kReach, packed::kReach, packed::kReachUp};
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
  };
  bool taken = false;
  if (list.reference.size() != positions.size()) {
    take();
    taken = true;
  } else {
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
    if (move2 > 0.25 * list.skin * list.skin) {
      take();
      taken = true;
    }
  }
  list.stage(positions, executor);
  return taken;
}

/// Particles where they are in open space; in a box wrapped into it, and their images near its faces.
void NeighbourList::Impl::find_points() {
  const auto n = static_cast<std::uint32_t>(reference.size());
  image_source.resize(n);
  for (std::uint32_t i = 0; i < n; ++i) image_source[i] = i;
  image_shift.clear();
  if (!box) return;
  image_shift.resize(n);
  const double halo = range + skin;
  for (std::uint32_t i = 0; i < n; ++i) {
    const Vec3 u = reference[i] - box->origin;
    const Vec3 home = -box->length.cwiseProduct(u.cwiseQuotient(box->length).array().floor().matrix());
    image_shift[i] = home;
    std::array<std::array<double, 2>, 3> along{};
    std::array<int, 3> images{1, 1, 1};
    for (int k = 0; k < 3; ++k) {
      const double w = u[k] + home[k];
      const auto axis = static_cast<std::size_t>(k);
      if (w < halo) along[axis][static_cast<std::size_t>(images[axis]++)] = box->length[k];
      else if (w > box->length[k] - halo) along[axis][static_cast<std::size_t>(images[axis]++)] = -box->length[k];
    }
    for (int image = 1; image < images[0] * images[1] * images[2]; ++image) {
      const int a = image % images[0], b = image / images[0] % images[1], c = image / (images[0] * images[1]);
      image_source.push_back(i);
      image_shift.push_back(home + Vec3(along[0][static_cast<std::size_t>(a)], along[1][static_cast<std::size_t>(b)],
                                        along[2][static_cast<std::size_t>(c)]));
    }
  }
}

/// Points sorted by cell, in order of points within one.
void NeighbourList::Impl::lay_cells() {
  const auto points = static_cast<std::uint32_t>(image_source.size());
  const auto at = [this](std::uint32_t p) -> Vec3 {
    return image_shift.empty() ? reference[image_source[p]] : Vec3(reference[image_source[p]] + image_shift[p]);
  };
  Box bounds;
  for (std::uint32_t p = 0; p < points; ++p) bounds.include(at(p));
  const double reach_range = range + skin;
  Vec3 edge = reach_range * (1.0 + 0x1p-10) *
              Vec3(1.0 / packed::kReach, 1.0 / packed::kReach, 1.0 / packed::kReachUp);
  const Vec3 extent = bounds.extent();
  SUPPLE_EXPECTS(extent.maxCoeff() < kLargestExtent * reach_range);
  const Vec3 away = bounds.upper + Vec3::Constant(2.0 * reach_range);
  position.resize(points + 1);
  position.back() = {away.x(), away.y(), away.z(), 0.0};
  const auto cells_along = [&](std::size_t k) {
    const auto axis = static_cast<int>(k);
    return std::floor(extent[axis] / edge[axis]) + 1.0 + 2 * kRing[k];
  };
  while (cells_along(0) * cells_along(1) * cells_along(2) > static_cast<double>(cell_limit(points))) edge *= 1.26;
  for (std::size_t k = 0; k < 3; ++k) grid.cells[k] = static_cast<std::uint32_t>(cells_along(k));
  const std::uint32_t inner = grid.cells[2] - 2 * kRing[2];
  grid.cells[2] = (inner + packed::kTile - 1) / packed::kTile * packed::kTile + 2 * kRing[2];
  // Coordinates are rounded to 2^-24 of the extent, so differences are known to four times that.
  const double margin = 0x1p-22 * extent.maxCoeff();
  grid.range2 = static_cast<float>((reach_range + margin) * (reach_range + margin) * (1.0 + 0x1p-20));

  const Vec3 inverse = edge.cwiseInverse();
  cell.resize(points);
  grid.start.assign(std::size_t{grid.cells[0]} * grid.cells[1] * grid.cells[2] + 1, 0);
  const std::array<std::uint32_t, 3> limit{grid.cells[0] - 2 * kRing[0] - 1, grid.cells[1] - 2 * kRing[1] - 1,
                                           grid.cells[2] - 2 * kRing[2] - 1};
  const auto cell_along = [&](double u, std::size_t k) {
    const double c = u * inverse[static_cast<int>(k)];
    return std::min(static_cast<std::uint32_t>(c), limit[k]) + kRing[k];
  };
  for (std::uint32_t p = 0; p < points; ++p) {
    const Vec3 u = at(p) - bounds.lower;
    cell[p] = (cell_along(u.x(), 0) * grid.cells[1] + cell_along(u.y(), 1)) * grid.cells[2] + cell_along(u.z(), 2);
    ++grid.start[cell[p] + 1];
  }
  for (std::size_t c = 0; c + 1 < grid.start.size(); ++c) grid.start[c + 1] += grid.start[c];
  source.resize(points);
  shift.resize(image_shift.size());
  grid.image.resize(points);
  for (std::vector<float>* v : {&grid.x, &grid.y, &grid.z}) v->resize(points + packed::kFloatRoom);
  // Filled from the back, which turns the ends in `start` into beginnings: start[c + 1] falls to the first of cell c.
  for (std::uint32_t p = points; p-- > 0;) {
    const std::uint32_t entry = --grid.start[cell[p] + 1];
    const Vec3 u = at(p) - bounds.lower;
    grid.x[entry] = static_cast<float>(u.x());
    grid.y[entry] = static_cast<float>(u.y());
    grid.z[entry] = static_cast<float>(u.z());
    grid.image[entry] = p >= reference.size() ? 1 : 0;
    source[entry] = image_source[p];
    if (!image_shift.empty()) shift[entry] = image_shift[p];
  }
  std::move(grid.start.begin() + 1, grid.start.end(), grid.start.begin());
  grid.start.back() = points;
}

void NeighbourList::Impl::build(const Executor& executor) {
  built = true;
  blocks = 0;
  if (reference.empty()) return;
  find_points();
  lay_cells();
  // The rings of cells round the points hold no particle and have no cells in reach; their slabs in x are left out.
  const std::uint32_t slab = grid.cells[1] * grid.cells[2];
  const std::uint32_t first = kRing[0] * slab, last = (grid.cells[0] - kRing[0]) * slab;
  blocks = (last - first + kCellBlock - 1) / kCellBlock;
  if (block.size() < blocks) block.resize(blocks);
  const auto filler = static_cast<std::uint32_t>(source.size());
  const auto body = [&](std::size_t begin, std::size_t end) {
    packed::search_cells(grid, first + static_cast<std::uint32_t>(begin), first + static_cast<std::uint32_t>(end),
                         filler, block[begin / kCellBlock]);
  };
  executor.for_blocks(last - first, kCellBlock, std::cref(body));
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

void NeighbourList::Impl::stage_normals(std::span<const Vec3> normals, const Executor& executor) {
  normal.resize(source.size() + 1);
  normal.back() = {};
  const auto body = [&](std::size_t begin, std::size_t end) {
    for (std::size_t e = begin; e < end; ++e) {
      const Vec3& n = normals[source[e]];
      normal[e] = {n.x(), n.y(), n.z(), 0.0};
    }
  };
  executor.for_blocks(source.size(), kPointBlock, std::cref(body));
}

void accumulate_geometric(NeighbourList& list, const TwelveSix& law, const Executor& executor, Loads& loads) {
  const NeighbourList::Impl& impl = list.impl();
  SUPPLE_EXPECTS(loads.force.size() == impl.reference.size());
  const double s2 = law.sigma * law.sigma;
  const double s6 = s2 * s2 * s2;
  const packed::TwelveSixNumbers numbers{.range2 = impl.range * impl.range,
                                         .twelve = 48.0 * law.epsilon * s6 * s6,
                                         .six = 24.0 * law.epsilon * s6};
  impl.for_lists(executor, [&](const packed::ListBlock& block, std::size_t begin, std::size_t end) {
    std::array<packed::Row, kListBlock> force;
    packed::twelve_six_forces(numbers, block, begin, end, impl.position.data(), force.data());
    for (std::size_t k = begin; k < end; ++k) {
      const packed::Row& f = force[k - begin];
      loads.force[impl.source[block.point[k]]] += Vec3(f.x, f.y, f.z);
    }
  });
}

void accumulate_geometric(NeighbourList& list, const SurfaceLaws& law, std::span<const Vec3> normals,
                          const Executor& executor, Loads& loads) {
  NeighbourList::Impl& impl = list.impl();
  const std::size_t n = impl.reference.size();
  SUPPLE_EXPECTS(normals.size() == n && loads.force.size() == n && loads.torque.size() == n);
  impl.stage_normals(normals, executor);
  const double h2 = impl.range * impl.range;
  const packed::SurfaceNumbers numbers{.range2 = h2,
                                       .inverse_h2 = 1.0 / h2,
                                       .slope = -6.0 / h2,
                                       .inverse_r0 = law.cohesion.f0 == 0.0 ? 0.0 : 1.0 / law.cohesion.r0,
                                       .cohesion = law.cohesion.f0 * law.cohesion.r0,
                                       .a = law.cohesion.a,
                                       .form = law.form,
                                       .curvature = law.curvature,
                                       .form_offset = law.form * law.curvature * law.curvature,
                                       .coplanarity = law.coplanarity,
                                       .conormality = law.conormality,
                                       .conormality2 = 2.0 * law.conormality,
                                       .cocircularity = law.cocircularity};
  const auto filler = static_cast<std::uint32_t>(4 * impl.source.size());
  impl.for_lists(executor, [&](const packed::ListBlock& block, std::size_t begin, std::size_t end) {
    std::array<packed::Row, kListBlock> force, torque;
    packed::surface_loads(numbers, block, begin, end, filler, impl.position.data(), impl.normal.data(), force.data(),
                          torque.data());
    for (std::size_t k = begin; k < end; ++k) {
      const std::uint32_t i = impl.source[block.point[k]];
      const packed::Row& f = force[k - begin];
      const packed::Row& t = torque[k - begin];
      loads.force[i] += Vec3(f.x, f.y, f.z);
      loads.torque[i] += Vec3(t.x, t.y, t.z);
    }
  });
}

std::vector<IndexPair> NeighbourList::pairs() const {
  std::vector<IndexPair> out;
  const Impl& list = *impl_;
  const auto filler = static_cast<std::uint32_t>(list.source.size());
  for (std::size_t b = 0; b < list.blocks; ++b) {
    const packed::ListBlock& block = list.block[b];
    for (std::size_t k = 0; k < block.point.size(); ++k) {
      const std::uint32_t i = list.source[block.point[k]];
      for (std::uint32_t e = block.first[k]; e < block.last[k]; ++e) {
        if (block.neighbour[e] == 4 * filler) continue;
        const std::uint32_t j = list.source[block.neighbour[e] / 4];
        if (i < j) out.push_back({i, j});
      }
    }
  }
  std::sort(out.begin(), out.end());
  return out;
}

std::size_t NeighbourList::entries() const {
  std::size_t count = 0;
  for (std::size_t b = 0; b < impl_->blocks; ++b) {
    const packed::ListBlock& block = impl_->block[b];
    for (std::size_t k = 0; k < block.point.size(); ++k) count += block.last[k] - block.first[k];
  }
  return count;
}

std::size_t NeighbourList::bytes() const {
  const auto size_of = [](const auto&... v) { return ((v.capacity() * sizeof(v[0])) + ...); };
  const Impl& l = *impl_;
  std::size_t total = size_of(l.reference, l.source, l.shift, l.position, l.normal, l.image_shift, l.image_source,
                              l.cell, l.grid.start, l.grid.x, l.grid.y, l.grid.z, l.grid.image, l.block, l.block_move2);
  for (const packed::ListBlock& b : l.block) total += size_of(b.point, b.first, b.last, b.neighbour, b.near_x, b.near_y, b.near_z, b.near_index);
  return total;
}

void NeighbourList::save(StateWriter& out) const { out.write(impl_->reference); }

void NeighbourList::load(StateReader& in) {
  in.read(impl_->reference);
  impl_->built = false;
}

void NeighbourList::hash(Hasher& hasher) const { hasher.add(impl_->reference); }

}  // namespace supple::core
