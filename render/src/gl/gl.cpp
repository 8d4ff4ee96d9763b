#include "gl/gl.h"

#include <algorithm>
#include <array>

#include "supple/core/error.h"

namespace supple::render {
namespace {

[[noreturn]] void shader_failed(const std::string& what, const std::string& log) {
  throw Error(ErrorKind::Internal,
              Fault{.place = "render", .key = {}, .expected = what + ": " + log, .found = {}, .hint = {}});
}

GLuint compile(const Gl& gl, GLenum stage, const std::string& text) {
  const GLuint shader = gl.CreateShader(stage);
  const char* source = text.c_str();
  gl.ShaderSource(shader, 1, &source, nullptr);
  gl.CompileShader(shader);
  GLint done = GL_FALSE;
  gl.GetShaderiv(shader, GL_COMPILE_STATUS, &done);
  if (done != GL_TRUE) {
    std::string log(4096, '\0');
    GLsizei length = 0;
    gl.GetShaderInfoLog(shader, static_cast<GLsizei>(log.size()), &length, log.data());
    shader_failed("a shader does not compile", log.substr(0, static_cast<std::size_t>(length)));
  }
  return shader;
}

GLuint make_texture(const Gl& gl, int width, int height, GLenum internal, const TargetFormat& format, bool is_depth) {
  GLuint texture = 0;
  gl.GenTextures(1, &texture);
  if (format.samples > 1) {
    gl.BindTexture(GL_TEXTURE_2D_MULTISAMPLE, texture);
    gl.TexImage2DMultisample(GL_TEXTURE_2D_MULTISAMPLE, format.samples, internal, width, height, GL_TRUE);
    return texture;
  }
  gl.BindTexture(GL_TEXTURE_2D, texture);
  const bool is_integer = internal == GL_RG32UI;
  gl.TexImage2D(GL_TEXTURE_2D, 0, static_cast<GLint>(internal), width, height, 0,
                is_depth ? GL_DEPTH_COMPONENT : (is_integer ? GL_RG_INTEGER : GL_RGBA),
                is_integer ? GL_UNSIGNED_INT : GL_FLOAT, nullptr);
  const auto filter = static_cast<GLint>(is_depth ? GL_NEAREST : format.filter);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, filter);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, filter);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  return texture;
}

void check_complete(const Gl& gl, int width, int height, int samples) {
  if (gl.CheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE || gl.GetError() != GL_NO_ERROR)
    throw Error(ErrorKind::Limit, Fault{.place = "render",
                                        .key = {},
                                        .expected = "the driver cannot hold a picture of " + std::to_string(width) +
                                                    " x " + std::to_string(height) + " pixels with " +
                                                    std::to_string(std::max(1, samples)) + " samples",
                                        .found = {},
                                        .hint = "use a smaller picture or fewer samples"});
}

}  // namespace

Gl::Gl(const GlContext& context) {
  const auto load = [&context](const char* name) {
    const GlFunction function = context.function(name);
    if (function == nullptr)
      throw Error(ErrorKind::Io, Fault{.place = context.name(),
                                       .key = {},
                                       .expected = std::string("the driver has no function ") + name,
                                       .found = {},
                                       .hint = "OpenGL 4.5 or later is needed"});
    return function;
  };
#define SUPPLE_GL_LOAD(type, name) name = reinterpret_cast<PFNGL##type##PROC>(load("gl" #name));
  SUPPLE_GL_FUNCTIONS(SUPPLE_GL_LOAD)
#undef SUPPLE_GL_LOAD
}

int Gl::integer(GLenum name) const {
  GLint value = 0;
  GetIntegerv(name, &value);
  return value;
}

std::string Gl::text(GLenum name) const {
  const GLubyte* value = GetString(name);
  return value == nullptr ? std::string() : std::string(reinterpret_cast<const char*>(value));
}

Program::Program(const Gl& gl, const std::string& vertex_text, const std::string& fragment_text)
    : gl_(&gl), id_(gl.CreateProgram()) {
  const GLuint vertex = compile(gl, GL_VERTEX_SHADER, vertex_text);
  const GLuint fragment = compile(gl, GL_FRAGMENT_SHADER, fragment_text);
  gl.AttachShader(id_, vertex);
  gl.AttachShader(id_, fragment);
  gl.LinkProgram(id_);
  gl.DeleteShader(vertex);
  gl.DeleteShader(fragment);
  GLint done = GL_FALSE;
  gl.GetProgramiv(id_, GL_LINK_STATUS, &done);
  if (done != GL_TRUE) {
    std::string log(4096, '\0');
    GLsizei length = 0;
    gl.GetProgramInfoLog(id_, static_cast<GLsizei>(log.size()), &length, log.data());
    shader_failed("a shader program does not link", log.substr(0, static_cast<std::size_t>(length)));
  }
}

Target make_target(const Gl& gl, int width, int height, const TargetFormat& format) {
  Target target{.framebuffer = 0, .colour = 0, .depth = 0, .width = width, .height = height};
  const GLenum texture_kind = format.samples > 1 ? GL_TEXTURE_2D_MULTISAMPLE : GL_TEXTURE_2D;
  gl.GenFramebuffers(1, &target.framebuffer);
  gl.BindFramebuffer(GL_FRAMEBUFFER, target.framebuffer);
  if (format.colour != 0) {
    target.colour = make_texture(gl, width, height, format.colour, format, false);
    gl.FramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, texture_kind, target.colour, 0);
  } else {
    gl.DrawBuffer(GL_NONE);
    gl.ReadBuffer(GL_NONE);
  }
  if (format.depth) {
    target.depth = make_texture(gl, width, height, GL_DEPTH_COMPONENT32F, format, true);
    gl.FramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, texture_kind, target.depth, 0);
  }
  check_complete(gl, width, height, format.samples);
  return target;
}

Target add_colour(const Gl& gl, const Target& first, const TargetFormat& format) {
  Target target = {.framebuffer = 0, .colour = 0, .depth = first.depth, .width = first.width, .height = first.height};
  const GLenum kind = format.samples > 1 ? GL_TEXTURE_2D_MULTISAMPLE : GL_TEXTURE_2D;
  gl.GenFramebuffers(1, &target.framebuffer);
  gl.BindFramebuffer(GL_FRAMEBUFFER, target.framebuffer);
  target.colour = make_texture(gl, first.width, first.height, format.colour, format, false);
  gl.FramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, kind, first.colour, 0);
  gl.FramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT1, kind, target.colour, 0);
  gl.FramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, kind, first.depth, 0);
  constexpr std::array<GLenum, 2> both = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
  gl.DrawBuffers(2, both.data());
  check_complete(gl, first.width, first.height, format.samples);
  return target;
}

}  // namespace supple::render
