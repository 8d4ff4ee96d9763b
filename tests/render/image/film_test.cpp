#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <thread>

#include "render/support.h"
#include "supple/core/interrupt.h"

namespace supple::render::test {
namespace {

/// Sets an environment variable for a scope.
class Environment {
 public:
  Environment(const char* name, const std::string& value) : name_(name) { ::setenv(name, value.c_str(), 1); }
  ~Environment() { ::unsetenv(name_); }
  Environment(const Environment&) = delete;
  Environment& operator=(const Environment&) = delete;

 private:
  const char* name_;
};

std::string output_of(const std::string& command) {
  std::string text;
  FILE* pipe = ::popen(command.c_str(), "r");
  if (pipe == nullptr) return text;
  char buffer[256];
  while (std::fgets(buffer, sizeof buffer, pipe) != nullptr) text += buffer;
  ::pclose(pipe);
  return text;
}

void write_frames(const Folder& folder, const std::string& stem, int first, int last, int width, int height) {
  for (int frame = first; frame <= last; ++frame) {
    Image image{.width = width, .height = height, .pixels = {}};
    image.pixels.assign(std::size_t{3} * static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
                        static_cast<std::uint8_t>(20 * frame));
    char name[64];
    std::snprintf(name, sizeof name, ".%04d.png", frame);
    write_png(folder / (stem + name), image);
  }
}

TEST(Film, HasEveryFrameItsRateAndItsColourTags) {
  const Folder folder;
  // A percent sign, a space and an odd size are all a user may give.
  write_frames(folder, "50% ball", 3, 9, 65, 33);
  encode_film({folder.path(), "50% ball", 3, 9, 24.0}, folder / "film.mp4");
  const std::string facts = output_of("ffprobe -v error -count_frames -select_streams v:0 -show_entries "
                                      "stream=width,height,nb_read_frames,pix_fmt,color_space,r_frame_rate "
                                      "-of default=nw=1 '" + (folder / "film.mp4").string() + "'");
  for (const char* fact : {"width=66", "height=34", "nb_read_frames=7", "pix_fmt=yuv420p", "color_space=bt709",
                           "r_frame_rate=24/1"})
    EXPECT_NE(facts.find(fact), std::string::npos) << facts;
  EXPECT_EQ(folder.file_count(), 8U);

  // +faststart: the index stands before the pictures.
  std::ifstream in(folder / "film.mp4", std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  EXPECT_LT(bytes.find("moov"), bytes.find("mdat"));
}

TEST(Film, HasTheRationalRateThatANumberStandsFor) {
  const Folder folder;
  write_frames(folder, "ball", 1, 3, 16, 16);
  for (const auto& [rate, fact] : {std::pair{30000.0 / 1001.0, "r_frame_rate=30000/1001"}, {24000.0 / 1001.0, "r_frame_rate=24000/1001"},
                                   {12.5, "r_frame_rate=25/2"}, {0.1, "r_frame_rate=1/10"}}) {
    encode_film({folder.path(), "ball", 1, 3, rate}, folder / "film.mp4");
    const std::string facts = output_of("ffprobe -v error -select_streams v:0 -show_entries stream=r_frame_rate -of default=nw=1 '" +
                                        (folder / "film.mp4").string() + "'");
    EXPECT_NE(facts.find(fact), std::string::npos) << facts;
  }
}

TEST(Film, IsKeptAsLongAsItHoldsTheSamePicturesAtTheSameRate) {
  const Folder folder;
  write_frames(folder, "ball", 1, 3, 16, 16);
  const auto encode = [&](int last, double rate) { encode_film({folder.path(), "ball", 1, last, rate}, folder / "film.mp4"); };
  encode(3, 24.0);
  {
    const Environment program("SUPPLE_FFMPEG", "/no/such/ffmpeg");
    const auto starts = [&](int last, double rate) { expect_error(ErrorKind::Io, {"cannot be started"}, [&] { encode(last, rate); }); };
    EXPECT_NO_THROW(encode(3, 24.0));
    starts(2, 24.0);
    starts(3, 25.0);
    write_frames(folder, "ball", 4, 4, 16, 16);
    std::filesystem::rename(folder / "ball.0004.png", folder / "ball.0002.png");
    starts(3, 24.0);
    for (const char* damaged : {"no film", "", "\xff\xff\xff\xffmoov"}) {
      std::ofstream(folder / "film.mp4") << damaged;
      starts(3, 24.0);
    }
  }
  encode(3, 24.0);
  EXPECT_EQ(folder.file_count(), 4U);
}

TEST(Film, CarriesANoteThatIsReadWithoutItsPictures) {
  const Folder folder;
  write_frames(folder, "ball", 1, 3, 16, 16);
  EXPECT_EQ(film_note(folder / "film.mp4"), std::nullopt);
  encode_film({folder.path(), "ball", 1, 3, 24.0, "0123abcd of 3"}, folder / "film.mp4");
  EXPECT_EQ(film_note(folder / "film.mp4"), "0123abcd of 3");
  const Environment program("SUPPLE_FFMPEG", "/no/such/ffmpeg");
  EXPECT_NO_THROW(encode_film({folder.path(), "ball", 1, 3, 24.0, "0123abcd of 3"}, folder / "film.mp4"));
  EXPECT_ANY_THROW(encode_film({folder.path(), "ball", 1, 3, 24.0, "another"}, folder / "film.mp4"));
  std::ofstream(folder / "film.mp4") << "no film; note by hand;";
  EXPECT_EQ(film_note(folder / "film.mp4"), std::nullopt);
}

TEST(Film, NamesThePackageWhenFfmpegIsAbsentAndKeepsTheFrames) {
  const Folder folder;
  write_frames(folder, "ball", 1, 2, 16, 16);
  const Environment program("SUPPLE_FFMPEG", "/no/such/ffmpeg");
  expect_error(ErrorKind::Io, {"/no/such/ffmpeg", "cannot be started", "apt-get install ffmpeg"},
               [&] { encode_film({folder.path(), "ball", 1, 2, 24.0}, folder / "film.mp4"); });
  EXPECT_EQ(folder.file_count(), 2U);
}

TEST(Film, IsLookedForByNameAndByPath) {
  const Folder folder;
  std::ofstream(folder / "maker") << "#!/bin/sh\n";
  const auto absent = [](const std::string& name) {
    expect_error(ErrorKind::Io, {name, "cannot be started", "apt-get install ffmpeg"}, [] { find_film_program(); });
  };
  const std::string path = std::getenv("PATH");
  ::setenv("PATH", ("/no/such/folder:" + folder.path().string()).c_str(), 1);
  for (const std::string& name : {std::string("maker"), (folder / "maker").string()}) {
    const Environment program("SUPPLE_FFMPEG", name);
    std::filesystem::permissions(folder / "maker", std::filesystem::perms::owner_read);
    if (::geteuid() != 0) absent(name);  // root may run what has any right to be run
    std::filesystem::permissions(folder / "maker", std::filesystem::perms::owner_all);
    EXPECT_NO_THROW(find_film_program()) << name;
  }
  absent("ffmpeg");
  ::setenv("PATH", path.c_str(), 1);
}

TEST(Film, TellsTheLastLineOfAProgramThatFailsAndLeavesNothingBehind) {
  const Folder folder;
  write_frames(folder, "ball", 1, 2, 16, 16);
  std::ofstream(folder / "fails") << "#!/bin/sh\nfor last; do :; done\n: > \"$last\"\necho first >&2\n"
                                     "echo 'the disk is full' >&2\nexit 3\n";
  std::filesystem::permissions(folder / "fails", std::filesystem::perms::owner_all);
  const Environment program("SUPPLE_FFMPEG", (folder / "fails").string());
  expect_error(ErrorKind::Io, {"film.mp4", "failed: the disk is full", "the frames are kept"},
               [&] { encode_film({folder.path(), "ball", 1, 2, 24.0}, folder / "film.mp4"); });
  EXPECT_EQ(folder.file_count(), 3U);
}

TEST(Film, NamesTheFrameThatIsMissing) {
  const Folder folder;
  write_frames(folder, "ball", 1, 2, 16, 16);
  expect_error(ErrorKind::Io, {"ball.0003.png", "missing"},
               [&] { encode_film({folder.path(), "ball", 1, 4, 24.0}, folder / "film.mp4"); });
}

/// A program in place of ffmpeg that notes its number, starts another one that notes its own, and never ends by itself.
void write_endless(const Folder& folder) {
  const std::string path = folder.path().string();
  std::ofstream(folder / "endless") << "#!/bin/sh\nsh -c 'echo $$ > " + path + "/inner.new; mv " + path + "/inner.new " + path +
                                           "/inner; exec sleep 600' &\necho $$ > " + path + "/outer.new; mv " + path + "/outer.new " +
                                           path + "/outer\nfor last; do :; done\n: > \"$last\"\nwait\n";
  std::filesystem::permissions(folder / "endless", std::filesystem::perms::owner_all);
}

/// Of a process that has noted its number; 0 while it has not.
pid_t number_in(const std::filesystem::path& file) {
  pid_t number = 0;
  std::ifstream(file) >> number;
  return number;
}

/// A process that ended and that nobody has waited for counts as ended.
bool runs(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/stat");
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  const std::size_t end = text.rfind(')');
  return end != std::string::npos && end + 2 < text.size() && text[end + 2] != 'Z' && text[end + 2] != 'X';
}

/// Whether `holds` does within ten seconds.
template <class Condition>
bool soon(const Condition& holds) {
  for (int k = 0; k < 1000; ++k) {
    if (holds()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

TEST(Film, EndsWithAllThatItStartedWhenItIsInterrupted) {
  const Folder folder;
  write_frames(folder, "ball", 1, 2, 16, 16);
  write_endless(folder);
  const Environment program("SUPPLE_FFMPEG", (folder / "endless").string());
  std::atomic<int> interrupt{0};
  std::jthread signal([&] {
    (void)soon([&] { return number_in(folder / "outer") != 0 && number_in(folder / "inner") != 0; });
    interrupt = SIGINT;
  });
  EXPECT_THROW(encode_film({folder.path(), "ball", 1, 2, 24.0}, folder / "film.mp4", &interrupt), Interrupted);
  EXPECT_TRUE(soon([&] { return !runs(number_in(folder / "outer")); }));
  const pid_t inner = number_in(folder / "inner");
  EXPECT_NE(inner, 0);
  EXPECT_TRUE(soon([&] { return !runs(inner); }));
  for (const auto& entry : std::filesystem::directory_iterator(folder.path())) EXPECT_FALSE(entry.is_directory()) << entry.path();
  EXPECT_FALSE(std::filesystem::exists(folder / "film.mp4"));
}

TEST(Film, EndsWithAProcessThatIsKilled) {
  const Folder folder;
  write_frames(folder, "ball", 1, 2, 16, 16);
  write_endless(folder);
  const Environment program("SUPPLE_FFMPEG", (folder / "endless").string());
  const pid_t process = ::fork();
  if (process == 0) {
    encode_film({folder.path(), "ball", 1, 2, 24.0}, folder / "film.mp4");
    ::_exit(0);
  }
  const bool started = soon([&] { return number_in(folder / "outer") != 0 && number_in(folder / "inner") != 0; });
  ::kill(process, SIGKILL);
  ::waitpid(process, nullptr, 0);
  EXPECT_TRUE(started);
  const pid_t outer = number_in(folder / "outer"), inner = number_in(folder / "inner");
  EXPECT_TRUE(soon([&] { return !runs(outer); }));
  EXPECT_NE(inner, 0);
  EXPECT_TRUE(soon([&] { return !runs(inner); }));
}

TEST(Film, GivesItsProgramNoDescriptorsAndNoSignalsOfOurs) {
  const Folder folder;
  write_frames(folder, "ball", 1, 2, 16, 16);
  const std::string path = folder.path().string();
  // The shell reads its mask itself: while it starts another program it blocks signals.
  std::ofstream(folder / "lists") << "#!/bin/sh\nwhile read -r key value; do [ \"$key\" = SigBlk: ] && echo \"$value\"; done < /proc/$$/status > " + path +
                                         "/blocked\nls -l /proc/$$/fd > " + path + "/open\nfor last; do :; done\necho film > \"$last\"\n";
  std::filesystem::permissions(folder / "lists", std::filesystem::perms::owner_all);
  const Environment program("SUPPLE_FFMPEG", (folder / "lists").string());
  const int held = ::open((folder / "held").c_str(), O_RDWR | O_CREAT, 0600);  // open for any program we start
  encode_film({folder.path(), "ball", 1, 2, 24.0}, folder / "film.mp4");
  ::close(held);
  std::ifstream open(folder / "open"), blocked(folder / "blocked");
  const std::string list{std::istreambuf_iterator<char>(open), std::istreambuf_iterator<char>()};
  EXPECT_EQ(list.find("held"), std::string::npos) << list;
  EXPECT_NE(list.find("0 -> /dev/null"), std::string::npos) << list;
  EXPECT_NE(list.find("1 -> /dev/null"), std::string::npos) << list;
  std::string mask;
  blocked >> mask;
  EXPECT_EQ(mask, "0000000000000000");
}

TEST(Film, IsMadeWhereStandardStreamsAreClosed) {
  const Folder folder;
  write_frames(folder, "ball", 1, 2, 16, 16);
  const pid_t process = ::fork();
  if (process == 0) {
    for (const int number : {0, 1, 2}) ::close(number);
    try {
      encode_film({folder.path(), "ball", 1, 2, 24.0}, folder / "film.mp4");
    } catch (const std::exception&) {
      ::_exit(1);
    }
    ::_exit(0);
  }
  int status = -1;
  ::waitpid(process, &status, 0);
  EXPECT_EQ(status, 0);
  EXPECT_TRUE(std::filesystem::exists(folder / "film.mp4"));
}

}  // namespace
}  // namespace supple::render::test
