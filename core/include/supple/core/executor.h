/// @file supple/core/executor.h
/// Threads, passed in and never global. Work is divided into blocks whose size is a constant of the algorithm, so a result
/// cannot depend on the number of threads (docs/determinism.md).
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace supple {

class Executor {
 public:
  /// @param threads  number of threads, >= 1; 0: all of the machine
  explicit Executor(int threads = 1);
  ~Executor();
  Executor(const Executor&) = delete;
  Executor& operator=(const Executor&) = delete;

  [[nodiscard]] int threads() const noexcept;

  /// Calls body(begin, end) for the consecutive blocks [0, block), [block, 2 block) ... of [0, n), in any order and
  /// possibly at the same time. The first exception in block order is rethrown after all blocks ended.
  /// After an interrupt of the calling thread's InterruptScope, blocks that have not begun throw Interrupted instead.
  /// @pre block > 0
  void for_blocks(std::size_t n, std::size_t block, const std::function<void(std::size_t, std::size_t)>& body) const;

  /// Runs `body` inside the executor's arena, so that library code that uses TBB stays within its threads.
  void run(const std::function<void()>& body) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace supple
