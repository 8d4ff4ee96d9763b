#include "mesh/delaunay/patch_complex.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "mesh/partition/polygonise_blocks.h"
#include "supple/core/error.h"

namespace supple::implicit {

using lattice::Label;
using lattice::LabelSet;

PatchComplex::PatchComplex(std::span<const FieldView> fields, std::span<const Mesh> meshes) {
  std::map<std::array<double, 3>, Vertex> number;
  std::map<std::array<Vertex, 3>, std::uint32_t> known;  // by vertices, ascending
  std::vector<Label> grounds;                            // bodies without a mesh
  for (Label m = 0; m < fields.size(); ++m) {
    const Box box = fields[m].surface_box();
    if (!box.empty() && !lattice::is_bounded(box)) grounds.push_back(m + 1);
  }
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    const Mesh& mesh = meshes[m];
    std::vector<Vertex> shared(mesh.vertex_count());
    for (std::size_t v = 0; v < shared.size(); ++v) {
      const Vec3& p = mesh.position[v];
      const auto [at, is_new] = number.try_emplace({p.x(), p.y(), p.z()}, static_cast<Vertex>(position_.size()));
      if (is_new) position_.push_back(p);
      shared[v] = at->second;
    }
    for (const auto& corner : mesh.triangle) {
      Triangle t{.vertex = {shared[corner[0]], shared[corner[1]], shared[corner[2]]}, .inner = static_cast<Label>(m + 1)};
      if (t.vertex[0] == t.vertex[1] || t.vertex[1] == t.vertex[2] || t.vertex[2] == t.vertex[0]) continue;
      std::array<Vertex, 3> key = t.vertex;
      std::sort(key.begin(), key.end());
      const auto [at, is_new] = known.try_emplace(key, static_cast<std::uint32_t>(triangle_.size()));
      if (!is_new && triangle_[at->second].inner != t.inner) {
        triangle_[at->second].outer = t.inner;
        continue;
      }
      const bool touches = std::all_of(corner.begin(), corner.end(), [&](std::uint32_t v) { return mesh.columns.at(0).values[v] != 0.0; });
      if (touches && !grounds.empty()) {
        const Vec3 middle = (position_[key[0]] + position_[key[1]] + position_[key[2]]) / 3.0;
        const double own = fields[m].value(middle);
        for (const Label g : grounds) {
          if (std::abs(own - fields[g - 1].value(middle)) < std::abs(own)) t.outer = g;
        }
      }
      triangle_.push_back(t);
    }
  }
  star_.resize(position_.size());
  for (std::uint32_t t = 0; t < triangle_.size(); ++t) link(t);
  for (Vertex v = 0; v < position_.size(); ++v) {
    const std::size_t boundaries = along_boundaries(v).size();
    place_.push_back(boundaries == 0 ? PatchPlace::Interior : boundaries == 2 ? PatchPlace::Boundary : PatchPlace::Corner);
  }
}

std::array<Vec3, 3> PatchComplex::corners(std::uint32_t t) const {
  const auto& v = triangle_[t].vertex;
  return {position_[v[0]], position_[v[1]], position_[v[2]]};
}

PatchComplex::Around PatchComplex::around(Vertex a, Vertex b) const {
  Around found;
  if (star_[b].size() < star_[a].size()) std::swap(a, b);
  for (const std::uint32_t t : star_[a]) {
    if (!triangle_[t].has(b)) continue;
    SUPPLE_EXPECTS(found.count < Around::kMost);
    found.triangle[found.count++] = t;
  }
  return found;
}

bool PatchComplex::is_boundary(const Around& edge) const {
  return edge.count != 2 || !triangle_[edge.triangle[0]].same_patch(triangle_[edge.triangle[1]]);
}

LabelSet PatchComplex::labels(const Around& edge) const {
  LabelSet set;
  for (const std::uint32_t t : edge.view()) {
    for (const Label l : {triangle_[t].inner, triangle_[t].outer}) {
      if (set.count < set.label.size()) set.insert(l);
    }
  }
  return set;
}

LabelSet PatchComplex::labels(Vertex v) const {
  LabelSet set;
  for (const std::uint32_t t : star_[v]) {
    for (const Label l : {triangle_[t].inner, triangle_[t].outer}) {
      if (set.count < set.label.size()) set.insert(l);
    }
  }
  return set;
}

std::vector<PatchComplex::Vertex> PatchComplex::along_boundaries(Vertex v) const {
  std::vector<Vertex> ends;
  for (const std::uint32_t t : star_[v]) {
    for (const Vertex w : triangle_[t].vertex) {
      if (w != v && std::find(ends.begin(), ends.end(), w) == ends.end() && is_boundary(around(v, w))) ends.push_back(w);
    }
  }
  std::sort(ends.begin(), ends.end());
  return ends;
}

void PatchComplex::link(std::uint32_t t) {
  for (const Vertex v : triangle_[t].vertex) star_[v].push_back(t);
}

void PatchComplex::unlink(std::uint32_t t, Vertex v) { star_[v].erase(std::find(star_[v].begin(), star_[v].end(), t)); }

void PatchComplex::replace(std::uint32_t t, Vertex from, Vertex to) {
  unlink(t, from);
  triangle_[t].vertex[triangle_[t].place_of(from)] = to;
  star_[to].push_back(t);
  ++triangle_[t].version;
}

std::uint32_t PatchComplex::add(const Triangle& t) {
  triangle_.push_back(t);
  const auto number = static_cast<std::uint32_t>(triangle_.size() - 1);
  link(number);
  return number;
}

PatchComplex::Vertex PatchComplex::split(std::uint32_t t, const Vec3& at) {
  const auto v = static_cast<Vertex>(position_.size());
  position_.push_back(at);
  place_.push_back(PatchPlace::Interior);
  star_.emplace_back();
  const Triangle old = triangle_[t];
  replace(t, old.vertex[0], v);
  for (const std::size_t k : {std::size_t{1}, std::size_t{2}}) {
    Triangle part = old;
    part.vertex[k] = v;
    add(part);
  }
  return v;
}

PatchComplex::Vertex PatchComplex::split(Vertex a, Vertex b, const Vec3& at) {
  const Around edge = around(a, b);
  const auto v = static_cast<Vertex>(position_.size());
  position_.push_back(at);
  place_.push_back(is_boundary(edge) ? PatchPlace::Boundary : PatchPlace::Interior);
  star_.emplace_back();
  for (const std::uint32_t t : edge.view()) {
    Triangle part = triangle_[t];
    part.vertex[part.place_of(a)] = v;
    replace(t, b, v);
    add(part);
  }
  return v;
}

void PatchComplex::flip(const Around& edge) {
  const std::uint32_t s = edge.triangle[0], t = edge.triangle[1];
  const auto& v = triangle_[s].vertex;
  std::size_t apex = 0;
  while (triangle_[t].has(v[apex])) ++apex;
  const Vertex a = v[(apex + 1) % 3], b = v[(apex + 2) % 3], top = v[apex];
  const auto& w = triangle_[t].vertex;
  const Vertex bottom = w[0] != a && w[0] != b ? w[0] : w[1] != a && w[1] != b ? w[1] : w[2];
  replace(s, b, bottom);  // top, a, bottom
  replace(t, a, top);     // top, bottom, b
}

void PatchComplex::collapse(Vertex from, Vertex to) {
  const std::vector<std::uint32_t> star = star_[from];
  for (const std::uint32_t t : star) {
    if (!triangle_[t].has(to)) {
      replace(t, from, to);
      continue;
    }
    for (const Vertex v : triangle_[t].vertex) unlink(t, v);
    triangle_[t].alive = false;
    ++triangle_[t].version;
  }
}

}  // namespace supple::implicit
