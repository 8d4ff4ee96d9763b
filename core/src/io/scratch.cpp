#include "io/scratch.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <span>
#include <string>
#include <system_error>

#include "supple/core/error.h"

namespace supple::io {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, int code) {
  throw Error(ErrorKind::Io, Fault{.place = path.string(),
                                   .key = {},
                                   .expected = "cannot be written: " + std::system_category().message(code),
                                   .found = {},
                                   .hint = {}});
}

}  // namespace

Scratch::Scratch(const std::filesystem::path& beside) : path_(beside) {
  const std::filesystem::path name = temporary_name(beside);
  file_ = open_file(name, O_RDWR | O_CREAT | O_EXCL, 0600);
  if (!file_.is_open()) fail(path_, errno);
  ::unlink(name.c_str());
}

Piece Scratch::append(std::string_view bytes) {
  if (const int code = write_all_at(file_.get(), std::as_bytes(std::span(bytes)), size_)) fail(path_, code);
  const Piece piece{size_, bytes.size()};
  size_ += static_cast<off_t>(bytes.size());
  return piece;
}

void Scratch::copy_to(AtomicFile& out, const Piece& piece) {
  constexpr std::size_t kBlock = std::size_t{1} << 20;
  std::string bytes;
  for (std::size_t done = 0; done < piece.size; done += bytes.size()) {
    bytes.resize(std::min(kBlock, piece.size - done));
    if (const int code = read_all_at(file_.get(), std::as_writable_bytes(std::span(bytes)), piece.at + static_cast<off_t>(done))) fail(path_, code);
    out.append(bytes);
  }
}

}  // namespace supple::io
