// Memory that runs out on purpose. LD_PRELOAD=alloc_failure.so, and in the environment:
//   SUPPLE_FAIL_ALLOC    number of the call of operator new that fails, from 1, once; later ones succeed
//   SUPPLE_COUNT_ALLOC   file that gets the number of calls when the program ends
// Calls within main count that the program's own code makes, itself or by way of the C++ library: what graphics drivers and other shared
// libraries do without memory is theirs, and what is allocated before main can be caught by nobody. Programs that this one starts are left alone.
#include <dlfcn.h>
#include <execinfo.h>
#include <fcntl.h>
#include <link.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>

namespace {

std::atomic<long> calls{0};
std::atomic<bool> counting{false};
long failing = 0;
const char* count_file = nullptr;

struct Range {
  std::size_t begin = 0, end = 0;
  [[nodiscard]] bool holds(const void* address) const {
    const auto at = reinterpret_cast<std::size_t>(address);
    return at >= begin && at < end;
  }
};

Range program, cxx_library, here;

int find_range(dl_phdr_info* info, std::size_t, void*) {
  Range range;
  for (int k = 0; k < info->dlpi_phnum; ++k) {
    const ElfW(Phdr)& part = info->dlpi_phdr[k];
    if (part.p_type != PT_LOAD) continue;
    const std::size_t begin = info->dlpi_addr + part.p_vaddr;
    if (range.end == 0) range.begin = begin;
    range.end = begin + part.p_memsz;
  }
  if (info->dlpi_name[0] == '\0' && program.end == 0) program = range;
  if (std::strstr(info->dlpi_name, "libstdc++") != nullptr) cxx_library = range;
  if (std::strstr(info->dlpi_name, "alloc_failure") != nullptr) here = range;
  return 0;
}

/// Whether the program's code asks, itself or by way of the C++ library.
bool asked_by_program() {
  std::array<void*, 16> frame{};
  const int count = backtrace(frame.data(), static_cast<int>(frame.size()));
  for (int k = 0; k < count; ++k) {
    if (program.holds(frame[static_cast<std::size_t>(k)])) return true;
    if (!cxx_library.holds(frame[static_cast<std::size_t>(k)]) && !here.holds(frame[static_cast<std::size_t>(k)])) return false;
  }
  return false;
}

thread_local bool looking = false;  // the first backtrace allocates

bool counts() {
  if (!counting || looking) return false;
  looking = true;
  const bool ours = asked_by_program();
  looking = false;
  return ours;
}

__attribute__((constructor)) void begin() {
  const char* number = std::getenv("SUPPLE_FAIL_ALLOC");
  failing = number != nullptr ? std::strtol(number, nullptr, 10) : 0;
  count_file = std::getenv("SUPPLE_COUNT_ALLOC");
  dl_iterate_phdr(find_range, nullptr);
  unsetenv("LD_PRELOAD");
}

using Main = int (*)(int, char**, char**);
Main real_main = nullptr;

int counted_main(int argc, char** argv, char** environment) {
  calls = 0;
  counting = true;
  const int code = real_main(argc, argv, environment);
  counting = false;
  return code;
}

__attribute__((destructor)) void end() {
  if (count_file == nullptr) return;
  std::array<char, 32> text{};
  const int length = std::snprintf(text.data(), text.size(), "%ld\n", calls.load());
  const long file = syscall(SYS_openat, AT_FDCWD, count_file, O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (file < 0) return;
  (void)!syscall(SYS_write, file, text.data(), static_cast<std::size_t>(length));
  syscall(SYS_close, file);
}

void* take(std::size_t size, std::size_t alignment) noexcept {
  if (counts() && calls.fetch_add(1) + 1 == failing) return nullptr;
  if (size == 0) size = 1;
  return alignment <= alignof(std::max_align_t) ? std::malloc(size) : std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
}

void* take_or_throw(std::size_t size, std::size_t alignment) {
  if (void* memory = take(size, alignment)) return memory;
  throw std::bad_alloc();
}

}  // namespace

extern "C" int __libc_start_main(Main main, int argc, char** argv, void (*init)(), void (*fini)(), void (*unload)(), void* stack) {
  using Start = int (*)(Main, int, char**, void (*)(), void (*)(), void (*)(), void*);
  real_main = main;
  return reinterpret_cast<Start>(dlsym(RTLD_NEXT, "__libc_start_main"))(counted_main, argc, argv, init, fini, unload, stack);
}

using std::align_val_t;
using std::nothrow_t;
using std::size_t;
void* operator new(size_t size) { return take_or_throw(size, 1); }
void* operator new[](size_t size) { return take_or_throw(size, 1); }
void* operator new(size_t size, align_val_t alignment) { return take_or_throw(size, size_t(alignment)); }
void* operator new[](size_t size, align_val_t alignment) { return take_or_throw(size, size_t(alignment)); }
void* operator new(size_t size, const nothrow_t&) noexcept { return take(size, 1); }
void* operator new[](size_t size, const nothrow_t&) noexcept { return take(size, 1); }
void* operator new(size_t size, align_val_t alignment, const nothrow_t&) noexcept { return take(size, size_t(alignment)); }
void* operator new[](size_t size, align_val_t alignment, const nothrow_t&) noexcept { return take(size, size_t(alignment)); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, size_t) noexcept { std::free(memory); }
void operator delete(void* memory, align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, size_t, align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, size_t, align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, const nothrow_t&) noexcept { std::free(memory); }
void operator delete[](void* memory, const nothrow_t&) noexcept { std::free(memory); }
