#include <renderer/gl_program.hpp>

#include <array>
#include <vector>

#include <piecework/core/error.hpp>

namespace piecework::render {
namespace {

GLuint compile(const GlFunctions& gl, GLenum kind, const char* source, const std::string& defines) {
  const GLuint shader = gl.CreateShader(kind);
  const std::array<const char*, 3> parts{"#version 330 core\n", defines.c_str(), source};
  gl.ShaderSource(shader, static_cast<GLsizei>(parts.size()), parts.data(), nullptr);
  gl.CompileShader(shader);
  GLint ok = 0;
  gl.GetShaderiv(shader, GL_COMPILE_STATUS, &ok);
  if (ok == 0) {
    std::vector<char> log(4096, '\0');
    gl.GetShaderInfoLog(shader, static_cast<GLsizei>(log.size()), nullptr, log.data());
    gl.DeleteShader(shader);
    throw BackendError(std::string("OpenGL: a shader does not compile: ") + log.data());
  }
  return shader;
}

}  // namespace

GlProgram::GlProgram(const GlFunctions& gl, const char* vertex, const char* fragment,
                     const std::string& defines)
    : gl_(&gl), id_(gl.CreateProgram()) {
  for (const auto& [kind, source] : {std::pair{GLenum{GL_VERTEX_SHADER}, vertex},
                                     std::pair{GLenum{GL_FRAGMENT_SHADER}, fragment}}) {
    const GLuint shader = compile(gl, kind, source, defines);
    gl.AttachShader(id_, shader);
    gl.DeleteShader(shader);  // lives on in the program
  }
  gl.LinkProgram(id_);
  GLint ok = 0;
  gl.GetProgramiv(id_, GL_LINK_STATUS, &ok);
  if (ok == 0) {
    std::vector<char> log(4096, '\0');
    gl.GetProgramInfoLog(id_, static_cast<GLsizei>(log.size()), nullptr, log.data());
    throw BackendError(std::string("OpenGL: shaders do not link: ") + log.data());
  }
}

}  // namespace piecework::render
