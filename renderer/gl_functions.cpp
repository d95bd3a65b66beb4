#include <renderer/gl_functions.hpp>

#include <string>

#include <piecework/core/error.hpp>

namespace piecework::render {
namespace {

const char* error_name(GLenum error) {
  switch (error) {
    case GL_INVALID_ENUM:
      return "invalid enum";
    case GL_INVALID_VALUE:
      return "invalid value";
    case GL_INVALID_OPERATION:
      return "invalid operation";
    case GL_INVALID_FRAMEBUFFER_OPERATION:
      return "invalid framebuffer operation";
    case GL_OUT_OF_MEMORY:
      return "out of memory";
    default:
      return "unknown error";
  }
}

template <class Function>
void load_one(Function& function, const char* name, const GlLoader& loader) {
  void* address = loader(name);
  if (address == nullptr) {
    throw BackendError(std::string("OpenGL: function ") + name + " is missing");
  }
  function = reinterpret_cast<Function>(address);
}

}  // namespace

void GlFunctions::load(const GlLoader& loader) {
#define PIECEWORK_GL_LOAD(Type, Name) load_one(Name, "gl" #Name, loader);
  PIECEWORK_GL_FUNCTIONS(PIECEWORK_GL_LOAD)
#undef PIECEWORK_GL_LOAD
}

void GlFunctions::check(const char* where) const {
  const GLenum error = GetError();
  if (error == GL_NO_ERROR) return;
  constexpr int kMaxPending = 16;  // a lost context reports errors for ever
  for (int i = 0; i < kMaxPending && GetError() != GL_NO_ERROR; ++i) {
  }
  throw BackendError(std::string("OpenGL: ") + error_name(error) + " while " + where);
}

}  // namespace piecework::render
