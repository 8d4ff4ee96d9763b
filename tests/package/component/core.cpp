// A loop on two threads, and a hash of what it gives.
#include <supple/core/executor.h>
#include <supple/core/hash.h>

#include <vector>

int main() {
  std::vector<double> squares(1000);
  supple::Executor(2).for_blocks(squares.size(), 100, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) squares[i] = static_cast<double>(i * i);
  });
  return squares[31] == 961.0 ? 0 : 1;
}
