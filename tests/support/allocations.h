/// @file tests/support/allocations.h
/// Counts the heap allocations of a test program.
#pragma once

#include <cstdint>

namespace supple::test {

/// Calls of operator new so far, by all threads.
[[nodiscard]] std::uint64_t allocation_count() noexcept;

/// Allocated bytes that are not freed.
[[nodiscard]] std::uint64_t held_bytes() noexcept;

/// Largest value of these since the start of the program. @param from_now  restart from the present value
std::uint64_t most_bytes(bool from_now = false) noexcept;

}  // namespace supple::test
