#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sstream>
#include <system_error>

#include "supple/core/error.h"
#include "supple/core/hash.h"
#include "supple/core/io/open_temporaries.h"
#include "supple/render/image.h"

namespace supple::render {
namespace {

constexpr const char* kInstallHint = "apt-get install ffmpeg";

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

struct Outcome {
  int status = 0;        ///< as waitpid gives it
  std::string messages;  ///< the end of what the program wrote to its error stream
};

/// Runs a program of the search path without a shell, its input empty, and collects its error stream.
/// @throws Error{Io} when there is no such program.
Outcome run(const std::vector<std::string>& arguments) {
  int pipe_ends[2];
  if (::pipe2(pipe_ends, O_CLOEXEC) != 0) fail(arguments[0], std::system_category().message(errno), {});
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  ::posix_spawn_file_actions_adddup2(&actions, pipe_ends[1], STDERR_FILENO);

  std::vector<std::string> words = arguments;
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  pid_t child = 0;
  const int code = ::posix_spawnp(&child, argv[0], &actions, nullptr, argv.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  ::close(pipe_ends[1]);
  if (code != 0) {
    ::close(pipe_ends[0]);
    fail(arguments[0], "cannot be started: " + std::system_category().message(code), kInstallHint);
  }

  Outcome outcome;
  char buffer[4096];
  for (;;) {
    const ssize_t count = ::read(pipe_ends[0], buffer, sizeof buffer);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) break;
    outcome.messages.append(buffer, static_cast<std::size_t>(count));
    if (outcome.messages.size() > 65536) outcome.messages.erase(0, 32768);
  }
  ::close(pipe_ends[0]);
  while (::waitpid(child, &outcome.status, 0) < 0 && errno == EINTR) {
  }
  return outcome;
}

std::string number_text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

constexpr std::string_view kPictures = "pictures ";
constexpr std::string_view kNote = "; note ";

/// Of the pictures of a film and of how they are encoded, and its note; a part of the film itself.
std::string identity_of(const std::vector<std::string>& arguments, const std::vector<std::filesystem::path>& pictures, const std::string& note) {
  Hasher hasher;
  for (const std::string& argument : arguments) hasher.add(std::string_view(argument));
  for (const std::filesystem::path& picture : pictures) {
    std::ifstream in(picture, std::ios::binary);
    hasher.add(std::string_view(std::string{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()}));
  }
  return std::string(kPictures) + to_hex(hasher.value()) + std::string(kNote) + note + ';';
}

/// The facts about an MP4, which stand before its pictures; empty for what is none of ours.
std::string facts_of(const std::filesystem::path& film) {
  std::error_code absent;
  const std::uintmax_t length = std::filesystem::file_size(film, absent);
  if (absent) return {};
  std::ifstream in(film, std::ios::binary);
  for (std::array<unsigned char, 8> head{}; in.read(reinterpret_cast<char*>(head.data()), head.size());) {
    const std::size_t size = std::size_t{head[0]} << 24 | std::size_t{head[1]} << 16 | std::size_t{head[2]} << 8 | std::size_t{head[3]};
    if (size < head.size() || size > length) return {};
    const std::string_view kind(reinterpret_cast<const char*>(&head[4]), 4);
    if (kind == "mdat") return {};  // the facts come first in films of `encode_film`
    std::string box(size - head.size(), '\0');
    if (!in.read(box.data(), static_cast<std::streamsize>(box.size()))) return {};
    if (kind == "moov") return box;
  }
  return {};
}

}  // namespace

void find_film_program() {
  const std::string program = program_name();
  if (program.find('/') != std::string::npos) {
    if (::access(program.c_str(), X_OK) == 0) return;
  } else {
    const char* path = std::getenv("PATH");
    std::istringstream folders(path == nullptr ? "/usr/local/bin:/usr/bin:/bin" : path);
    for (std::string folder; std::getline(folders, folder, ':');) {
      if (::access(((folder.empty() ? "." : folder) + '/' + program).c_str(), X_OK) == 0) return;
    }
  }
  fail(program, "cannot be started: " + std::generic_category().message(ENOENT), kInstallHint);
}

void encode_film(const std::filesystem::path& folder, const std::string& stem, int first, int last, double frame_rate,
                 const FilmFile& file) {
  const std::filesystem::path& film = file.path;
  SUPPLE_EXPECTS(0 <= first && first <= last);
  SUPPLE_EXPECTS(std::isfinite(frame_rate) && frame_rate > 0.0);
  // ffmpeg ends the film without a word where a number is missing.
  std::vector<std::filesystem::path> pictures;
  for (int frame = first; frame <= last; ++frame) {
    pictures.push_back(folder / frame_name(stem, frame));
    if (!std::filesystem::exists(pictures.back())) fail(pictures.back().string(), "a frame of the film is missing", "render it first");
  }
  const std::vector<std::string> encoding = {
      "-framerate", number_text(frame_rate), "-frames:v", std::to_string(last - first + 1),
      // 4:2:0 needs even sizes: an odd edge is stretched by one pixel.
      "-vf", "scale=ceil(iw/2)*2:ceil(ih/2)*2:flags=lanczos:out_color_matrix=bt709:out_range=tv,format=yuv420p",
      "-c:v", "libx264", "-preset", "medium", "-crf", "16", "-pix_fmt", "yuv420p",
      "-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709", "-color_range", "tv",
      "-movflags", "+faststart", "-f", "mp4"};
  const std::string identity = identity_of(encoding, pictures, file.note);
  if (facts_of(film).find(identity) != std::string::npos) return;

  const std::filesystem::path temporary =
      std::filesystem::absolute(film).parent_path() /
      ('.' + film.filename().string() + '.' + std::to_string(::getpid()) + ".tmp");
  const std::filesystem::path frames = std::filesystem::absolute(folder);
  std::vector<std::string> arguments = {
      program_name(), "-hide_banner", "-nostdin", "-loglevel", "error", "-y",
      encoding[0], encoding[1], "-start_number", std::to_string(first), "-i", as_pattern((frames / stem).string()) + ".%04d.png"};
  arguments.insert(arguments.end(), encoding.begin() + 2, encoding.end());
  arguments.insert(arguments.end(), {"-metadata", "comment=" + identity, temporary.string()});

  const io::OpenTemporary open(temporary.c_str());
  std::error_code ignored;
  Outcome outcome;
  try {
    outcome = run(arguments);
  } catch (...) {
    std::filesystem::remove(temporary, ignored);
    throw;
  }
  if (!WIFEXITED(outcome.status) || WEXITSTATUS(outcome.status) != 0) {
    std::filesystem::remove(temporary, ignored);
    const std::string said = last_line(outcome.messages);
    // A shell's way to say that a program is absent; posix_spawn of older systems reports it so, too.
    const bool absent = WIFEXITED(outcome.status) && WEXITSTATUS(outcome.status) == 127;
    fail(film.string(), arguments[0] + " failed" + (said.empty() ? std::string() : ": " + said),
         absent ? kInstallHint : "the frames are kept in " + folder.string());
  }
  std::error_code error;
  std::filesystem::rename(temporary, film, error);
  if (error) {
    std::filesystem::remove(temporary, ignored);
    fail(film.string(), "cannot be written: " + error.message(), {});
  }
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
