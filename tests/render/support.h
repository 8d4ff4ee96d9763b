/// @file support.h
/// Folders, messages and pixels for the tests of the pictures.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <string>

#include "supple/core/error.h"
#include "supple/render/image.h"
#include "support/temp_folder.h"

namespace supple::render::test {

/// An empty folder that is removed at the end.
class Folder {
 public:
  Folder() : path_(temp_folder() / "render") {
    std::filesystem::remove_all(path_);
    std::filesystem::create_directories(path_);
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::size_t file_count() const {
    std::size_t count = 0;
    for (const auto& entry : std::filesystem::directory_iterator(path_)) count += entry.is_regular_file() ? 1 : 0;
    return count;
  }

 private:
  std::filesystem::path path_;
};

/// Runs `action` and checks that it throws an Error of this kind whose message holds every part.
template <class Action>
void expect_error(ErrorKind kind, std::initializer_list<std::string> parts, const Action& action) {
  try {
    action();
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), kind);
    for (const std::string& part : parts)
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
  }
}

inline std::array<int, 3> pixel(const Image& image, int x, int y) {
  const std::uint8_t* p = &image.pixels[3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                                             static_cast<std::size_t>(x))];
  return {p[0], p[1], p[2]};
}

/// Sum of the three channels: enough to order brightness.
inline int brightness(const Image& image, int x, int y) {
  const std::array<int, 3> p = pixel(image, x, y);
  return p[0] + p[1] + p[2];
}

}  // namespace supple::render::test
