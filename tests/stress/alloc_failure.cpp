/// A library to be preloaded that makes allocations of a program fail, for tests of its reaction:
///
///     SUPPLE_FAIL_AT=1234 LD_PRELOAD=liballoc_failure.so supple run scene.yaml --out folder
///
/// Variables of the environment:
///   SUPPLE_FAIL_AT     the allocation that fails, counted from 1; 0 or absent: none
///   SUPPLE_FAIL_MANY   how many fail from there on (default 1; 0: all)
///   SUPPLE_FAIL_KIND   `new` (default): operator new, by whichever library it is called; `malloc`: malloc, calloc, realloc and
///                      posix_memalign where the program itself calls them
///   SUPPLE_FAIL_COUNT  a file that gets the number of allocations when the program ends
///   SUPPLE_SERVE       many runs by one process (served.h); NUMBER is SUPPLE_FAIL_AT, WORD SUPPLE_FAIL_KIND
#include <fcntl.h>
#include <link.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>

#include "served.h"

extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
}

namespace {

struct Settings {
  long at = 0;
  long many = 1;
  bool of_malloc = false;
  const char* count_file = nullptr;
  std::uintptr_t text_begin = 0, text_end = 0;  // of the program itself
};

Settings settings;
std::atomic<bool> ready{false};
std::atomic<long> seen{0};

long number(const char* name, long otherwise) {
  const char* text = std::getenv(name);
  return text != nullptr ? std::strtol(text, nullptr, 10) : otherwise;
}

/// The program is the first object of the list.
int keep_text(dl_phdr_info* info, std::size_t, void*) {
  for (int k = 0; k < info->dlpi_phnum; ++k) {
    const auto& part = info->dlpi_phdr[k];
    if (part.p_type != PT_LOAD || (part.p_flags & PF_X) == 0) continue;
    settings.text_begin = info->dlpi_addr + part.p_vaddr;
    settings.text_end = settings.text_begin + part.p_memsz;
  }
  return 1;
}

__attribute__((constructor)) void begin() {
  settings.at = number("SUPPLE_FAIL_AT", 0);
  settings.many = number("SUPPLE_FAIL_MANY", 1);
  const char* kind = std::getenv("SUPPLE_FAIL_KIND");
  settings.count_file = std::getenv("SUPPLE_FAIL_COUNT");
  dl_iterate_phdr(keep_text, nullptr);
  supple::stress::Request request;
  if (supple::stress::serve(request)) {
    settings.at = request.number;
    kind = request.word.data();
  }
  settings.of_malloc = kind != nullptr && std::strcmp(kind, "malloc") == 0;
  ready.store(true);
}

__attribute__((destructor)) void end() {
  if (settings.count_file == nullptr) return;
  const int file = ::open(settings.count_file, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file < 0) return;
  char text[32];
  const int length = std::snprintf(text, sizeof text, "%ld\n", seen.load());
  static_cast<void>(!::write(file, text, static_cast<std::size_t>(length)));
  ::close(file);
}

bool fails() {
  if (!ready.load(std::memory_order_relaxed)) return false;
  const long n = seen.fetch_add(1) + 1;
  return settings.at > 0 && n >= settings.at && (settings.many == 0 || n < settings.at + settings.many);
}

bool malloc_fails(const void* caller) {
  const auto at = reinterpret_cast<std::uintptr_t>(caller);
  return settings.of_malloc && at >= settings.text_begin && at < settings.text_end && fails();
}

void* allocate(std::size_t size, std::size_t alignment) {
  if (!settings.of_malloc && fails()) return nullptr;
  return alignment == 0 ? __libc_malloc(size == 0 ? 1 : size) : __libc_memalign(alignment, size);
}

/// As in the standard: the new-handler is called until it makes room, or throws.
void* allocate_or_throw(std::size_t size, std::size_t alignment) {
  for (;;) {
    if (void* memory = allocate(size, alignment)) return memory;
    const std::new_handler handler = std::get_new_handler();
    if (handler == nullptr) throw std::bad_alloc();
    handler();
  }
}

}  // namespace

void* operator new(std::size_t size) { return allocate_or_throw(size, 0); }
void* operator new[](std::size_t size) { return allocate_or_throw(size, 0); }
void* operator new(std::size_t size, std::align_val_t alignment) { return allocate_or_throw(size, static_cast<std::size_t>(alignment)); }
void* operator new[](std::size_t size, std::align_val_t alignment) { return allocate_or_throw(size, static_cast<std::size_t>(alignment)); }
void* operator new(std::size_t size, const std::nothrow_t&) noexcept { return allocate(size, 0); }
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept { return allocate(size, 0); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }

extern "C" {

void* malloc(std::size_t size) {
  if (!malloc_fails(__builtin_return_address(0))) return __libc_malloc(size);
  errno = ENOMEM;
  return nullptr;
}
void* calloc(std::size_t count, std::size_t size) {
  if (!malloc_fails(__builtin_return_address(0))) return __libc_calloc(count, size);
  errno = ENOMEM;
  return nullptr;
}
void* realloc(void* memory, std::size_t size) {
  if (size == 0 || !malloc_fails(__builtin_return_address(0))) return __libc_realloc(memory, size);
  errno = ENOMEM;
  return nullptr;
}
int posix_memalign(void** memory, std::size_t alignment, std::size_t size) {
  if (malloc_fails(__builtin_return_address(0))) return ENOMEM;
  *memory = __libc_memalign(alignment, size);
  return *memory != nullptr ? 0 : ENOMEM;
}

}  // extern "C"
