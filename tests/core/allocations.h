// Counts what this test program takes from the heap, all threads together.
#pragma once

#include <cstdint>

namespace supple::core::test {

/// Calls of operator new so far.
[[nodiscard]] std::uint64_t allocation_count() noexcept;

}  // namespace supple::core::test
