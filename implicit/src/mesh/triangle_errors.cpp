#include "mesh/triangle_errors.h"

#include <algorithm>
#include <span>
#include <utility>

#include "mesh/error_search.h"
#include "mesh/same_triangles.h"
#include "supple/core/error.h"

namespace supple::implicit {
double TriangleErrors::measure(const FieldView& field, const Mesh& mesh, const Mesh& last, bool nothing,
                               const std::function<bool(const Box&)>& differs, const Executor& executor) {
  SUPPLE_EXPECTS(nothing || found_.size() == last.triangle_count());
  const std::vector<Found> known = std::exchange(found_, std::vector<Found>(mesh.triangle_count()));
  const std::vector<Box> known_wide = std::exchange(wide_, {});
  std::vector<std::uint32_t> fresh;
  std::vector<std::uint32_t> same;
  if (!nothing) same = same_triangles(mesh, last, same_vertices(mesh, last));
  for (std::size_t i = 0; i < mesh.triangle_count(); ++i) {
    const std::uint32_t of_last = nothing ? kNone : same[i];
    if (of_last != kNone) {
      Found found = known[of_last];
      const auto& t = mesh.triangle[i];
      const Vec3 centre = (mesh.position[t[0]] + mesh.position[t[1]] + mesh.position[t[2]]) / 3.0;
      const Box evaluated = found.wide != kNone ? known_wide[found.wide] : Box{centre, centre};
      if (!differs(evaluated)) {
        if (found.wide != kNone) {
          found.wide = static_cast<std::uint32_t>(wide_.size());
          wide_.push_back(evaluated);
        }
        found_[i] = found;
        continue;
      }
    }
    fresh.push_back(static_cast<std::uint32_t>(i));
  }
  std::vector<double> error(fresh.size());
  std::vector<Box> evaluated(fresh.size());
  constexpr std::size_t kPerTask = 512;
  executor.for_blocks(fresh.size(), kPerTask, [&](std::size_t begin, std::size_t end) {
    const std::size_t n = end - begin;
    centroid_errors(field, mesh, std::span(fresh).subspan(begin, n), std::span(error).subspan(begin, n), std::span(evaluated).subspan(begin, n));
  });
  for (std::size_t j = 0; j < fresh.size(); ++j) {
    Found& found = found_[fresh[j]];
    found.error = error[j];
    if (evaluated[j].lower == evaluated[j].upper) continue;
    found.wide = static_cast<std::uint32_t>(wide_.size());
    wide_.push_back(evaluated[j]);
  }
  double largest = 0.0;
  for (const Found& found : found_) largest = std::max(largest, found.error);
  return largest;
}

}  // namespace supple::implicit
