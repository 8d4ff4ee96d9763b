#include "output/files/folder_lock.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <span>
#include <system_error>
#include <thread>

#include "file/fields/scene_keys.h"
#include "output/files/output_files.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "supple/core/io/atomic_file.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;
using Wait = std::chrono::milliseconds;

constexpr std::size_t kLargestLook = std::size_t{1} << 26;  // [bytes]
constexpr Wait kFirstWait{2}, kLongestWait{200}, kLeaveWithin{1000};
constexpr const char* kLockName = ".lock";

struct flock range_of(LockedByte byte, short kind) {
  struct flock range {};
  range.l_type = kind;
  range.l_whence = SEEK_SET;
  range.l_start = static_cast<off_t>(byte);
  range.l_len = 1;
  return range;
}

[[noreturn]] void refuse(const fs::path& folder, const std::string& expected, const std::string& found, const std::string& hint) {
  throw Error(ErrorKind::Io, Fault{.place = folder.string(), .key = {}, .expected = expected, .found = found, .hint = hint});
}

[[noreturn]] void refuse_use(const fs::path& folder) {
  refuse(folder, "expected an output folder that no other run uses", "one that is locked", "wait for the other run or choose another --out");
}

std::string text_of(const PictureLook& look) { return look.program + '\n' + look.context + '\n' + look.keys; }

PictureLook look_in_text(const std::string& text) {
  const std::size_t first = std::min(text.find('\n'), text.size()), second = std::min(text.find('\n', first + 1), text.size());
  if (second == text.size()) return {.program = text, .context = {}, .keys = {}};
  return {.program = text.substr(0, first), .context = text.substr(first + 1, second - first - 1), .keys = text.substr(second + 1)};
}

/// @throws Error{Io} where `other` is another look than `own`
void expect_same_look(const fs::path& folder, const PictureLook& own, const PictureLook& other) {
  constexpr const char* kWait = "wait for their end or choose another --out";
  if (own.program != other.program) {
    refuse(folder, "expected the build of supple by which other processes draw here", "another one", kWait);
  }
  if (own.context != other.context) {
    refuse(folder, "expected the look in which other processes draw here, --context " + other.context, own.context, kWait);
  }
  if (own.keys == other.keys) return;
  const KeyDifferences differ = differences(keys_in(own.keys), keys_in(other.keys));
  refuse(folder, "expected the look in which other processes draw here, with " + differ.found, "another one",
         std::string(kWait) + (differ.set.empty() ? "" : ", or draw as they do: " + differ.set));
}

}  // namespace

LockFile::LockFile(const fs::path& folder) : path_(folder / kLockName), file_(io::open_file(path_, O_RDWR | O_CREAT | O_NOFOLLOW, 0644)) {
  if (!file_.is_open()) {
    refuse(path_, "expected a file that can be written", std::system_category().message(errno),
           "it holds the folder for one run; remove it, or choose another --out");
  }
}

void LockFile::fail(int code) const {
  refuse(path_, "expected a file that can be locked", std::system_category().message(code),
         "mount the file system with locks that all its machines see, or choose another --out");
}

bool LockFile::try_lock(LockedByte byte, bool alone) {
  struct flock range = range_of(byte, alone ? F_WRLCK : F_RDLCK);
  if (io::retried([&] { return ::fcntl(file_.get(), F_OFD_SETLK, &range); }) == 0) return true;
  if (errno != EAGAIN && errno != EACCES) fail(errno);
  return false;
}

void LockFile::lock_alone(LockedByte byte, const std::atomic<int>* interrupt) {
  for (Wait wait = kFirstWait; !try_lock(byte, true); wait = std::min(2 * wait, kLongestWait)) {
    heed(interrupt);
    std::this_thread::sleep_for(wait);
  }
}

void LockFile::release(LockedByte byte) noexcept {
  struct flock range = range_of(byte, F_UNLCK);
  (void)io::retried([&] { return ::fcntl(file_.get(), F_OFD_SETLK, &range); });
}

bool LockFile::others_hold(LockedByte byte) const {
  struct flock range = range_of(byte, F_WRLCK);
  if (io::retried([&] { return ::fcntl(file_.get(), F_OFD_GETLK, &range); }) != 0) fail(errno);
  return range.l_type != F_UNLCK;
}

std::string LockFile::text() const {
  const std::vector<std::byte> bytes = io::read_file(path_, kLargestLook);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

void LockFile::set_text(const std::string& text) {
  int code = io::retried([&] { return ::ftruncate(file_.get(), 0); }) != 0 ? errno : 0;
  if (code == 0) code = io::write_all_at(file_.get(), std::as_bytes(std::span(text)), 0);
  if (code != 0) refuse(path_, "cannot be written: " + std::system_category().message(code), {}, {});
}

FolderLock::FolderLock(const fs::path& folder) : file_(folder) {
  if (!file_.try_lock(LockedByte::Use, true)) refuse_use(folder);
}

SharedFolder::SharedFolder(const fs::path& folder, const std::string& name, const PictureLook& look, const std::atomic<int>* interrupt)
    : folder_(folder), name_(name), file_(folder), interrupt_(interrupt) {
  file_.lock_alone(LockedByte::Gate, interrupt);
  if (!file_.try_lock(LockedByte::Use, false)) refuse_use(folder);
  if (file_.others_hold(LockedByte::Use)) {
    expect_same_look(folder, look, look_in_text(file_.text()));
  } else {
    remove_temporaries(folder, name);
    file_.set_text(text_of(look));
  }
  if (!file_.try_lock(LockedByte::Draws, false)) refuse_use(folder);
  file_.release(LockedByte::Gate);
}

SharedFolder::~SharedFolder() {
  try {  // the last one cleans up; who finds the gate held for long leaves that to the next one that begins
    Wait waited{0};
    while (!file_.try_lock(LockedByte::Gate, true) && waited < kLeaveWithin) {
      std::this_thread::sleep_for(kFirstWait);
      waited += kFirstWait;
    }
    if (waited < kLeaveWithin && !file_.others_hold(LockedByte::Use)) remove_temporaries(folder_, name_);
  } catch (const std::exception&) {
    // Temporary files stay until the next process begins; the locks end with the file.
  }
}

bool SharedFolder::leaves_to_others() {
  file_.lock_alone(LockedByte::Gate, interrupt_);
  const bool others = file_.others_hold(LockedByte::Draws);
  if (others) file_.release(LockedByte::Draws);
  file_.release(LockedByte::Gate);
  return others;
}

void SharedFolder::take_turn() { file_.lock_alone(LockedByte::Film, interrupt_); }

}  // namespace supple::scenes
