#include "pairs/body_order.h"

#include <algorithm>
#include <array>

#include "supple/core/content_versions.h"

namespace supple::collision {

bool leads(const ContactBody& one, const ContactBody& other) {
  if (one.fixed != other.fixed) return other.fixed;
  const double size = one.field.feature_size(), other_size = other.field.feature_size();
  if (size != other_size) return size < other_size;
  if (one.material.modulus != other.material.modulus) return one.material.modulus < other.material.modulus;
  if (one.skeleton == nullptr || other.skeleton == nullptr) return true;
  const Vec3 way = first_place(other) - first_place(one);
  const auto key = [&way](const ContactBody& body) { return (body.pose.front().orientation.conjugate() * way).array().square().square().sum(); };
  return key(one) <= key(other);
}

bool coincide(const ContactBody& one, const ContactBody& other) {
  if (one.skeleton == nullptr || other.skeleton == nullptr || one.material.modulus != other.material.modulus) return false;
  const auto same = [](const Pose& p, const Pose& q) { return p.position == q.position && p.orientation.coeffs() == q.orientation.coeffs(); };
  if (!std::equal(one.pose.begin(), one.pose.end(), other.pose.begin(), other.pose.end(), same)) return false;
  std::array<ContentWords, 2> words;
  for (const std::size_t side : {0u, 1u}) {
    const ContactBody& body = side == 0 ? one : other;
    implicit::PlacedSkeleton placed;
    implicit::place_skeleton(*body.skeleton, body.pose, placed);
    implicit::add_content(*body.skeleton, placed, words[side]);
  }
  return std::equal(words[0].view().begin(), words[0].view().end(), words[1].view().begin(), words[1].view().end());
}

Pose common_pose(const ContactBody& leading, const ContactBody& other) {
  for (const ContactBody* body : {&leading, &other}) {
    if (body->skeleton != nullptr) return body->pose.front();
  }
  return {first_place(leading), Quat::Identity()};
}

}  // namespace supple::collision
