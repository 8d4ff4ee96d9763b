#include "gl/gl_context.h"

#include <dlfcn.h>

#include "supple/core/error.h"

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

std::unique_ptr<GlContext> make_gl_context(ContextKind kind) {
  return kind == ContextKind::Egl ? make_egl_context() : make_osmesa_context();
}

}  // namespace supple::render
