#include "installed_program.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "supple/core/error.h"

namespace supple::tool {

namespace fs = std::filesystem;

fs::path installed_program(const std::string& name) {
  const fs::path folder = fs::read_symlink("/proc/self/exe").parent_path();
  for (const fs::path& program : {folder / name, folder.parent_path() / "libexec/supple" / name}) {
    if (fs::exists(program)) return program;
  }
  return {};
}

void become_program(const fs::path& program, std::vector<std::string> words) {
  words.insert(words.begin(), program.string());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  execv(program.c_str(), argv.data());
  throw Error(ErrorKind::Io, Fault{.place = program.string(), .key = {}, .expected = "cannot be started: " + std::string(std::strerror(errno)), .found = {}, .hint = {}});
}

}  // namespace supple::tool
