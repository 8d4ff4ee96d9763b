/// System calls that fail as if interrupted by signals: for tests of code that repeats them.
#pragma once

namespace supple::test {

/// From now on every other call of this process that opens, reads, writes, syncs or renames a file fails with EINTR, and so does
/// every close, after it has closed. For a process of its own (fork): the effect cannot be undone.
/// @return false where the system has no such filter
[[nodiscard]] bool break_off_calls();

}  // namespace supple::test
