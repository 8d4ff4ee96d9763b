/// @file named_files.h
/// Files that scenes name. A scene may come from a stranger: it reads regular files of its own folder only, and those that the caller allows.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace supple::scenes {

/// From where a scene may read files.
struct FileAccess {
  std::filesystem::path folder;                ///< of the scene; relative names begin there
  std::vector<std::filesystem::path> allowed;  ///< files and folders elsewhere
};

inline constexpr const char* kInsideFolder = "expected a file inside the scene's folder";
/// Hint for a file elsewhere.
inline constexpr const char* kAllowHint = "--allow-path allows a file or folder elsewhere";

/// Whether a scene may read this file, or could if it existed: without links and "..", its path is in the folder or in an allowed one.
/// @param path  as a program opens it
[[nodiscard]] bool may_read(const FileAccess& files, const std::filesystem::path& path);
/// Whether a text may stand for a file in a scene: a relative name without "..", or one that is allowed; without control characters.
[[nodiscard]] bool may_name(const FileAccess& files, std::string_view text);

/// @throws Error{Io} where a scene may not read this file, and where it is a pipe, a device or a folder: reading it may never end
void expect_readable(const FileAccess& files, const std::filesystem::path& path);
/// Path of a file that a scene names. @throws as `expect_readable`
[[nodiscard]] std::filesystem::path named_file(const FileAccess& files, const std::string& name);
/// The same, but empty where that throws and where the file is absent.
[[nodiscard]] std::filesystem::path readable_file(const FileAccess& files, const std::string& name);

/// Hashes of the content of files, regardless of their names; each file is read once.
class FileHashes {
 public:
  /// @param files  outlives the hashes
  explicit FileHashes(const FileAccess& files) : files_(files) {}
  /// "content HASH"; "absent" or "too large" for a file that is reported where it is used
  [[nodiscard]] const std::string& of(const std::string& name);

 private:
  const FileAccess& files_;
  std::map<std::string, std::string> known_;
};

}  // namespace supple::scenes
