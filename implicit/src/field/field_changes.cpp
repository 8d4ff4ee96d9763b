#include "field/field_changes.h"

#include <algorithm>
#include <utility>

namespace supple::implicit {
namespace {

// By parts, so that a member that is added cannot be left out.

void add(const ShapeView& view, ContentWords& words) {
  const auto& [kind, size, radius, taper, pair, control, gain] = view;
  words.add(kind);
  words.add(size);
  for (const double x : {radius, taper, pair[0], pair[1], gain}) words.add(x);
  words.add(std::uint64_t{control.size()});
  for (const Vec3& c : control) words.add(c);
}

void add(const PackedShape& shape, ContentWords& words) {
  const auto& [to_local, half, kernel, outer_cubic, outer_square, distance_scale, peak, lipschitz, foot, view, rounding] = shape;
  for (const double x : to_local) words.add(x);
  for (const double x : half) words.add(x);
  add_content(kernel, words);
  for (const double x : {outer_cubic, outer_square, distance_scale, peak, lipschitz}) words.add(x);
  words.add(foot);
  add(view, words);
  words.add(rounding);
}

void add(const PackedPrimitive& primitive, ContentWords& words) {
  const auto& [position, inverse_r2, gradient_factor, kind, part] = primitive;
  for (const double x : position) words.add(x);
  words.add(inverse_r2);
  words.add(gradient_factor);
  words.add(kind);
  words.add(part);
}

/// Hessians, which the gradients of a blend by gradients take, are cut off at the box of the support.
Reach reach_of(const Field::Index& index, std::size_t id) {
  Reach reach{index.rounded[id], index.support[id]};
  if (index.blend.rule() != BlendRule::Gradient) return reach;
  for (std::size_t k = 0; k < 3; ++k) {
    reach.rounded.lower[k] = reach.whole.lower[static_cast<Eigen::Index>(k)];
    reach.rounded.upper[k] = reach.whole.upper[static_cast<Eigen::Index>(k)];
  }
  reach.rounded.reach2 = 0.0;
  return reach;
}

}  // namespace

void FieldChanges::Content::fill(const Field::Index& index) {
  words.clear();
  end.clear();
  reach.clear();
  for (std::size_t i = 0; i < index.size(); ++i) {
    add(index.primitive[i], words);
    add(index.shape[i], words);
    reach.push_back(reach_of(index, i));
    const auto& [rounded, whole] = reach.back();
    for (std::size_t k = 0; k < 3; ++k) {
      words.add(rounded.lower[k]);
      words.add(rounded.upper[k]);
    }
    words.add(rounded.reach2);
    words.add(whole.lower);
    words.add(whole.upper);
    end.push_back(words.view().size());
  }
}

void FieldChanges::update(const Field::Index& index) {
  std::swap(last_, now_);
  now_.fill(index);
  reaches_.clear();
  all_ = !known_ || iso_ != index.iso || !(blend_ == index.blend);
  if (all_) {
    iso_ = index.iso;
    blend_ = index.blend;
    known_ = true;
    return;
  }
  const std::size_t before = last_.reach.size(), now = now_.reach.size();
  for (std::size_t i = 0; i < std::max(before, now); ++i) {
    if (i < std::min(before, now) && std::ranges::equal(last_.of(i), now_.of(i))) continue;
    if (i < before) reaches_.push_back(last_.reach[i]);
    if (i < now) reaches_.push_back(now_.reach[i]);
  }
  all_ = reaches_.size() > std::max(before, now);  // half of them moved
}

std::size_t FieldChanges::bytes() const {
  const auto held = [](const Content& content) {
    return content.words.view().size() * sizeof(std::uint64_t) + content.end.capacity() * sizeof(std::size_t) +
           content.reach.capacity() * sizeof(Reach);
  };
  return held(last_) + held(now_) + reaches_.capacity() * sizeof(Reach);
}

}  // namespace supple::implicit
