#include "supple/core/io/child_process.h"

#include <fcntl.h>
#include <linux/close_range.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <sstream>
#include <system_error>

#include "supple/core/interrupt.h"
#include "supple/core/io/descriptor.h"

namespace supple::io {
namespace {

constexpr int kNotStarted = 127;            // as shells have it
constexpr int kSlice_ms = 20;               // between two checks of `interrupt`
constexpr std::size_t kMostKept = 65536;    // bytes of messages

[[noreturn]] void fail(int code) { throw std::system_error(code, std::system_category()); }

struct Pipe {
  Descriptor read, write;
};

Pipe make_pipe() {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) fail(errno);
  Pipe pipe{above_standard(ends[0]), above_standard(ends[1])};
  if (!pipe.read.is_open() || !pipe.write.is_open()) fail(errno);
  return pipe;
}

/// All that the child needs between fork and exec, where other threads' locks are never released: no call there may allocate.
struct Start {
  const char* program;
  char* const* words;
  pid_t parent;
  int null, messages, failure;
  const sigset_t* signals;
  int life, own_life;  ///< read and write end of a pipe without data: it closes when this process ends
};

/// Comes back where that fails, with errno.
int exec(const Start& start) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != start.parent) return ESRCH;  // the parent ended before the signal was set up
  if (::dup2(start.null, STDIN_FILENO) < 0 || ::dup2(start.null, STDOUT_FILENO) < 0 || ::dup2(start.messages, STDERR_FILENO) < 0) return errno;
  // Also descriptors of libraries and of our own parent. Older systems lack the call; our own descriptors are marked anyway.
  ::syscall(SYS_close_range, STDERR_FILENO + 1, ~0U, CLOSE_RANGE_CLOEXEC);
  ::sigprocmask(SIG_SETMASK, start.signals, nullptr);
  ::execve(start.program, start.words, environ);
  return errno;
}

[[noreturn]] void become(const Start& start) {
  const int code = exec(start);
  (void)!::write(start.failure, &code, sizeof code);
  ::_exit(kNotStarted);
}

/// Ends as another process did.
[[noreturn]] void end_like(int status) {
  if (WIFEXITED(status)) ::_exit(WEXITSTATUS(status));
  const int number = WTERMSIG(status);
  const rlimit no_core{0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
  ::signal(number, SIG_DFL);
  sigset_t one;
  ::sigemptyset(&one);
  ::sigaddset(&one, number);
  ::sigprocmask(SIG_UNBLOCK, &one, nullptr);
  ::raise(number);
  ::_exit(kNotStarted);
}

/// The system kills what we start when we end, but not what that starts. A process between us and the program leads the group of all of them: it ends as the
/// program does, or kills the group when we are gone. Nothing that it calls may allocate, either.
[[noreturn]] void keep(Start start) {
  ::setpgid(0, 0);
  const pid_t parent = start.parent;
  start.parent = ::getpid();
  const pid_t program = ::fork();
  if (program == 0) become(start);
  if (program < 0) {
    const int code = errno;
    (void)!::write(start.failure, &code, sizeof code);
    ::_exit(kNotStarted);
  }
  // Locks and pipes of ours are not held for longer than we live; standard streams neither.
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) (void)::dup2(start.null, stream);
  for (const int used : {start.own_life, start.messages, start.failure}) ::close(used);
  ::syscall(SYS_close_range, STDERR_FILENO + 1, static_cast<unsigned>(start.life) - 1, 0);
  ::syscall(SYS_close_range, static_cast<unsigned>(start.life) + 1, ~0U, 0);
  pollfd life{.fd = start.life, .events = POLLIN, .revents = 0};
  for (;;) {
    int status = 0;
    if (::waitpid(program, &status, WNOHANG) == program) end_like(status);
    const bool gone = ::poll(&life, 1, kSlice_ms) > 0 || ::getppid() != parent;
    if (gone) ::kill(0, SIGKILL);
  }
}

/// A program that was started; killed with its group and waited for on every way out.
class Child {
 public:
  explicit Child(pid_t process) : process_(process) {
    // The child does so, too: whoever comes first.
    ::setpgid(process, process);
  }
  ~Child() {
    if (process_ <= 0) return;
    ::kill(-process_, SIGKILL);
    int status = 0;
    retried([&] { return ::waitpid(process_, &status, 0); });
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  /// Asks its group to end, and waits for as long at most.
  void ask(std::chrono::milliseconds notice) {
    ::kill(-process_, SIGTERM);
    const auto last = std::chrono::steady_clock::now() + notice;
    int status = 0;
    while (!ended(status) && std::chrono::steady_clock::now() < last) (void)::poll(nullptr, 0, kSlice_ms);
  }

  /// Whether it has ended; `status` is then set.
  bool ended(int& status) {
    const pid_t found = retried([&] { return ::waitpid(process_, &status, WNOHANG); });
    if (found == 0) return false;
    process_ = 0;
    return true;
  }

 private:
  pid_t process_;
};

/// Of this thread, for a scope: a handler must not run in the child.
class SignalsBlocked {
 public:
  SignalsBlocked() {
    sigset_t all;
    ::sigfillset(&all);
    ::pthread_sigmask(SIG_SETMASK, &all, &before_);
  }
  ~SignalsBlocked() { ::pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  SignalsBlocked(const SignalsBlocked&) = delete;
  SignalsBlocked& operator=(const SignalsBlocked&) = delete;
  [[nodiscard]] const sigset_t& before() const { return before_; }

 private:
  sigset_t before_{};
};

pid_t start_child(Start start) {
  const SignalsBlocked blocked;
  start.signals = &blocked.before();
  const pid_t process = ::fork();
  if (process < 0) fail(errno);
  if (process == 0) keep(start);
  return process;
}

/// Reads the available bytes; false at the end of the stream.
bool take(const Descriptor& pipe, std::string& messages) {
  std::array<char, 4096> buffer;
  for (;;) {
    const ssize_t count = retried([&] { return ::read(pipe.get(), buffer.data(), buffer.size()); });
    if (count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return true;
    if (count <= 0) return false;
    messages.append(buffer.data(), static_cast<std::size_t>(count));
    if (messages.size() > kMostKept) messages.erase(0, messages.size() - kMostKept);
  }
}

}  // namespace

std::filesystem::path find_program(const std::string& name) {
  const auto runs = [](const std::filesystem::path& path) {
    std::error_code ignored;
    return std::filesystem::is_regular_file(path, ignored) && ::access(path.c_str(), X_OK) == 0;
  };
  if (name.find('/') != std::string::npos) return runs(name) ? std::filesystem::path(name) : std::filesystem::path();
  const char* path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "/usr/local/bin:/usr/bin:/bin" : path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    std::filesystem::path file = std::filesystem::path(folder.empty() ? "." : folder) / name;
    if (runs(file)) return file;
  }
  return {};
}

ProgramEnd run_program(const std::filesystem::path& program, std::vector<std::string> words, const std::atomic<int>* interrupt,
                       std::chrono::milliseconds notice) {
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const Descriptor null = open_file("/dev/null", O_RDWR);
  if (!null.is_open()) fail(errno);
  Pipe messages = make_pipe(), failure = make_pipe();
  const Pipe life = make_pipe();
  Child child(start_child({program.c_str(), argv.data(), ::getpid(), null.get(), messages.write.get(), failure.write.get(), nullptr, life.read.get(), life.write.get()}));
  (void)messages.write.close();
  (void)failure.write.close();

  int code = 0;  // of exec; where that goes well the pipe is closed by it
  const ssize_t received = retried([&] { return ::read(failure.read.get(), &code, sizeof code); });
  if (received == static_cast<ssize_t>(sizeof code)) fail(code);
  ProgramEnd end;
  ::fcntl(messages.read.get(), F_SETFL, O_NONBLOCK);
  pollfd wait{.fd = messages.read.get(), .events = POLLIN, .revents = 0};
  // A program that it started may hold the pipe for longer, or it may close its own end.
  for (bool ended = false; !ended;) {
    if (notice.count() > 0 && interrupt != nullptr && interrupt->load() != 0) child.ask(notice);
    heed(interrupt);
    (void)::poll(&wait, 1, kSlice_ms);  // broken off by a signal it is made again
    ended = child.ended(end.status);
    if (!take(messages.read, end.messages)) wait.fd = -1;
  }
  return end;
}

}  // namespace supple::io
