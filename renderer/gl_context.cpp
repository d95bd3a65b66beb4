#include <renderer/gl_context.hpp>

#include <array>

#include <dlfcn.h>

#include <piecework/core/error.hpp>

namespace piecework::render {
namespace {

/// Opens a library and leaves it open: graphics drivers start threads and register exit handlers
/// that do not survive being unloaded.
void* open_library(LibraryNames names, const char* package_hint) {
  std::string tried;
  for (const char* name : names) {
    if (void* handle = dlopen(name, RTLD_NOW | RTLD_LOCAL)) return handle;
    tried += std::string(tried.empty() ? "" : ", ") + name;
  }
  throw BackendError("cannot load " + tried + "; install " + package_hint);
}

template <class Function>
Function symbol(void* library, const char* name) {
  void* address = dlsym(library, name);
  if (address == nullptr) throw BackendError(std::string("function ") + name + " is missing");
  return reinterpret_cast<Function>(address);
}

// ---- OSMesa: the few declarations we need of GL/osmesa.h ------------------------------------

constexpr const char* kOsmesaPackage = "libosmesa6";
constexpr int kOsmesaFormat = 0x22;
constexpr int kOsmesaDepthBits = 0x30;
constexpr int kOsmesaProfile = 0x33;
constexpr int kOsmesaCoreProfile = 0x34;
constexpr int kOsmesaMajorVersion = 0x36;
constexpr int kOsmesaMinorVersion = 0x37;

struct OsmesaFunctions {
  void* (*create)(const int* attributes, void* share) = nullptr;
  unsigned char (*make_current)(void* context, void* buffer, GLenum type, int width,
                                int height) = nullptr;
  void (*destroy)(void* context) = nullptr;
  void* (*address)(const char* name) = nullptr;

  explicit OsmesaFunctions(void* library)
      : create(symbol<decltype(create)>(library, "OSMesaCreateContextAttribs")),
        make_current(symbol<decltype(make_current)>(library, "OSMesaMakeCurrent")),
        destroy(symbol<decltype(destroy)>(library, "OSMesaDestroyContext")),
        address(symbol<decltype(address)>(library, "OSMesaGetProcAddress")) {}
};

class OsmesaContext final : public GlContext {
 public:
  explicit OsmesaContext(LibraryNames libraries)
      : osmesa_(open_library(libraries, kOsmesaPackage)) {
    const std::array<int, 12> attributes{kOsmesaFormat,
                                         GL_RGBA,
                                         kOsmesaDepthBits,
                                         0,
                                         kOsmesaProfile,
                                         kOsmesaCoreProfile,
                                         kOsmesaMajorVersion,
                                         3,
                                         kOsmesaMinorVersion,
                                         3,
                                         0,
                                         0};
    context_ = Handle(osmesa_.create(attributes.data(), nullptr), osmesa_.destroy);
    if (context_ == nullptr) throw BackendError("OSMesa: no OpenGL 3.3 core context");
    const CurrentContext current(*this);
    load("OSMesa", [&](const char* name) { return osmesa_.address(name); });
  }

  void make_current() override {
    // We draw to framebuffer objects, but OSMesa insists on a buffer of its own.
    if (osmesa_.make_current(context_.get(), buffer_.data(), GL_UNSIGNED_BYTE, kSide, kSide) == 0) {
      throw BackendError("OSMesa: the context cannot be made current");
    }
  }
  void release() override { osmesa_.make_current(nullptr, nullptr, 0, 0, 0); }

 private:
  static constexpr int kSide = 16;
  using Handle = std::unique_ptr<void, void (*)(void*)>;
  OsmesaFunctions osmesa_;
  std::array<unsigned char, kSide * kSide * 4> buffer_{};
  Handle context_{nullptr, nullptr};
};

// ---- EGL without a surface: the few declarations we need of EGL/egl.h -------------------------

constexpr const char* kEglPackage = "libegl1 and libegl-mesa0";
constexpr unsigned kEglPlatformSurfaceless = 0x31DD;
constexpr unsigned kEglOpenGlApi = 0x30A2;
constexpr int kEglNone = 0x3038;
constexpr int kEglSurfaceType = 0x3033;
constexpr int kEglRenderableType = 0x3040;
constexpr int kEglOpenGlBit = 0x0008;
constexpr int kEglContextMajorVersion = 0x3098;
constexpr int kEglContextMinorVersion = 0x30FB;
constexpr int kEglContextProfileMask = 0x30FD;
constexpr int kEglContextCoreProfileBit = 0x0001;

struct EglFunctions {
  void* (*address)(const char* name) = nullptr;
  unsigned (*initialize)(void* display, int* major, int* minor) = nullptr;
  unsigned (*bind_api)(unsigned api) = nullptr;
  unsigned (*choose_config)(void* display, const int* attributes, void** configs, int size,
                            int* count) = nullptr;
  void* (*create_context)(void* display, void* config, void* share,
                          const int* attributes) = nullptr;
  unsigned (*make_current)(void* display, void* draw, void* read, void* context) = nullptr;
  unsigned (*destroy_context)(void* display, void* context) = nullptr;
  void* (*get_platform_display)(unsigned platform, void* native, const int* attributes) = nullptr;

  explicit EglFunctions(void* library)
      : address(symbol<decltype(address)>(library, "eglGetProcAddress")),
        initialize(symbol<decltype(initialize)>(library, "eglInitialize")),
        bind_api(symbol<decltype(bind_api)>(library, "eglBindAPI")),
        choose_config(symbol<decltype(choose_config)>(library, "eglChooseConfig")),
        create_context(symbol<decltype(create_context)>(library, "eglCreateContext")),
        make_current(symbol<decltype(make_current)>(library, "eglMakeCurrent")),
        destroy_context(symbol<decltype(destroy_context)>(library, "eglDestroyContext")),
        get_platform_display(
            reinterpret_cast<decltype(get_platform_display)>(address("eglGetPlatformDisplayEXT"))) {
    if (get_platform_display == nullptr) {
      throw BackendError("EGL: eglGetPlatformDisplayEXT is missing");
    }
  }
};

class EglContext final : public GlContext {
 public:
  explicit EglContext(LibraryNames libraries) : egl_(open_library(libraries, kEglPackage)) {
    // One display for the whole process; it is never terminated, as that would take the contexts
    // of other renderers with it.
    display_ = egl_.get_platform_display(kEglPlatformSurfaceless, nullptr, nullptr);
    int major = 0;
    int minor = 0;
    if (display_ == nullptr || egl_.initialize(display_, &major, &minor) == 0) {
      throw BackendError(
          "EGL: no surfaceless Mesa display; install libegl-mesa0 and libgl1-mesa-dri");
    }
    if (egl_.bind_api(kEglOpenGlApi) == 0) throw BackendError("EGL: no desktop OpenGL");
    create();
    try {
      const CurrentContext current(*this);
      load("EGL", [&](const char* name) { return egl_.address(name); });
    } catch (...) {
      egl_.destroy_context(display_, context_);
      throw;
    }
  }
  ~EglContext() override { egl_.destroy_context(display_, context_); }
  EglContext(const EglContext&) = delete;
  EglContext& operator=(const EglContext&) = delete;

  void make_current() override {
    if (egl_.bind_api(kEglOpenGlApi) == 0 ||
        egl_.make_current(display_, nullptr, nullptr, context_) == 0) {
      throw BackendError("EGL: the context cannot be made current");
    }
  }
  void release() override { egl_.make_current(display_, nullptr, nullptr, nullptr); }

 private:
  void create() {
    const std::array<int, 5> wanted{kEglSurfaceType, 0, kEglRenderableType, kEglOpenGlBit,
                                    kEglNone};
    void* config = nullptr;
    int count = 0;
    if (egl_.choose_config(display_, wanted.data(), &config, 1, &count) == 0 || count == 0) {
      throw BackendError("EGL: no configuration for desktop OpenGL");
    }
    const std::array<int, 7> attributes{
        kEglContextMajorVersion,   3,       kEglContextMinorVersion, 3, kEglContextProfileMask,
        kEglContextCoreProfileBit, kEglNone};
    context_ = egl_.create_context(display_, config, nullptr, attributes.data());
    if (context_ == nullptr) throw BackendError("EGL: no OpenGL 3.3 core context");
  }

  EglFunctions egl_;
  void* display_ = nullptr;
  void* context_ = nullptr;
};

std::string text(const GLubyte* bytes) {
  return bytes != nullptr ? reinterpret_cast<const char*>(bytes) : "unknown";
}

}  // namespace

void GlContext::load(const char* provider, const GlLoader& loader) {
  gl_.load(loader);
  GLint major = 0;
  GLint minor = 0;
  gl_.GetIntegerv(GL_MAJOR_VERSION, &major);
  gl_.GetIntegerv(GL_MINOR_VERSION, &minor);
  if (major * 10 + minor < 33) {
    throw BackendError(std::string(provider) + ": OpenGL " + std::to_string(major) + "." +
                       std::to_string(minor) + "; 3.3 is needed");
  }
  gl_.check("starting");
  description_ = std::string(provider) + " " + text(gl_.GetString(GL_VERSION)) + ", " +
                 text(gl_.GetString(GL_RENDERER));
}

LibraryNames osmesa_libraries() {
  static constexpr std::array<const char*, 3> kNames{"libOSMesa.so.8", "libOSMesa.so.6",
                                                     "libOSMesa.so"};
  return kNames;
}

LibraryNames egl_libraries() {
  static constexpr std::array<const char*, 1> kNames{"libEGL.so.1"};
  return kNames;
}

std::unique_ptr<GlContext> create_osmesa_context(LibraryNames libraries) {
  return std::make_unique<OsmesaContext>(libraries);
}

std::unique_ptr<GlContext> create_egl_context(LibraryNames libraries) {
  return std::make_unique<EglContext>(libraries);
}

std::unique_ptr<GlContext> create_context(Provider provider, LibraryNames osmesa,
                                          LibraryNames egl) {
  std::string reasons;
  if (provider != Provider::Egl) {
    try {
      return create_osmesa_context(osmesa);
    } catch (const BackendError& error) {
      reasons += std::string("; osmesa: ") + error.what();
    }
  }
  if (provider != Provider::Osmesa) {
    try {
      return create_egl_context(egl);
    } catch (const BackendError& error) {
      reasons += std::string("; egl: ") + error.what();
    }
  }
  throw BackendError("no OpenGL to draw with: install libosmesa6, or libegl1 and libegl-mesa0" +
                     reasons);
}

std::vector<ProviderReport> probe_providers() {
  std::vector<ProviderReport> reports;
  for (Provider provider : {Provider::Osmesa, Provider::Egl}) {
    try {
      reports.push_back({provider, true, create_context(provider)->description()});
    } catch (const BackendError& error) {
      reports.push_back({provider, false, error.what()});
    }
  }
  return reports;
}

}  // namespace piecework::render
