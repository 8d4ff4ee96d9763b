#include "supple/core/counted.h"

namespace supple {

std::string counted(std::size_t count, std::string_view one, std::string_view many) {
  std::string out = std::to_string(count);
  out.append(" ").append(count == 1 || many.empty() ? one : many);
  if (count != 1 && many.empty()) out += 's';
  return out;
}

}  // namespace supple
