#pragma once

// A linked pair of shaders.

#include <string>

#include <renderer/gl_functions.hpp>
#include <renderer/view.hpp>

namespace piecework::render {

/// A GL program; it dies with its context, like all GL objects here. The context must be current
/// whenever a member is called.
class GlProgram {
 public:
  /// \param defines  "#define ..." lines put behind the version line of both shaders
  /// \throws BackendError with the compiler's log.
  GlProgram(const GlFunctions& gl, const char* vertex, const char* fragment,
            const std::string& defines = {});

  void use() const { gl_->UseProgram(id_); }
  void set(const char* name, int value) const { gl_->Uniform1i(at(name), value); }
  void set(const char* name, float value) const { gl_->Uniform1f(at(name), value); }
  void set(const char* name, const Eigen::Vector3f& v) const {
    gl_->Uniform3f(at(name), v.x(), v.y(), v.z());
  }
  void set(const char* name, const Eigen::Vector4f& v) const {
    gl_->Uniform4f(at(name), v.x(), v.y(), v.z(), v.w());
  }
  void set(const char* name, const Eigen::Matrix4f& m) const {
    gl_->UniformMatrix4fv(at(name), 1, GL_FALSE, m.data());
  }

 private:
  /// -1, which GL ignores, for a uniform that the compiler has dropped.
  [[nodiscard]] GLint at(const char* name) const { return gl_->GetUniformLocation(id_, name); }

  const GlFunctions* gl_;
  GLuint id_;
};

}  // namespace piecework::render
