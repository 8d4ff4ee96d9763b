#include "body_order.h"

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

Pose common_pose(const ContactBody& leading, const ContactBody& other) {
  for (const ContactBody* body : {&leading, &other}) {
    if (body->skeleton != nullptr) return body->pose.front();
  }
  return {first_place(leading), Quat::Identity()};
}

}  // namespace supple::collision
