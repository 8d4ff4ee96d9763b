/// Who may write to an output folder at the same time. Locks act between open files, so two of one process stand for two processes.
#include "output/files/folder_lock.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>

#include "output/run/program_identity.h"
#include "supple/core/error.h"
#include "supple/core/interrupt.h"
#include "support/temp_folder.h"

namespace supple::scenes {
namespace {

namespace fs = std::filesystem;

/// "" where `body` throws no Error.
template <class Body>
std::string message_of(const Body& body) {
  try {
    body();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Io);
    return error.what();
  }
  return {};
}

class FolderLocks : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = temp_folder() / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "frames");
  }
  void TearDown() override { fs::remove_all(folder_); }

  [[nodiscard]] std::string joining(const PictureLook& look) const {
    return message_of([&] { const SharedFolder share(folder_, "ball", look, nullptr); });
  }

  fs::path folder_;
  PictureLook look_{.program = "build 1", .context = "auto", .keys = ""};
};

TEST_F(FolderLocks, OfARunExcludeAllOthers) {
  const FolderLock run(folder_);
  const std::string refused = folder_.string() + ": expected an output folder that no other run uses, found one that is locked; wait for the other run or choose another --out";
  EXPECT_EQ(message_of([&] { const FolderLock again(folder_); }), refused);
  EXPECT_EQ(joining(look_), refused);
}

TEST_F(FolderLocks, OfThoseThatDrawExcludeRunsOnly) {
  std::optional<SharedFolder> first(std::in_place, folder_, "ball", look_, nullptr), second(std::in_place, folder_, "ball", look_, nullptr);
  EXPECT_NE(message_of([&] { const FolderLock run(folder_); }), "");
  first.reset();
  EXPECT_NE(message_of([&] { const FolderLock run(folder_); }), "");
  second.reset();
  EXPECT_EQ(message_of([&] { const FolderLock run(folder_); }), "");
}

TEST_F(FolderLocks, RefuseAnotherLookAsLongAsOneIsDrawn) {
  std::optional<SharedFolder> first(std::in_place, folder_, "ball", look_, nullptr);
  PictureLook built = look_, drawn = look_;
  built.program = "build 2";
  drawn.context = "egl";
  EXPECT_EQ(joining(built), folder_.string() + ": expected the build of supple by which other processes draw here, found another one; wait for their end or choose another --out");
  EXPECT_EQ(joining(drawn), folder_.string() + ": expected the look in which other processes draw here, --context auto, found egl; wait for their end or choose another --out");
  first.reset();
  EXPECT_EQ(joining(built), "");
  EXPECT_EQ(joining(drawn), "");
}

TEST_F(FolderLocks, HoldTheBuildAsALineOfPrintableText) {
  const std::string identity = program_identity();
  EXPECT_FALSE(identity.empty());
  EXPECT_TRUE(std::all_of(identity.begin(), identity.end(), [](unsigned char c) { return c > ' ' && c < 127; })) << identity;
}

TEST_F(FolderLocks, LeaveTheFilmToTheLastOne) {
  SharedFolder first(folder_, "ball", look_, nullptr), second(folder_, "ball", look_, nullptr);
  EXPECT_TRUE(first.leaves_to_others());
  EXPECT_FALSE(second.leaves_to_others());
  EXPECT_FALSE(second.leaves_to_others());
}

TEST_F(FolderLocks, GiveOneTurnAtATime) {
  std::optional<SharedFolder> first(std::in_place, folder_, "ball", look_, nullptr);
  std::atomic<int> signal{15};
  SharedFolder second(folder_, "ball", look_, nullptr), third(folder_, "ball", look_, nullptr);
  first->take_turn();
  LockFile film(folder_);
  EXPECT_FALSE(film.try_lock(LockedByte::Film, true));
  EXPECT_THROW(film.lock_alone(LockedByte::Film, &signal), Interrupted);
  first.reset();
  second.take_turn();
  EXPECT_FALSE(film.try_lock(LockedByte::Film, true));
}

TEST_F(FolderLocks, RemoveTemporaryFilesOnlyWhereNoOtherDraws) {
  const fs::path unfinished = folder_ / "frames/.ball.0001.png.12-34.0.tmp";
  std::optional<SharedFolder> first(std::in_place, folder_, "ball", look_, nullptr);
  std::ofstream(unfinished) << "half";
  EXPECT_EQ(joining(look_), "");
  EXPECT_TRUE(fs::exists(unfinished));
  first.reset();
  EXPECT_FALSE(fs::exists(unfinished));
  std::ofstream(unfinished) << "half";
  first.emplace(folder_, "ball", look_, nullptr);
  EXPECT_FALSE(fs::exists(unfinished));
}

}  // namespace
}  // namespace supple::scenes
