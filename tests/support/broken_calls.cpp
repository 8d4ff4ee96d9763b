#include "support/broken_calls.h"

#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <ucontext.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstddef>

namespace supple::test {
namespace {

constexpr unsigned kLetThrough = 0x5a5a1357;  // in the sixth argument, which none of these calls has

std::atomic<unsigned> calls{0};

/// Makes the call that the filter has stopped, or does as if a signal came first.
void on_stopped_call(int /*signal*/, siginfo_t* info, void* context) {
  auto& registers = static_cast<ucontext_t*>(context)->uc_mcontext.gregs;
  const bool closes = info->si_syscall == SYS_close;
  long result = -EINTR;
  if (closes || calls.fetch_add(1) % 2 == 1) {
    const long made = ::syscall(info->si_syscall, registers[REG_RDI], registers[REG_RSI], registers[REG_RDX], registers[REG_R10],
                                registers[REG_R8], static_cast<long>(kLetThrough));
    if (!closes) result = made < 0 ? -errno : made;
  }
  registers[REG_RAX] = result;
}

constexpr sock_filter statement(unsigned short code, unsigned value) { return {code, 0, 0, value}; }
constexpr sock_filter jump_if_equal(unsigned value, unsigned char then, unsigned char otherwise) {
  return {BPF_JMP | BPF_JEQ | BPF_K, then, otherwise, value};
}

}  // namespace

bool break_off_calls() {
  struct sigaction action {};
  action.sa_sigaction = on_stopped_call;
  action.sa_flags = SA_SIGINFO | SA_NODEFER;
  ::sigaction(SIGSYS, &action, nullptr);
  constexpr std::array kCalls{SYS_open,   SYS_openat, SYS_read,      SYS_write,    SYS_pread64,  SYS_pwrite64,
                              SYS_fsync,  SYS_rename, SYS_renameat,  SYS_renameat2, SYS_close};
  std::array<sock_filter, kCalls.size() + 6> filter{};
  std::size_t at = 0;
  filter[at++] = statement(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr));
  for (std::size_t k = 0; k < kCalls.size(); ++k) {
    filter[at++] = jump_if_equal(static_cast<unsigned>(kCalls[k]), static_cast<unsigned char>(kCalls.size() - k), 0);
  }
  filter[at++] = statement(BPF_RET | BPF_K, SECCOMP_RET_ALLOW);
  filter[at++] = statement(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, args[5]));
  filter[at++] = jump_if_equal(kLetThrough, 0, 1);
  filter[at++] = statement(BPF_RET | BPF_K, SECCOMP_RET_ALLOW);
  filter[at++] = statement(BPF_RET | BPF_K, SECCOMP_RET_TRAP);
  const sock_fprog program{static_cast<unsigned short>(at), filter.data()};
  return ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 && ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
}

}  // namespace supple::test
