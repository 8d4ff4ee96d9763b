#include "supple/core/executor.h"

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <exception>
#include <limits>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "supple/core/out_of_threads.h"

namespace supple {
namespace {

/// TBB names the call of the system that failed.
bool lacks_threads(const std::runtime_error& error) { return std::string_view(error.what()).find("pthread_create") != std::string_view::npos; }

int machine_threads() { return std::max(1, static_cast<int>(std::thread::hardware_concurrency())); }

/// Keeps the exception of the lowest block.
class FirstFailure {
 public:
  void keep(std::size_t block, std::exception_ptr exception) {
    const std::lock_guard lock(mutex_);
    if (block < block_) {
      block_ = block;
      exception_ = std::move(exception);
    }
  }
  void rethrow() const {
    if (exception_) std::rethrow_exception(exception_);
  }

 private:
  std::mutex mutex_;
  std::size_t block_ = std::numeric_limits<std::size_t>::max();
  std::exception_ptr exception_;
};

}  // namespace

struct Executor::Impl {
  explicit Impl(int count) : threads(count), arena(count) {
    // TBB never runs more threads than the machine has unless it is allowed to.
    if (count > machine_threads()) {
      allowance.emplace(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(count));
    }
  }
  int threads;
  std::optional<tbb::global_control> allowance;
  mutable tbb::task_arena arena;
};

Executor::Executor(int threads) {
  SUPPLE_EXPECTS(threads >= 0);
  impl_ = std::make_unique<Impl>(threads == 0 ? machine_threads() : threads);
}

Executor::~Executor() = default;

int Executor::threads() const noexcept { return impl_->threads; }

void Executor::for_blocks(std::size_t n, std::size_t block,
                          const std::function<void(std::size_t, std::size_t)>& body) const {
  SUPPLE_EXPECTS(block > 0);
  if (n == 0) return;
  const std::size_t blocks = (n - 1) / block + 1;
  FirstFailure failure;
  const std::atomic<int>* const interrupt = interrupt_of_scope();
  const auto run_block = [&](std::size_t index) {
    try {
      const InterruptScope scope(interrupt);
      heed_scope();
      const std::size_t begin = index * block;
      body(begin, n - begin < block ? n : begin + block);
    } catch (...) {
      failure.keep(index, std::current_exception());
    }
  };
  if (impl_->threads == 1 || blocks == 1) {
    for (std::size_t index = 0; index < blocks; ++index) run_block(index);
  } else {
    // Every thread begins with a share of its own, the same one in every loop of so many blocks, so that it finds what it
    // wrote before; then it helps the others, a block at a time.
    struct alignas(64) Share {
      std::atomic<std::size_t> next{0};
      std::size_t end = 0;
    };
    const std::size_t workers = std::min(static_cast<std::size_t>(impl_->threads), blocks);
    constexpr std::size_t kMostShares = 32;  // nothing is allocated for them
    std::array<Share, kMostShares> shares;
    const std::size_t count = std::min(workers, kMostShares);
    for (std::size_t k = 0; k < count; ++k) {
      shares[k].next.store(k * blocks / count, std::memory_order_relaxed);
      shares[k].end = (k + 1) * blocks / count;
    }
    // Explicit memory order: TBB guarantees it too, but the thread sanitizer cannot see that. Two of them, so that
    // no block seems to come after another.
    std::atomic<bool> begun{false};
    std::atomic<std::size_t> done{0};
    begun.store(true, std::memory_order_release);
    const auto work = [&](std::size_t own) {
      static_cast<void>(begun.load(std::memory_order_acquire));
      for (std::size_t k = 0; k < count; ++k) {
        Share& share = shares[(own + k) % count];
        for (std::size_t index; (index = share.next.fetch_add(1, std::memory_order_relaxed)) < share.end;) run_block(index);
      }
      done.fetch_add(1, std::memory_order_release);
    };
    try {
      impl_->arena.execute([&] {
        tbb::parallel_for(
            tbb::blocked_range<std::size_t>(0, workers, 1),
            [&](const tbb::blocked_range<std::size_t>&) { work(static_cast<std::size_t>(tbb::this_task_arena::current_thread_index())); },
            tbb::simple_partitioner());
      });
    } catch (const std::runtime_error& error) {  // blocks keep theirs
      if (!lacks_threads(error)) throw;
      work(0);  // the machine has no more threads: this one does what is left
    }
    static_cast<void>(done.load(std::memory_order_acquire));
  }
  failure.rethrow();
}

void Executor::run(const std::function<void()>& body) const try {
  impl_->arena.execute([&] { body(); });
} catch (const std::runtime_error& error) {
  if (!lacks_threads(error)) throw;
  throw_out_of_threads();
}

}  // namespace supple
