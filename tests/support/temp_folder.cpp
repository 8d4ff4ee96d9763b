#include "support/temp_folder.h"

#include <cerrno>
#include <stdlib.h>
#include <unistd.h>

#include <string>
#include <system_error>

namespace supple {
namespace {

class ProcessFolder {
 public:
  ProcessFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "supple_test_XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw std::filesystem::filesystem_error("mkdtemp", name, std::error_code(errno, std::generic_category()));
    path_ = name;
  }
  ~ProcessFolder() {
    std::error_code ignored;
    if (::getpid() == owner_) std::filesystem::remove_all(path_, ignored);  // a forked child leaves it to its parent
  }
  ProcessFolder(const ProcessFolder&) = delete;
  ProcessFolder& operator=(const ProcessFolder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  pid_t owner_ = ::getpid();
};

}  // namespace

const std::filesystem::path& temp_folder() {
  static const ProcessFolder folder;
  return folder.path();
}

}  // namespace supple
