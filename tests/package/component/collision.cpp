// Which of three boxes overlap.
#include <supple/collision/find_contacts.h>

#include <array>

int main() {
  using supple::Box;
  using supple::Vec3;
  const std::array boxes = {Box{Vec3(0, 0, 0), Vec3(1, 1, 1)}, Box{Vec3(0.5, 0.5, 0.5), Vec3(2, 2, 2)}, Box{Vec3(3, 0, 0), Vec3(4, 1, 1)}};
  return supple::collision::overlapping_boxes(boxes, supple::Executor(1)).size() == 1 ? 0 : 1;
}
