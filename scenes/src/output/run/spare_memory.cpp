#include "output/run/spare_memory.h"

#include <atomic>
#include <cstdlib>
#include <new>

namespace supple::scenes {
namespace {

std::atomic<void*> spare{nullptr};
std::atomic<bool> in_use{false};
std::atomic<std::new_handler> earlier_handler{nullptr};

/// As the standard asks of a handler: makes room, or throws.
void give_spare() {
  if (void* memory = spare.exchange(nullptr)) {
    std::free(memory);
    return;
  }
  const std::new_handler next = earlier_handler.load();
  if (next == nullptr) throw std::bad_alloc();
  next();
}

}  // namespace

SpareMemory::SpareMemory(std::size_t bytes) {
  if (in_use.exchange(true)) return;
  void* const memory = std::malloc(bytes);
  if (memory == nullptr) {
    in_use = false;
    throw std::bad_alloc();
  }
  counts_ = true;
  spare = memory;
  earlier_handler = std::set_new_handler(give_spare);
}

SpareMemory::~SpareMemory() {
  if (!counts_) return;
  std::set_new_handler(earlier_handler.load());
  std::free(spare.exchange(nullptr));
  in_use = false;
}

}  // namespace supple::scenes
