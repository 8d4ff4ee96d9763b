/// @file tests/support/allocations.h
/// Counts what a test program takes from the heap.
#pragma once

#include <cstdint>

namespace supple::test {

/// Calls of operator new so far, by all threads together.
[[nodiscard]] std::uint64_t allocation_count() noexcept;

}  // namespace supple::test
