/// @file tests/support/allocations.h
/// Counts what a test program takes from the heap.
#pragma once

#include <cstdint>

namespace supple::test {

/// Calls of operator new so far, by all threads together.
[[nodiscard]] std::uint64_t allocation_count() noexcept;

/// Bytes that are taken and not given back.
[[nodiscard]] std::uint64_t held_bytes() noexcept;

/// The most of them since the start of the program. @param from_now  begin anew
std::uint64_t most_bytes(bool from_now = false) noexcept;

}  // namespace supple::test
