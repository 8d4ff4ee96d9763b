/// @file folder_lock.h
/// Who may write to an output folder: one run, or several processes that draw frames in one look. Locks are ranges of the file `.lock`
/// that end with the process that holds them, however it ends. On a file system of several machines they need locks that all of them see.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>

#include "supple/core/io/descriptor.h"

namespace supple::scenes {

/// What pictures depend on besides the state.
struct PictureLook {
  std::string program;  ///< identity of the build
  std::string context;  ///< of OpenGL, as requested
  std::string keys;     ///< the scene's keys of pictures (`text_of`)
};

/// A byte of `.lock`. Locks of one byte act between all open files, also those of one process.
enum class LockedByte : std::uint8_t {
  Use,     ///< of the folder: held alone by a run, together by those that draw
  Gate,    ///< held while a process begins to draw, or decides who makes the film
  Draws,   ///< held together by those that draw, until their pictures are there and the film is left to others
  Film,    ///< held by the one that makes films and sheets
};

/// The locked bytes of this process in one folder.
class LockFile {
 public:
  /// @throws Error{Io} where the file cannot be made
  explicit LockFile(const std::filesystem::path& folder);

  /// @param alone  no other may hold the byte at the same time   @return false where others hold it
  /// @throws Error{Io} where the file system has no locks
  [[nodiscard]] bool try_lock(LockedByte byte, bool alone);
  /// Waits for others. @throws Error{Io}, Interrupted
  void lock_alone(LockedByte byte, const std::atomic<int>* interrupt);
  void release(LockedByte byte) noexcept;
  /// Whether another open file holds the byte. @throws Error{Io}
  [[nodiscard]] bool others_hold(LockedByte byte) const;

  [[nodiscard]] std::string text() const;          ///< content of the file @throws Error{Io}
  void set_text(const std::string& text);          ///< @throws Error{Io}

 private:
  [[noreturn]] void fail(int code) const;

  std::filesystem::path path_;
  io::Descriptor file_;
};

/// A folder for one process; another one that would write to it is refused.
class FolderLock {
 public:
  /// @throws Error{Io}
  explicit FolderLock(const std::filesystem::path& folder);

 private:
  LockFile file_;
};

/// A folder in which several processes draw frames of one run at the same time, all in one look.
class SharedFolder {
 public:
  /// The first one removes what killed processes left, and sets the look that all others must have.
  /// @param name  of the scene
  /// @throws Error{Io} where a run uses the folder, or processes that draw another look, naming the keys; Interrupted
  SharedFolder(const std::filesystem::path& folder, const std::string& name, const PictureLook& look, const std::atomic<int>* interrupt);
  ~SharedFolder();
  SharedFolder(const SharedFolder&) = delete;
  SharedFolder& operator=(const SharedFolder&) = delete;

  /// For a process that has drawn its frames and found that others are absent: whether processes remain that will look for them again,
  /// so that this one need not. The last one never leaves. @throws Error{Io}, Interrupted
  [[nodiscard]] bool leaves_to_others();
  /// Waits until no other process makes films and sheets; this one then may until its end. @throws Error{Io}, Interrupted
  void take_turn();

 private:
  std::filesystem::path folder_;
  std::string name_;
  LockFile file_;
  const std::atomic<int>* interrupt_;
};

}  // namespace supple::scenes
