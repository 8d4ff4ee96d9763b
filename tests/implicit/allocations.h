/// @file tests/implicit/allocations.h
/// Counts what this test program takes from the heap.
#pragma once

#include <cstdint>

namespace supple::testing {

/// Calls of operator new by this thread so far.
[[nodiscard]] std::uint64_t allocation_count() noexcept;

}  // namespace supple::testing
