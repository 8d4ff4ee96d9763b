#include "mesh/triangle_steps.h"

namespace supple::implicit {

std::uint32_t TriangleSteps::replace(std::span<const std::uint32_t> taken, std::span<const Triangle> made) {
  const auto number = static_cast<std::uint32_t>(step_.size()), first = static_cast<std::uint32_t>(triangle_.size());
  const auto taken_first = static_cast<std::uint32_t>(taken_.size());
  for (const std::uint32_t t : taken) taker_[t] = number;
  taken_.insert(taken_.end(), taken.begin(), taken.end());
  triangle_.insert(triangle_.end(), made.begin(), made.end());
  taker_.resize(triangle_.size(), kNone);
  maker_.resize(triangle_.size() - first_made_, number);
  step_.push_back({first, static_cast<std::uint32_t>(triangle_.size()), taken_first, static_cast<std::uint32_t>(taken_.size())});
  return first;
}

void TriangleSteps::take_back(std::uint32_t step, std::vector<std::uint32_t>& back) {
  const Step own = step_[step];
  for (std::uint32_t t = own.made; t < own.made_end; ++t) {
    if (taker_[t] != kNone) take_back(taker_[t], back);
    taker_[t] = kUndone;
  }
  for (std::uint32_t i = own.taken; i < own.taken_end; ++i) {
    taker_[taken_[i]] = kNone;
    back.push_back(taken_[i]);
  }
}

std::vector<std::uint32_t> TriangleSteps::numbers() const {
  std::vector<std::uint32_t> numbers;
  for (std::uint32_t t = 0; t < triangle_.size(); ++t) {
    if (is_there(t)) numbers.push_back(t);
  }
  return numbers;
}

}  // namespace supple::implicit
