// Keeps the window system's headers out of eglplatform.h.
#define EGL_NO_X11
#include <EGL/egl.h>
#include <EGL/eglext.h>

#include <array>

#include "gl/gl_context.h"

namespace supple::render {
namespace {

class EglContext final : public GlContext {
 public:
  EglContext()
      : library_("libEGL.so.1", "libegl1 libegl-mesa0"),
        get_proc_address_(library_.symbol<decltype(get_proc_address_)>("eglGetProcAddress")),
        make_current_(library_.symbol<decltype(make_current_)>("eglMakeCurrent")),
        destroy_(library_.symbol<decltype(destroy_)>("eglDestroyContext")),
        bind_api_(library_.symbol<decltype(bind_api_)>("eglBindAPI")) {
    const auto get_display = reinterpret_cast<PFNEGLGETPLATFORMDISPLAYEXTPROC>(
        get_proc_address_("eglGetPlatformDisplayEXT"));
    const auto initialize = library_.symbol<decltype(&eglInitialize)>("eglInitialize");
    const auto choose = library_.symbol<decltype(&eglChooseConfig)>("eglChooseConfig");
    const auto create = library_.symbol<decltype(&eglCreateContext)>("eglCreateContext");

    if (get_display != nullptr) display_ = get_display(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
    EGLint major = 0;
    EGLint minor = 0;
    if (display_ == EGL_NO_DISPLAY || initialize(display_, &major, &minor) != EGL_TRUE)
      library_.fail("has no surfaceless display");
    if (bind_api_(EGL_OPENGL_API) != EGL_TRUE) library_.fail("has no desktop OpenGL");

    const std::array<EGLint, 5> wanted = {EGL_SURFACE_TYPE, 0, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
    EGLConfig config = nullptr;
    EGLint count = 0;
    if (choose(display_, wanted.data(), &config, 1, &count) != EGL_TRUE || count == 0)
      library_.fail("has no OpenGL configuration");
    for (const std::array<EGLint, 2> version : {std::array<EGLint, 2>{4, 5}, std::array<EGLint, 2>{3, 3}}) {
      const std::array<EGLint, 7> attributes = {EGL_CONTEXT_MAJOR_VERSION, version[0],
                                                EGL_CONTEXT_MINOR_VERSION, version[1],
                                                EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                                EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, EGL_NONE};
      context_ = create(display_, config, EGL_NO_CONTEXT, attributes.data());
      if (context_ != EGL_NO_CONTEXT) return;
    }
    library_.fail("cannot make an OpenGL 3.3 core context");
  }

  ~EglContext() override {
    release();
    destroy_(display_, context_);
  }
  EglContext(const EglContext&) = delete;
  EglContext& operator=(const EglContext&) = delete;

  void make_current() override {
    if (bind_api_(EGL_OPENGL_API) != EGL_TRUE ||
        make_current_(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_) != EGL_TRUE)
      library_.fail("cannot make its context current");
  }
  void release() noexcept override { make_current_(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT); }
  GlFunction function(const char* name) const override { return get_proc_address_(name); }
  std::string name() const override { return "EGL"; }

 private:
  Library library_;
  decltype(&eglGetProcAddress) get_proc_address_;
  decltype(&eglMakeCurrent) make_current_;
  decltype(&eglDestroyContext) destroy_;
  decltype(&eglBindAPI) bind_api_;
  EGLDisplay display_ = EGL_NO_DISPLAY;  // shared by all of the process, never terminated
  EGLContext context_ = EGL_NO_CONTEXT;
};

}  // namespace

std::unique_ptr<GlContext> make_egl_context() { return std::make_unique<EglContext>(); }

}  // namespace supple::render
