#include <GL/osmesa.h>

#include <array>

#include "gl/gl_context.h"

namespace supple::render {
namespace {

class OsMesaContext final : public GlContext {
 public:
  OsMesaContext()
      : library_("libOSMesa.so.8", "libosmesa6"),
        create_(library_.symbol<decltype(create_)>("OSMesaCreateContextAttribs")),
        destroy_(library_.symbol<decltype(destroy_)>("OSMesaDestroyContext")),
        make_current_(library_.symbol<decltype(make_current_)>("OSMesaMakeCurrent")),
        get_proc_address_(library_.symbol<decltype(get_proc_address_)>("OSMesaGetProcAddress")) {
    for (const std::array<int, 2> version : {std::array{4, 5}, std::array{3, 3}}) {
      const std::array attributes = {OSMESA_FORMAT, OSMESA_RGBA, OSMESA_PROFILE, OSMESA_CORE_PROFILE,
                                     OSMESA_CONTEXT_MAJOR_VERSION, version[0],
                                     OSMESA_CONTEXT_MINOR_VERSION, version[1], 0};
      context_ = create_(attributes.data(), nullptr);
      if (context_ != nullptr) return;
    }
    library_.fail("cannot make an OpenGL 3.3 core context");
  }

  ~OsMesaContext() override {
    release();
    destroy_(context_);
  }
  OsMesaContext(const OsMesaContext&) = delete;
  OsMesaContext& operator=(const OsMesaContext&) = delete;

  void make_current() override {
    // Pictures are drawn into framebuffer objects; OSMesa needs a window buffer nevertheless.
    if (make_current_(context_, window_.data(), GL_UNSIGNED_BYTE, kWindow, kWindow) != GL_TRUE)
      library_.fail("cannot make its context current");
  }
  void release() noexcept override { make_current_(nullptr, nullptr, GL_UNSIGNED_BYTE, 0, 0); }
  GlFunction function(const char* name) const override { return get_proc_address_(name); }
  std::string name() const override { return "OSMesa"; }

 private:
  static constexpr int kWindow = 16;
  Library library_;
  decltype(&OSMesaCreateContextAttribs) create_;
  decltype(&OSMesaDestroyContext) destroy_;
  decltype(&OSMesaMakeCurrent) make_current_;
  decltype(&OSMesaGetProcAddress) get_proc_address_;
  OSMesaContext context_ = nullptr;
  std::array<unsigned char, 4 * kWindow * kWindow> window_{};
};

}  // namespace

std::unique_ptr<GlContext> make_osmesa_context() { return std::make_unique<OsMesaContext>(); }

}  // namespace supple::render
