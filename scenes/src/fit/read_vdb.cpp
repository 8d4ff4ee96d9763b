#include <openvdb/openvdb.h>
#include <openvdb/tools/Dense.h>

#include "fit/data.h"
#include "fit/volume.h"

namespace supple::fit {
namespace {

using openvdb::FloatGrid;

FloatGrid::Ptr read_grid(const std::filesystem::path& file) try {
  openvdb::initialize();
  openvdb::io::File in(file.string());
  in.open(false);
  const openvdb::GridPtrVecPtr grids = in.getGrids();
  for (const openvdb::GridBase::Ptr& grid : *grids) {
    if (grid->isType<FloatGrid>()) return openvdb::gridPtrCast<FloatGrid>(grid);
  }
  refuse(file, "expected a grid of floats", std::to_string(grids->size()) + " grids of other kinds", "write a signed distance or a density as floats");
} catch (const openvdb::Exception&) {
  refuse(file, "expected a file of OpenVDB", "bytes that are none, or that end early", "the extension says how a file is read");
}

}  // namespace

Volume read_vdb(const std::filesystem::path& file) {
  const FloatGrid::Ptr grid = read_grid(file);
  const openvdb::math::Transform& transform = grid->transform();
  if (!transform.isLinear()) refuse(file, "expected a grid with straight axes", "one with perspective", "resample it to a grid with straight axes");
  openvdb::CoordBBox box = grid->evalActiveVoxelBoundingBox();
  if (box.empty()) refuse(file, "expected a grid with values", "an empty one", "write it again with active voxels");
  box.expand(1);  // what the values change to beyond them
  const openvdb::Coord size = box.dim();
  expect_voxels(file, {static_cast<double>(size.x()), static_cast<double>(size.y()), static_cast<double>(size.z())});
  Volume out;
  out.level_set = grid->getGridClass() == openvdb::GRID_LEVEL_SET;
  for (int k = 0; k < 3; ++k) out.count[static_cast<std::size_t>(k)] = static_cast<std::size_t>(size[k]);
  const auto world = [&](const openvdb::Coord& c) {
    const openvdb::Vec3d p = transform.indexToWorld(c);
    return Vec3(p.x(), p.y(), p.z());
  };
  out.origin = world(box.min());
  for (int k = 0; k < 3; ++k) {
    openvdb::Coord next = box.min();
    next[k] += 1;
    out.axes.col(k) = world(next) - out.origin;
  }
  expect_axes(file, out);
  out.value.resize(out.size());
  openvdb::tools::Dense<float, openvdb::tools::LayoutXYZ> dense(box, out.value.data());
  openvdb::tools::copyToDense(*grid, dense);
  return out;
}

}  // namespace supple::fit
