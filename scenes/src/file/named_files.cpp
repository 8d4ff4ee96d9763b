#include "file/named_files.h"

#include <unistd.h>

#include <algorithm>
#include <system_error>
#include <utility>

#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/core/io/atomic_file.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

/// Without links and dots; the end need not exist. Empty on failure, as for links in a circle.
fs::path resolved(const fs::path& path) {
  std::error_code failed;
  fs::path real = fs::weakly_canonical(fs::absolute(path.empty() ? fs::path(".") : path, failed), failed);
  return failed ? fs::path() : real;
}

bool lies_in(const fs::path& real, const fs::path& around) {
  const fs::path top = resolved(around);
  return !top.empty() && std::mismatch(top.begin(), top.end(), real.begin(), real.end()).first == top.end();
}

std::string content_text(const fs::path& path) {
  if (path.empty()) return "absent";
  std::error_code status;
  if (fs::file_size(path, status) > io::kLargestInput) return "too large";
  const io::Descriptor file = io::open_to_read(path);
  std::string part(std::size_t{1} << 20, '\0');  // bytes in memory at a time
  Hasher hasher;
  for (bool whole = false; !whole;) {
    std::size_t used = 0;
    while (!whole && used < part.size()) {
      const ssize_t count = io::retried([&] { return ::read(file.get(), part.data() + used, part.size() - used); });
      whole = count <= 0;
      if (!whole) used += static_cast<std::size_t>(count);
    }
    hasher.add(std::string_view(part).substr(0, used));
  }
  return "content " + to_hex(hasher.value());
}

}  // namespace

bool may_read(const FileAccess& files, const fs::path& path) {
  const fs::path real = resolved(path);
  return !real.empty() && (lies_in(real, files.folder) ||
                           std::any_of(files.allowed.begin(), files.allowed.end(), [&](const fs::path& allowed) { return lies_in(real, allowed); }));
}

bool may_name(const FileAccess& files, std::string_view text) {
  const bool odd = std::any_of(text.begin(), text.end(), [](char c) { return (c >= 0 && c < 0x20) || c == 0x7F; });
  if (text.empty() || odd) return false;
  const fs::path file(text);
  const bool below = file.is_relative() && std::find(file.begin(), file.end(), "..") == file.end();
  return below || (!files.allowed.empty() && may_read(files, files.folder / file));
}

void expect_readable(const FileAccess& files, const fs::path& path) {
  const auto fail = [&](std::string expected, std::string found, std::string hint) {
    throw Error(ErrorKind::Io, Fault{.place = path.string(), .key = {}, .expected = std::move(expected), .found = std::move(found), .hint = std::move(hint)});
  };
  if (!may_read(files, path)) {
    const fs::path below = path.lexically_normal().lexically_relative(files.folder.lexically_normal());
    const bool outside = !files.folder.empty() ? below.empty() || *below.begin() == ".." : path.is_absolute();
    fail(kInsideFolder, outside ? "one outside of it" : "a link to another place", kAllowHint);
  }
  std::error_code unknown;
  const fs::file_status status = fs::status(path, unknown);
  if (!fs::exists(status) || fs::is_regular_file(status)) return;  // an absent file is reported by its reader
  fail("expected a regular file", fs::is_directory(status) ? "a folder" : fs::is_fifo(status) ? "a pipe" : "a device or a socket", "");
}

fs::path named_file(const FileAccess& files, const std::string& name) {
  fs::path path = files.folder / name;
  expect_readable(files, path);
  return path;
}

fs::path readable_file(const FileAccess& files, const std::string& name) {
  fs::path path = files.folder / name;
  std::error_code unknown;
  return fs::is_regular_file(path, unknown) && may_read(files, path) ? path : fs::path();
}

const std::string& FileHashes::of(const std::string& name) {
  const auto [at, fresh] = known_.try_emplace(name);
  if (fresh) at->second = content_text(readable_file(files_, name));
  return at->second;
}

}  // namespace supple::scenes
