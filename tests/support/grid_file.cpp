#include "support/grid_file.h"

#include <openvdb/openvdb.h>
#include <openvdb/tools/Interpolation.h>

namespace supple {
namespace {

const openvdb::FloatGrid& grid_of(const std::shared_ptr<const void>& grid) { return *static_cast<const openvdb::FloatGrid*>(grid.get()); }

}  // namespace

GridOfFile::GridOfFile(const std::filesystem::path& path, const std::string& name) {
  openvdb::initialize();
  openvdb::io::File file(path.string());
  file.open(false);
  if (file.hasGrid(name)) grid_ = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid(name));
}

std::string GridOfFile::content_hash() const { return grid_of(grid_).metaValue<std::string>("content_hash"); }

double GridOfFile::interpolate(const Vec3& world) const {
  const openvdb::tools::GridSampler<openvdb::FloatGrid, openvdb::tools::BoxSampler> sampler(grid_of(grid_));
  return sampler.wsSample({world.x(), world.y(), world.z()});
}

}  // namespace supple
