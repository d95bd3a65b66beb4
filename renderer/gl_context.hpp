#pragma once

// Where an offscreen OpenGL 3.3 core context comes from. Libraries are loaded at run time.

#include <memory>
#include <span>
#include <string>

#include <renderer/gl_functions.hpp>
#include <renderer/renderer.hpp>

namespace piecework::render {

/// Owner of one context. Every GL object dies with it.
class GlContext {
 public:
  virtual ~GlContext() = default;
  GlContext(const GlContext&) = delete;
  GlContext& operator=(const GlContext&) = delete;

  /// \throws BackendError.
  virtual void make_current() = 0;
  /// Leaves the calling thread without a context.
  virtual void release() = 0;

  /// Valid while the context is current.
  [[nodiscard]] const GlFunctions& gl() const { return gl_; }
  /// "OSMesa 4.5 (Core Profile) Mesa 22.3.6, llvmpipe (LLVM 15.0.6, 256 bits)"
  [[nodiscard]] const std::string& description() const { return description_; }

 protected:
  GlContext() = default;
  /// Fills the table and tests the version, which must be 3.3 or later: a loader may well return
  /// an address for a function that does not exist. The context must be current.
  void load(const char* provider, const GlLoader& loader);

 private:
  GlFunctions gl_;
  std::string description_;
};

/// Makes a context current for a scope.
class CurrentContext {
 public:
  explicit CurrentContext(GlContext& context) : context_(context) { context_.make_current(); }
  ~CurrentContext() { context_.release(); }
  CurrentContext(const CurrentContext&) = delete;
  CurrentContext& operator=(const CurrentContext&) = delete;

 private:
  GlContext& context_;
};

/// Library names to try, in this order.
using LibraryNames = std::span<const char* const>;
LibraryNames osmesa_libraries();
LibraryNames egl_libraries();

/// \throws BackendError that says which library or feature is missing and which package has it.
std::unique_ptr<GlContext> create_osmesa_context(LibraryNames libraries = osmesa_libraries());
std::unique_ptr<GlContext> create_egl_context(LibraryNames libraries = egl_libraries());

/// Auto is OSMesa, then EGL. \throws BackendError with the reasons of all that were tried.
std::unique_ptr<GlContext> create_context(Provider provider,
                                          LibraryNames osmesa = osmesa_libraries(),
                                          LibraryNames egl = egl_libraries());

}  // namespace piecework::render
