/// System calls that signals break off, without signals: for tests of what is made again.
#pragma once

namespace supple::test {

/// From now on every other call of this process that opens, reads, writes, syncs or renames a file fails with EINTR, and so does
/// every close, after it has closed. For a process of its own (fork): there is no way back.
/// @return false where the system has no such filter
[[nodiscard]] bool break_off_calls();

}  // namespace supple::test
