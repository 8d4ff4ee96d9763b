#include "support/allocations.h"

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

namespace {

std::atomic<std::uint64_t> count{0};

void* take(std::size_t size, std::size_t alignment) noexcept {
  count.fetch_add(1, std::memory_order_relaxed);
  return std::aligned_alloc(alignment, (size / alignment + 1) * alignment);
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
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, size_t) noexcept { std::free(memory); }
void operator delete(void* memory, align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, size_t, align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, size_t, align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, const nothrow_t&) noexcept { std::free(memory); }
void operator delete[](void* memory, const nothrow_t&) noexcept { std::free(memory); }
void operator delete(void* memory, align_val_t, const nothrow_t&) noexcept { std::free(memory); }
void operator delete[](void* memory, align_val_t, const nothrow_t&) noexcept { std::free(memory); }

namespace supple::test {

std::uint64_t allocation_count() noexcept { return count.load(); }

}  // namespace supple::test
