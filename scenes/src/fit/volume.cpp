#include "fit/volume.h"

#include <algorithm>
#include <cmath>

#include "fit/data.h"
#include "fit/grid_field.h"
#include "supple/core/interrupt.h"

namespace supple::fit {
namespace {

/// What the options ask for: 0 on the surface, more inside. Values that are no numbers lie outside.
class Choice {
 public:
  Choice(const std::filesystem::path& file, const Volume& volume, const VolumeOptions& options) : options_(options), level_set_(volume.level_set && !options.iso) {
    const int given = int{options.iso.has_value()} + int{options.window.has_value()} + int{options.label.has_value()};
    if (given == 1 || (given == 0 && level_set_)) return;
    double least = std::numeric_limits<double>::infinity(), most = -least;
    for (const float v : volume.value) {
      if (!std::isfinite(v)) continue;
      least = std::min<double>(least, v);
      most = std::max<double>(most, v);
    }
    refuse(file, "expected one of --iso VALUE, --window FROM:TO and --label NUMBER, which say what lies inside", given == 0 ? "none" : "more",
           least <= most ? "values are " + short_number(least) + " to " + short_number(most) : "the file holds no finite value", ErrorKind::Usage);
  }

  [[nodiscard]] double operator()(float v) const {
    if (level_set_) return std::isfinite(v) ? -double{v} : kOutside;
    if (options_.label) return v == static_cast<float>(*options_.label) ? 0.5 : -0.5;
    if (!std::isfinite(v)) return kOutside;
    if (options_.iso) return v - *options_.iso;
    // What lies far outside would draw the surface to the voxels inside.
    const auto [from, to] = *options_.window;
    return std::max(std::min(v - from, to - v), -0.5 * (to - from));
  }
  [[nodiscard]] std::string text() const {
    if (options_.label) return "voxels of label " + std::to_string(*options_.label);
    if (options_.window) return "voxels of values from " + short_number((*options_.window)[0]) + " to " + short_number((*options_.window)[1]);
    return options_.iso ? "voxels of values above " + short_number(*options_.iso) : "voxels of negative distance";
  }

 private:
  static constexpr double kOutside = -std::numeric_limits<float>::max();
  const VolumeOptions& options_;
  bool level_set_;
};

/// The voxels inside. @return their box, in indices
Box inside_box(const std::filesystem::path& file, const Volume& volume, const Choice& choice) {
  Box box;
  float least = std::numeric_limits<float>::infinity(), most = -least;
  std::size_t index = 0, inside = 0;
  for (std::size_t k = 0; k < volume.count[2]; ++k) {
    for (std::size_t j = 0; j < volume.count[1]; ++j) {
      for (std::size_t i = 0; i < volume.count[0]; ++i, ++index) {
        const float v = volume.value[index];
        least = std::min(least, v);
        most = std::max(most, v);
        if (!(choice(v) > 0.0)) continue;
        ++inside;
        box.include(Vec3(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)));
      }
    }
  }
  if (inside == 0) refuse(file, "expected " + choice.text(), "none", "values are " + short_number(least) + " to " + short_number(most));
  if (inside == volume.size()) refuse(file, "expected voxels outside, too", "all of them " + choice.text().substr(7), "values are " + short_number(least) + " to " + short_number(most));
  return box;
}

/// Means over blocks of the volume around its inside, within a border of one node outside.
struct Reduced {
  GridField field;
  std::array<std::size_t, 3> block{}, first{};  ///< voxels of a node along an axis; first voxel of the first block

  [[nodiscard]] Vec3 index_of(const Vec3& node) const {
    Vec3 out;
    for (int k = 0; k < 3; ++k) {
      const auto axis = static_cast<std::size_t>(k);
      const auto width = static_cast<double>(block[axis]);
      out[k] = static_cast<double>(first[axis]) + (node[k] - 1.0) * width + 0.5 * (width - 1.0);
    }
    return out;
  }
};

Reduced reduce(const Volume& volume, const Choice& choice, const Box& box, double error) {
  constexpr double kBlock = 1.0 / 3.0;  // of the error
  const double length = kBlock * error * (volume.axes * box.extent()).norm();
  Reduced out;
  GridField& field = out.field;
  std::array<std::size_t, 3> last{};
  for (int k = 0; k < 3; ++k) {
    const auto axis = static_cast<std::size_t>(k);
    const std::size_t block = out.block[axis] = static_cast<std::size_t>(std::max(1.0, std::floor(length / volume.axes.col(k).norm())));
    const auto begin = static_cast<std::size_t>(box.lower[k]), end = static_cast<std::size_t>(box.upper[k]) + 1;
    out.first[axis] = begin > block ? begin - block : 0;
    last[axis] = std::min(end + block, volume.count[axis]);
    field.count[axis] = (last[axis] - out.first[axis] + block - 1) / block + 2;
  }
  std::vector<float> weight(field.count[0] * field.count[1] * field.count[2], 0.0F);
  field.value.assign(weight.size(), 0.0F);
  for (std::size_t k = out.first[2]; k < last[2]; ++k) {
    for (std::size_t j = out.first[1]; j < last[1]; ++j) {
      const std::size_t row = (k * volume.count[1] + j) * volume.count[0];
      const std::size_t to = field.at(1, (j - out.first[1]) / out.block[1] + 1, (k - out.first[2]) / out.block[2] + 1);
      for (std::size_t i = out.first[0]; i < last[0]; ++i) {
        const std::size_t node = to + (i - out.first[0]) / out.block[0];
        field.value[node] += static_cast<float>(choice(volume.value[row + i]));
        weight[node] += 1.0F;
      }
    }
  }
  float largest = 0.0F;
  for (std::size_t n = 0; n < weight.size(); ++n) {
    if (weight[n] > 0.0F) field.value[n] = std::max(field.value[n] / weight[n], -std::numeric_limits<float>::max());
    largest = std::max(largest, field.value[n]);
  }
  for (std::size_t n = 0; n < weight.size(); ++n) {
    if (weight[n] == 0.0F) field.value[n] = -std::max(largest, std::numeric_limits<float>::min());
  }
  return out;
}

/// One piece without cavities.
void clean(const std::filesystem::path& file, GridField& field, const FitOptions& options, Repair& repair) {
  std::vector<std::uint32_t> part;
  const std::vector<std::size_t> size = parts_of(field, true, part);
  repair.pieces = size.size();
  if (size.empty()) refuse(file, "expected an inside thicker than a third of the error", "none", "ask for a smaller --error");
  if (size.size() > 1 && options.pieces == Pieces::Refuse) refuse(file, "expected voxels in one piece", std::to_string(size.size()) + " pieces", kPiecesHint);
  const std::size_t kept = piece_of(file, std::vector<double>(size.begin(), size.end()), options.pieces == Pieces::Refuse ? 1 : options.piece);
  for (std::size_t n = 0; n < part.size(); ++n) {
    if (part[n] != kept && part[n] != kNoPart) field.value[n] = -field.value[n];
  }
  repair.cavities = fill_cavities(field);
}

}  // namespace

void expect_voxels(const std::filesystem::path& file, const std::array<double, 3>& count) {
  const double all = count[0] * count[1] * count[2];
  const std::string found = short_number(count[0]) + " x " + short_number(count[1]) + " x " + short_number(count[2]);
  if (!(count[0] >= 2.0 && count[1] >= 2.0 && count[2] >= 2.0)) refuse(file, "expected a volume of at least two voxels along each axis", found, "");
  if (!(all <= kMostVoxels)) refuse(file, "expected at most " + short_number(kMostVoxels) + " voxels", found, "crop the volume, or make it coarser", ErrorKind::Limit);
}

void expect_axes(const std::filesystem::path& file, const Volume& volume) {
  const double product = volume.axes.col(0).norm() * volume.axes.col(1).norm() * volume.axes.col(2).norm();
  const bool good = volume.axes.allFinite() && volume.origin.allFinite() && std::abs(volume.axes.determinant()) > 1e-6 * product && product > 0.0;
  if (good) return;
  refuse(file, "expected distances of voxels above 0 along axes that do not lie in a plane",
         short_number(volume.axes.col(0).norm()) + ", " + short_number(volume.axes.col(1).norm()) + ", " + short_number(volume.axes.col(2).norm()) + " m", "");
}

Mesh surface_of_volume(const std::filesystem::path& file, Volume volume, const FitOptions& options, Repair& repair, const Executor& executor) {
  const Choice choice(file, volume, options.volume);
  repair.voxels = volume.size();
  const Box box = inside_box(file, volume, choice);
  for (int k = 0; k < 3; ++k) repair.cut = repair.cut || box.lower[k] == 0.0 || box.upper[k] == static_cast<double>(volume.count[static_cast<std::size_t>(k)] - 1);
  heed_scope();
  Reduced reduced = reduce(volume, choice, box, options.error);
  volume.value = {};
  clean(file, reduced.field, options, repair);
  heed_scope();
  Mesh mesh = surface_of_grid(reduced.field, executor);
  for (Vec3& p : mesh.position) p = volume.origin + volume.axes * reduced.index_of(p);
  return mesh;
}

}  // namespace supple::fit
