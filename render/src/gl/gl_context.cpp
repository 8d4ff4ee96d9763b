#include "gl/gl_context.h"

#include <dlfcn.h>

#include <algorithm>
#include <latch>
#include <system_error>
#include <thread>
#include <vector>

#include "supple/core/error.h"
#include "supple/core/out_of_threads.h"

namespace supple::render {

Library::Library(const char* file, const char* package)
    : file_(file), package_(package), handle_(::dlopen(file, RTLD_NOW | RTLD_LOCAL)) {
  if (handle_ == nullptr) {
    const char* reason = ::dlerror();
    fail(std::string("cannot be loaded: ") + (reason == nullptr ? "unknown reason" : reason));
  }
}

void* Library::address(const char* name) const {
  void* found = ::dlsym(handle_, name);
  if (found == nullptr) fail(std::string("has no function ") + name);
  return found;
}

void Library::fail(const std::string& statement) const {
  throw Error(ErrorKind::Io, Fault{.place = file_,
                                   .key = {},
                                   .expected = statement,
                                   .found = {},
                                   .hint = std::string("apt-get install ") + package_});
}

namespace {

/// Drivers of software wait for ever for threads that the system did not start: starts as many beforehand.
void expect_threads() {
  constexpr unsigned kMost = 32, kOthers = 4;  // one for each processor, and those that write caches
  std::latch tried(1);
  std::vector<std::jthread> threads;
  try {
    for (unsigned k = 0; k < std::min(kMost, std::thread::hardware_concurrency()) + kOthers; ++k) threads.emplace_back([&tried] { tried.wait(); });
  } catch (const std::system_error&) {
    tried.count_down();
    throw_out_of_threads();
  }
  tried.count_down();
}

}  // namespace

std::unique_ptr<GlContext> make_gl_context(ContextKind kind) {
  expect_threads();
  return kind == ContextKind::Egl ? make_egl_context() : make_osmesa_context();
}

}  // namespace supple::render
