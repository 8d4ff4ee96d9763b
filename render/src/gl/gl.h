/// @file gl.h
/// The OpenGL functions the renderer uses, loaded from its context, and the few composed operations it needs.
/// Objects are not deleted one by one: they go with the context, which the renderer owns.
#pragma once

#include <GL/glcorearb.h>

#include <span>
#include <string>

#include "gl/gl_context.h"
#include "supple/core/types.h"

namespace supple::render {

// X(type suffix in capitals, name): one line per function; the list is all OpenGL that we use.
#define SUPPLE_GL_FUNCTIONS(X)                                                                                \
  X(ACTIVETEXTURE, ActiveTexture) X(ATTACHSHADER, AttachShader) X(BINDBUFFER, BindBuffer)                     \
  X(BINDFRAMEBUFFER, BindFramebuffer) X(BINDSAMPLER, BindSampler) X(BINDTEXTURE, BindTexture)                 \
  X(BINDVERTEXARRAY, BindVertexArray) X(BLENDFUNC, BlendFunc) X(BUFFERDATA, BufferData)               \
  X(CHECKFRAMEBUFFERSTATUS, CheckFramebufferStatus) X(CLEAR, Clear)         \
  X(CLEARCOLOR, ClearColor) X(CLEARDEPTH, ClearDepth) X(CLIPCONTROL, ClipControl) X(COMPILESHADER, CompileShader) X(CREATEPROGRAM, CreateProgram)                   \
  X(CREATESHADER, CreateShader) X(CULLFACE, CullFace) X(DELETEBUFFERS, DeleteBuffers)                         \
  X(DELETESHADER, DeleteShader) X(DELETETEXTURES, DeleteTextures) X(DEPTHFUNC, DepthFunc)                     \
  X(DEPTHMASK, DepthMask) X(DISABLE, Disable) X(DRAWARRAYS, DrawArrays) X(DRAWBUFFER, DrawBuffer)             \
  X(DRAWBUFFERS, DrawBuffers) X(DRAWELEMENTS, DrawElements) X(ENABLE, Enable)                                 \
  X(ENABLEVERTEXATTRIBARRAY, EnableVertexAttribArray) X(FINISH, Finish)                                       \
  X(FRAMEBUFFERTEXTURE2D, FramebufferTexture2D) X(GENBUFFERS, GenBuffers) X(GENFRAMEBUFFERS, GenFramebuffers) \
  X(GENSAMPLERS, GenSamplers) X(GENTEXTURES, GenTextures) X(GENVERTEXARRAYS, GenVertexArrays)                 \
  X(GENERATEMIPMAP, GenerateMipmap) X(GETERROR, GetError) X(GETINTEGERV, GetIntegerv)                         \
  X(GETMULTISAMPLEFV, GetMultisamplefv)                                                                       \
  X(GETPROGRAMINFOLOG, GetProgramInfoLog) X(GETPROGRAMIV, GetProgramiv) X(GETSHADERINFOLOG, GetShaderInfoLog) \
  X(GETSHADERIV, GetShaderiv) X(GETSTRING, GetString) X(GETUNIFORMLOCATION, GetUniformLocation)               \
  X(LINKPROGRAM, LinkProgram) X(PIXELSTOREI, PixelStorei) X(POLYGONMODE, PolygonMode)                         \
  X(POLYGONOFFSET, PolygonOffset) X(READBUFFER, ReadBuffer) X(READPIXELS, ReadPixels)                         \
  X(SAMPLEMASKI, SampleMaski) X(SAMPLERPARAMETERI, SamplerParameteri) X(SHADERSOURCE, ShaderSource)           \
  X(TEXIMAGE2D, TexImage2D) X(TEXIMAGE2DMULTISAMPLE, TexImage2DMultisample) X(TEXPARAMETERI, TexParameteri)   \
  X(UNIFORM1F, Uniform1f) X(UNIFORM1I, Uniform1i) X(UNIFORM2F, Uniform2f) X(UNIFORM2FV, Uniform2fv) X(UNIFORM3F, Uniform3f) \
  X(UNIFORM3FV, Uniform3fv) X(UNIFORMMATRIX4FV, UniformMatrix4fv) X(USEPROGRAM, UseProgram)                   \
  X(VERTEXATTRIBPOINTER, VertexAttribPointer) X(VIEWPORT, Viewport)

/// One member per function, without the gl prefix. @pre the context is current whenever a member is called.
struct Gl {
#define SUPPLE_GL_MEMBER(type, name) PFNGL##type##PROC name = nullptr;
  SUPPLE_GL_FUNCTIONS(SUPPLE_GL_MEMBER)
#undef SUPPLE_GL_MEMBER

  /// @throws Error{Io} naming the first function the driver lacks.
  explicit Gl(const GlContext& context);

  [[nodiscard]] int integer(GLenum name) const;
  [[nodiscard]] std::string text(GLenum name) const;
};

/// A linked pair of shaders and its uniforms.
class Program {
 public:
  /// @throws Error{Internal} with the driver's log when the text does not compile.
  Program(const Gl& gl, const std::string& vertex_text, const std::string& fragment_text);
  void use() const { gl_->UseProgram(id_); }
  // Setters need the program in use; a uniform the compiler removed is ignored.
  void set(const char* name, int value) const { gl_->Uniform1i(location(name), value); }
  void set(const char* name, float value) const { gl_->Uniform1f(location(name), value); }
  void set(const char* name, const Eigen::Vector2f& v) const { gl_->Uniform2f(location(name), v.x(), v.y()); }
  void set(const char* name, const Eigen::Vector3f& v) const { gl_->Uniform3f(location(name), v.x(), v.y(), v.z()); }
  void set(const char* name, std::span<const Eigen::Vector2f> vectors) const {
    gl_->Uniform2fv(location(name), static_cast<GLsizei>(vectors.size()), vectors.data()->data());
  }
  void set(const char* name, std::span<const Eigen::Vector3f> vectors) const {
    gl_->Uniform3fv(location(name), static_cast<GLsizei>(vectors.size()), vectors.data()->data());
  }
  void set(const char* name, const Eigen::Matrix4f& m) const {
    gl_->UniformMatrix4fv(location(name), 1, GL_FALSE, m.data());
  }

 private:
  [[nodiscard]] GLint location(const char* name) const { return gl_->GetUniformLocation(id_, name); }
  const Gl* gl_;
  GLuint id_;
};

/// A texture and the framebuffer that draws into it (with depth where requested).
struct Target {
  GLuint framebuffer = 0;
  GLuint colour = 0;
  GLuint depth = 0;
  int width = 0;
  int height = 0;
};

struct TargetFormat {
  GLenum colour = 0;   ///< sized internal format; 0: depth only
  bool depth = false;  ///< a 32 bit float depth buffer
  int samples = 1;     ///< above 1: multisampled
  GLenum filter = GL_NEAREST;
};

/// A framebuffer of two targets of equal size: depth and first colour of `first`, and a second texture.
[[nodiscard]] Target add_colour(const Gl& gl, const Target& first, const TargetFormat& format);
/// @throws Error{Limit} when the driver cannot hold it.
[[nodiscard]] Target make_target(const Gl& gl, int width, int height, const TargetFormat& format);

}  // namespace supple::render
