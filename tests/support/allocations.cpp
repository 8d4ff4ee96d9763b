#include "support/allocations.h"

#include <malloc.h>

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

namespace {

std::atomic<std::uint64_t> count{0}, held{0}, most{0};

void* take(std::size_t size, std::size_t alignment) noexcept {
  count.fetch_add(1, std::memory_order_relaxed);
  void* memory = std::aligned_alloc(alignment, (size / alignment + 1) * alignment);
  if (memory == nullptr) return nullptr;
  const std::uint64_t bytes = malloc_usable_size(memory), now = held.fetch_add(bytes, std::memory_order_relaxed) + bytes;
  std::uint64_t before = most.load(std::memory_order_relaxed);
  while (before < now && !most.compare_exchange_weak(before, now, std::memory_order_relaxed)) {
  }
  return memory;
}

void give_back(void* memory) noexcept {
  if (memory != nullptr) held.fetch_sub(malloc_usable_size(memory), std::memory_order_relaxed);
  std::free(memory);
}

void* take_or_throw(std::size_t size, std::size_t alignment) {
  if (void* memory = take(size, alignment)) return memory;
  throw std::bad_alloc();
}

constexpr std::size_t kDefault = alignof(std::max_align_t);

}  // namespace

// Every form is replaced: a sanitizer's own form of one of them would not match std::free.
using std::align_val_t;
using std::nothrow_t;
using std::size_t;
void* operator new(size_t size) { return take_or_throw(size, kDefault); }
void* operator new[](size_t size) { return take_or_throw(size, kDefault); }
void* operator new(size_t size, align_val_t alignment) { return take_or_throw(size, size_t(alignment)); }
void* operator new[](size_t size, align_val_t alignment) { return take_or_throw(size, size_t(alignment)); }
void* operator new(size_t size, const nothrow_t&) noexcept { return take(size, kDefault); }
void* operator new[](size_t size, const nothrow_t&) noexcept { return take(size, kDefault); }
void* operator new(size_t size, align_val_t alignment, const nothrow_t&) noexcept { return take(size, size_t(alignment)); }
void* operator new[](size_t size, align_val_t alignment, const nothrow_t&) noexcept { return take(size, size_t(alignment)); }
void operator delete(void* memory) noexcept { give_back(memory); }
void operator delete[](void* memory) noexcept { give_back(memory); }
void operator delete(void* memory, size_t) noexcept { give_back(memory); }
void operator delete[](void* memory, size_t) noexcept { give_back(memory); }
void operator delete(void* memory, align_val_t) noexcept { give_back(memory); }
void operator delete[](void* memory, align_val_t) noexcept { give_back(memory); }
void operator delete(void* memory, size_t, align_val_t) noexcept { give_back(memory); }
void operator delete[](void* memory, size_t, align_val_t) noexcept { give_back(memory); }
void operator delete(void* memory, const nothrow_t&) noexcept { give_back(memory); }
void operator delete[](void* memory, const nothrow_t&) noexcept { give_back(memory); }
void operator delete(void* memory, align_val_t, const nothrow_t&) noexcept { give_back(memory); }
void operator delete[](void* memory, align_val_t, const nothrow_t&) noexcept { give_back(memory); }

namespace supple::test {

std::uint64_t allocation_count() noexcept { return count.load(); }

std::uint64_t held_bytes() noexcept { return held.load(); }

std::uint64_t most_bytes(bool from_now) noexcept {
  if (from_now) most = held.load();
  return most.load();
}

}  // namespace supple::test
