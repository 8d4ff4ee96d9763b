/// @file gl_context.h
/// An OpenGL core context without a window. The drawing code uses this and no window system.
#pragma once

#include <memory>
#include <string>

#include "supple/render/renderer.h"

namespace supple::render {

using GlFunction = void (*)();

class GlContext {
 public:
  virtual ~GlContext() = default;
  /// Makes this the calling thread's context. @throws Error{Io} when the driver refuses.
  virtual void make_current() = 0;
  /// Leaves the thread without a context, so that one of another kind can be made current.
  virtual void release() noexcept = 0;
  /// Null when the driver has no such function.
  [[nodiscard]] virtual GlFunction function(const char* name) const = 0;
  /// "OSMesa" or "EGL"
  [[nodiscard]] virtual std::string name() const = 0;
};

/// While it lives, the context is the thread's.
class CurrentContext {
 public:
  explicit CurrentContext(GlContext& context) : context_(context) { context_.make_current(); }
  ~CurrentContext() { context_.release(); }
  CurrentContext(const CurrentContext&) = delete;
  CurrentContext& operator=(const CurrentContext&) = delete;

 private:
  GlContext& context_;
};

/// OpenGL 4.5 core, or 3.3 core where that is all there is. @throws Error{Io} naming the library and its package; Error{Limit} where the system
/// starts no more threads, for which drivers would wait.
[[nodiscard]] std::unique_ptr<GlContext> make_gl_context(ContextKind kind);
[[nodiscard]] std::unique_ptr<GlContext> make_osmesa_context();
[[nodiscard]] std::unique_ptr<GlContext> make_egl_context();

/// A shared library, opened at first use and kept for the life of the process (drivers do not survive an unload).
class Library {
 public:
  /// @throws Error{Io} naming the library, the loader's reason and `apt-get install PACKAGE`.
  Library(const char* file, const char* package);
  /// @throws Error{Io} when the library lacks the symbol.
  template <class Function>
  [[nodiscard]] Function symbol(const char* name) const {
    return reinterpret_cast<Function>(address(name));
  }
  [[noreturn]] void fail(const std::string& statement) const;

 private:
  [[nodiscard]] void* address(const char* name) const;
  const char* file_;
  const char* package_;
  void* handle_;
};

}  // namespace supple::render
