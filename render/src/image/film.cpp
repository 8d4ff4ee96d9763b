#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <system_error>

#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/core/interrupt.h"
#include "supple/core/io/atomic_file.h"
#include "supple/core/io/child_process.h"
#include "supple/core/io/open_temporaries.h"
#include "supple/render/image.h"

namespace supple::render {
namespace {

constexpr const char* kInstallHint = "apt-get install ffmpeg";
constexpr std::size_t kLargestPicture = std::size_t{1} << 32;  // [bytes]

[[noreturn]] void fail(const std::string& place, const std::string& what, const std::string& hint) {
  throw Error(ErrorKind::Io, Fault{.place = place, .key = {}, .expected = what, .found = {}, .hint = hint});
}

/// SUPPLE_FFMPEG names another program, or its full path.
std::string program_name() {
  const char* named = std::getenv("SUPPLE_FFMPEG");
  return named == nullptr || *named == '\0' ? "ffmpeg" : named;
}

std::string frame_name(const std::string& stem, int frame) {
  char number[16];
  std::snprintf(number, sizeof number, "%04d", frame);
  return stem + '.' + number + ".png";
}

/// ffmpeg reads its input name as a pattern, in which a percent sign is doubled.
std::string as_pattern(const std::string& text) {
  std::string out;
  for (const char c : text) out.append(c == '%' ? 2 : 1, c);
  return out;
}

std::string last_line(const std::string& text) {
  const std::size_t end = text.find_last_not_of("\r\n ");
  if (end == std::string::npos) return {};
  const std::size_t newline = text.find_last_of("\r\n", end);
  const std::size_t begin = newline == std::string::npos ? 0 : newline + 1;
  return text.substr(begin, end + 1 - begin);
}

[[noreturn]] void fail_to_start(const std::string& program, const std::string& why) {
  fail(program, "cannot be started: " + why, kInstallHint);
}

std::filesystem::path film_program() {
  const std::string name = program_name();
  std::filesystem::path program = io::find_program(name);
  if (program.empty()) fail_to_start(name, std::generic_category().message(ENOENT));
  return program;
}

/// Where ffmpeg writes, beside the film. It goes with whatever is in it; once it has gone, what still runs has nowhere to write to.
class TemporaryFolder {
 public:
  explicit TemporaryFolder(const std::filesystem::path& film) : path_(io::temporary_name(film)), open_(path_.c_str()) {
    std::error_code error;
    std::filesystem::remove_all(path_, error);  // of a process that had this number
    std::filesystem::create_directory(path_, error);
    if (error) fail(film.string(), "cannot be written: " + error.message(), {});
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
    if (ignored) std::filesystem::remove_all(path_, ignored);  // an error of the disk may pass
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  io::OpenTemporary open_;
};

/// The shortest text of the same number: from 29.97002997002997 ffmpeg finds the rate 30000/1001, from fewer digits it does not.
std::string number_text(double value) {
  std::array<char, 32> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

constexpr std::uintmax_t kLargestFacts = std::uintmax_t{1} << 26;  // [byte]; a million pictures take half of it
constexpr std::string_view kPictures = "pictures ";
constexpr std::string_view kNote = "; note ";

/// Of the pictures of a film and of how they are encoded, and its note; a part of the film itself.
std::string identity_of(const std::vector<std::string>& arguments, const std::vector<std::filesystem::path>& pictures, const std::string& note,
                        const std::atomic<int>* interrupt) {
  Hasher hasher;
  for (const std::string& argument : arguments) hasher.add(std::string_view(argument));
  for (const std::filesystem::path& picture : pictures) {
    heed(interrupt);
    const std::vector<std::byte> bytes = io::read_file(picture, kLargestPicture);
    hasher.add(std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
  }
  return std::string(kPictures) + to_hex(hasher.value()) + std::string(kNote) + note + ';';
}

/// The metadata of an MP4, which precede its pictures; empty for files of other programs.
std::string facts_of(const std::filesystem::path& film) {
  std::error_code absent;
  const std::uintmax_t length = std::filesystem::file_size(film, absent);
  if (absent) return {};  // or no regular file
  std::ifstream in(film, std::ios::binary);
  for (std::array<unsigned char, 8> head{}; in.read(reinterpret_cast<char*>(head.data()), head.size());) {
    const std::size_t size = std::size_t{head[0]} << 24 | std::size_t{head[1]} << 16 | std::size_t{head[2]} << 8 | std::size_t{head[3]};
    if (size < head.size() || size > std::min(length, kLargestFacts)) return {};
    const std::string_view kind(reinterpret_cast<const char*>(&head[4]), 4);
    if (kind == "mdat") return {};  // the facts come first in films of `encode_film`
    std::string box(size - head.size(), '\0');
    if (!in.read(box.data(), static_cast<std::streamsize>(box.size()))) break;
    if (kind == "moov") return box;
  }
  if (in.bad()) throw std::filesystem::filesystem_error("cannot be read", film, std::make_error_code(std::errc::io_error));
  return {};
}

}  // namespace

void find_film_program() { (void)film_program(); }

void encode_film(const FilmSource& source, const std::filesystem::path& film, const std::atomic<int>* interrupt) {
  SUPPLE_EXPECTS(0 <= source.first && source.first <= source.last);
  SUPPLE_EXPECTS(std::isfinite(source.frame_rate) && source.frame_rate > 0.0);
  // ffmpeg ends the film without a word where a number is missing.
  std::vector<std::filesystem::path> pictures;
  for (int frame = source.first; frame <= source.last; ++frame) {
    pictures.push_back(source.folder / frame_name(source.stem, frame));
    if (!std::filesystem::exists(pictures.back())) fail(pictures.back().string(), "a frame of the film is missing", "render it first");
  }
  const std::vector<std::string> encoding = {
      "-framerate", number_text(source.frame_rate), "-frames:v", std::to_string(source.last - source.first + 1),
      // 4:2:0 needs even sizes: an odd edge is stretched by one pixel.
      "-vf", "scale=ceil(iw/2)*2:ceil(ih/2)*2:flags=lanczos:out_color_matrix=bt709:out_range=tv,format=yuv420p",
      "-c:v", "libx264", "-preset", "medium", "-crf", "16", "-pix_fmt", "yuv420p",
      "-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709", "-color_range", "tv",
      "-movflags", "+faststart", "-f", "mp4"};
  const std::string identity = identity_of(encoding, pictures, source.note, interrupt);
  if (facts_of(film).find(identity) != std::string::npos) return;

  const std::filesystem::path program = film_program();
  const std::filesystem::path target = std::filesystem::absolute(film);
  const TemporaryFolder temporary(target);
  const std::filesystem::path unfinished = temporary.path() / "film.mp4";
  const std::filesystem::path frames = std::filesystem::absolute(source.folder);
  std::vector<std::string> arguments = {
      program.string(), "-hide_banner", "-nostdin", "-loglevel", "error", "-y", encoding[0], encoding[1],
      "-start_number", std::to_string(source.first), "-i", as_pattern((frames / source.stem).string()) + ".%04d.png"};
  arguments.insert(arguments.end(), encoding.begin() + 2, encoding.end());
  arguments.insert(arguments.end(), {"-metadata", "comment=" + identity, unfinished.string()});

  const io::OpenTemporary open(unfinished.c_str());
  io::ProgramEnd end;
  try {
    end = io::run_program(program, arguments, interrupt);
  } catch (const std::system_error& error) {
    fail_to_start(program.string(), error.code().message());
  }
  if (!WIFEXITED(end.status) || WEXITSTATUS(end.status) != 0) {
    const std::string said = last_line(end.messages);
    const bool absent = WIFEXITED(end.status) && WEXITSTATUS(end.status) == 127;  // a shell's way to say that a program is
    fail(film.string(), program.string() + " failed" + (said.empty() ? std::string() : ": " + said),
         absent ? kInstallHint : "the frames are kept in " + source.folder.string());
  }
  io::rename_whole(unfinished, target);
}

std::optional<std::string> film_note(const std::filesystem::path& film) {
  const std::string facts = facts_of(film);
  const std::size_t pictures = facts.find(kPictures);
  const std::size_t note = pictures == std::string::npos ? pictures : facts.find(kNote, pictures);
  const std::size_t end = note == std::string::npos ? note : facts.find(';', note + kNote.size());
  if (end == std::string::npos) return std::nullopt;
  return facts.substr(note + kNote.size(), end - note - kNote.size());
}

}  // namespace supple::render
