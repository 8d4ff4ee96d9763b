#include "last_resort.h"

#include <cxxabi.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <new>
#include <system_error>
#include <typeinfo>

#include "supple/core/error.h"
#include "supple/core/io/open_temporaries.h"
#include "supple/core/out_of_threads.h"
#include "supple/scenes/run.h"

namespace supple::tool {
namespace {

constexpr std::size_t kReserve = std::size_t{1} << 20;  // [byte]
std::atomic<void*> reserve{nullptr};
std::atomic<bool> ran_out{false};

/// A new-handler. @throws std::bad_alloc
void let_reserve_go() {
  std::free(reserve.exchange(nullptr));
  ran_out = true;
  throw std::bad_alloc();
}

void say(const char* text) { static_cast<void>(!::write(STDERR_FILENO, text, std::strlen(text))); }

/// Allocates nothing, and calls only functions that are safe in any state of the program.
[[noreturn]] void end_program() {
  const std::type_info* type = abi::__cxa_current_exception_type();
  // Functions of the standard library that may not throw, as those that list folders, do not tell what they could not throw.
  const bool no_memory = type != nullptr ? *type == typeid(std::bad_alloc) || *type == typeid(std::bad_array_new_length) : ran_out.load();
  const bool no_thread = type != nullptr && *type == typeid(std::system_error);  // of std::thread
  say(no_memory ? scenes::kOutOfMemory : no_thread ? kOutOfThreads : "internal fault: an exception that no code could handle");
  if (!no_memory && !no_thread && type != nullptr) {
    say(": ");
    say(type->name());
  }
  say("\n");
  io::remove_open_temporaries();
  _exit(static_cast<int>(no_memory || no_thread ? ErrorKind::Limit : ErrorKind::Internal));
}

/// Libraries make objects and start threads before main, where nobody can catch what they throw. This comes before all of them, as constructors of
/// a program come after those of its libraries.
void begin() { std::set_terminate(end_program); }
[[gnu::section(".preinit_array"), gnu::used]] void (*const before_libraries)() = begin;

}  // namespace

void prepare_last_resort() {
  reserve = std::malloc(kReserve);
  std::set_new_handler(let_reserve_go);
}

}  // namespace supple::tool
