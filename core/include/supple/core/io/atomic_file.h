/// @file supple/core/io/atomic_file.h
/// Files that exist are complete: content goes to a temporary name beside the target and is renamed when it is complete.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "supple/core/io/descriptor.h"
#include "supple/core/io/open_temporaries.h"

namespace supple::io {

/// Writes `bytes` under `path` by temporary file, fsync and rename.
/// @throws Error{Io} naming the path and the system's reason; no file remains under either name then.
void write_atomically(const std::filesystem::path& path, std::span<const std::byte> bytes);
void write_atomically(const std::filesystem::path& path, std::string_view text);

/// A file that is written in parts and gets its name when it is complete. Without commit no file remains.
class AtomicFile {
 public:
  /// @throws Error{Io}
  explicit AtomicFile(std::filesystem::path path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  void append(std::span<const std::byte> bytes);  ///< @throws Error{Io}
  void append(std::string_view text);
  /// Fsync and rename. @throws Error{Io}; no file remains under either name then. @pre not called before
  void commit();

 private:
  void write(std::span<const std::byte> bytes);

  std::filesystem::path path_, temporary_;
  OpenTemporary open_;
  std::vector<std::byte> buffer_;
  Descriptor descriptor_;
};

/// Largest file of points, meshes or pictures that scenes read [byte].
inline constexpr std::size_t kLargestInput = std::size_t{1} << 29;

/// A hidden name beside `path` that no process has used before: .NAME.PROCESS-RANDOM.COUNT.tmp
[[nodiscard]] std::filesystem::path temporary_name(const std::filesystem::path& path);

/// Renames a file that another program wrote to its final name, after fsync. @throws Error{Io}; it keeps its first name then.
void rename_whole(const std::filesystem::path& from, const std::filesystem::path& to);

/// Opens a file for reading. None, with errno, where that fails. @throws Error{Io} for pipes, devices and sockets, whose reading may never end
[[nodiscard]] Descriptor open_to_read(const std::filesystem::path& path);

/// Hint for a file that is absent: the name nearest to its own in its folder, "did you mean 'points.csv'?", or the folder that does not exist; else "".
[[nodiscard]] std::string hint_of_absent(const std::filesystem::path& path);

/// The whole file. @throws Error{Io} when it cannot be read or is none of the regular ones, Error{Limit} when it is larger than `limit` bytes.
[[nodiscard]] std::vector<std::byte> read_file(const std::filesystem::path& path, std::size_t limit);

/// Fills `bytes` with the start of a file. @return number of bytes; none, with errno, where it cannot be read @throws as `open_to_read`
[[nodiscard]] std::optional<std::size_t> read_start(const std::filesystem::path& path, std::span<std::byte> bytes);
/// The same of a file that may be absent, which has none. @throws Error{Io} where it is there and cannot be read
[[nodiscard]] std::size_t read_start_if_there(const std::filesystem::path& path, std::span<std::byte> bytes);

/// Creates the folder (and its parents) and checks that files can be made in it. @throws Error{Io} otherwise.
void make_writable_folder(const std::filesystem::path& path);

}  // namespace supple::io
