#include "file/scene_places.h"

#include <span>
#include <system_error>

#include "supple/core/io/atomic_file.h"

namespace supple::scenes {

std::string place_of(const Scene& scene, std::string_view key) {
  if (scene.places == nullptr) return scene.source.string();
  return scene.places->texts.place(mark_of(*scene.places->root, key));
}

std::filesystem::path named_file(const std::filesystem::path& folder, const std::string& name) {
  std::filesystem::path path = folder / name;
  std::error_code unknown;
  const std::filesystem::file_status status = std::filesystem::status(path, unknown);
  if (!std::filesystem::exists(status) || std::filesystem::is_regular_file(status)) return path;  // an absent file is reported by its reader
  throw Error(ErrorKind::Io, Fault{.place = path.string(),
                                   .key = {},
                                   .expected = "expected a regular file",
                                   .found = std::filesystem::is_directory(status) ? "a folder"
                                            : std::filesystem::is_fifo(status)    ? "a pipe"
                                                                                  : "a device or a socket",
                                   .hint = {}});
}

std::optional<std::string> read_text(const std::filesystem::path& path) {
  std::string text(kLargestText + 1, '\0');
  const auto size = io::read_start(path, std::as_writable_bytes(std::span(text)));
  if (!size) return std::nullopt;
  text.resize(*size);
  return text;
}

void rethrow_with_places(const Scene& scene, const Error& error) {
  std::vector<Fault> faults = error.faults();
  for (Fault& fault : faults) {
    if (fault.place.empty()) fault.place = place_of(scene, fault.key);
  }
  throw Error(error.kind(), std::move(faults));
}

}  // namespace supple::scenes
