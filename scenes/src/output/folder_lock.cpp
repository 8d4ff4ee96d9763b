#include "output/folder_lock.h"

#include <fcntl.h>
#include <sys/file.h>

#include <cerrno>
#include <system_error>

#include "supple/core/error.h"

namespace supple::scenes {

FolderLock::FolderLock(const std::filesystem::path& folder) {
  const std::filesystem::path path = folder / ".lock";
  file_ = io::open_file(path, O_RDWR | O_CREAT | O_NOFOLLOW, 0644);
  if (!file_.is_open()) {
    throw Error(ErrorKind::Io, Fault{.place = path.string(),
                                     .key = {},
                                     .expected = "expected a file that can be written",
                                     .found = std::system_category().message(errno),
                                     .hint = "it holds the folder for one run; remove it, or choose another --out"});
  }
  if (io::retried([this] { return flock(file_.get(), LOCK_EX | LOCK_NB); }) != 0) {
    throw Error(ErrorKind::Io, Fault{.place = folder.string(),
                                     .key = {},
                                     .expected = "expected an output folder that no other run uses",
                                     .found = "one that is locked",
                                     .hint = "wait for the other run or choose another --out"});
  }
}

}  // namespace supple::scenes
