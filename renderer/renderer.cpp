#include <renderer/renderer.hpp>

#include <algorithm>
#include <array>
#include <map>
#include <string>
#include <utility>

#include <renderer/color.hpp>
#include <renderer/draw_data.hpp>
#include <renderer/gl_context.hpp>
#include <renderer/gl_program.hpp>
#include <renderer/overlay.hpp>
#include <renderer/resolve.hpp>
#include <renderer/shaders.hpp>

#include <piecework/core/error.hpp>

namespace piecework::render {
namespace {

constexpr int kMinSide = 16;
constexpr int kMaxSide = 8192;
constexpr int kMaxTileSamples = 4096;  // per axis: bounds memory; every GL 3.3 can do 1024
constexpr float kGroundRadius = 9.0F;  // display units; shadows have faded out by then

/// Clip matrix of one tile, column-major floats.
Eigen::Matrix4f clip_matrix(const DisplayView& view, int width, int height, const Tile& tile) {
  Eigen::Matrix4d look = Eigen::Matrix4d::Identity();
  look.block<1, 3>(0, 0) = view.basis.right.transpose();
  look.block<1, 3>(1, 0) = view.basis.up.transpose();
  look.block<1, 3>(2, 0) = -view.basis.forward.transpose();
  look.block<3, 1>(0, 3) = -look.block<3, 3>(0, 0) * view.eye;
  const double near = view.near_depth;
  const double far = view.far_depth;
  const double focal = 1.0 / view.basis.slope;
  Eigen::Matrix4d project = Eigen::Matrix4d::Zero();
  project(0, 0) = focal * height / width;
  project(1, 1) = focal;
  project(2, 2) = -(far + near) / (far - near);
  project(2, 3) = -2.0 * far * near / (far - near);
  project(3, 2) = -1.0;
  Eigen::Matrix4d cut = Eigen::Matrix4d::Identity();  // picks the tile out of the picture
  cut(0, 0) = static_cast<double>(width) / tile.width;
  cut(1, 1) = static_cast<double>(height) / tile.height;
  cut(0, 3) = cut(0, 0) * (1.0 - (2.0 * tile.x + tile.width) / width);
  cut(1, 3) = cut(1, 1) * ((2.0 * tile.y + tile.height) / height - 1.0);
  return (cut * project * look).cast<float>();
}

std::vector<Tile> cut_into_tiles(int width, int height, int side) {
  std::vector<Tile> tiles;
  for (int y = 0; y < height; y += side) {
    for (int x = 0; x < width; x += side) {
      tiles.push_back({x, y, std::min(side, width - x), std::min(side, height - y)});
    }
  }
  return tiles;
}

const void* offset_of(std::size_t bytes) {
  return reinterpret_cast<const void*>(bytes);  // NOLINT: how GL wants offsets into buffers
}

enum TextureUnit : int { kColorsUnit, kRangesUnit, kSegmentsUnit, kCornersUnit, kGroundUnit };

/// What the shader of cloth is made for.
enum class Surface { Plain, Borders, Body };

Eigen::Vector3f linear(const Rgb& color) {
  return {linear_from_srgb(color.r), linear_from_srgb(color.g), linear_from_srgb(color.b)};
}

/// A buffer that shaders read through a buffer texture.
struct BufferTexture {
  GLuint buffer = 0, texture = 0;
};

}  // namespace

struct Renderer::Impl {
  Impl(Provider provider, int picture_width, int picture_height)
      : context(create_context(provider)), width(picture_width), height(picture_height) {
    const CurrentContext current(*context);
    create_objects();
  }

  Image draw(const Frame& frame, const Camera& camera, const Style& style);

  void create_objects();
  void create_cloth_array();
  void create_dot_array();
  BufferTexture create_buffer_texture();
  const GlProgram& surface_program(Surface surface, bool mesh_lines);
  const GlProgram& program(const char* name, const char* vertex, const char* fragment,
                           const std::string& defines = {});

  template <class T>
  void upload(GLenum target, GLuint buffer, const std::vector<T>& data) const;
  template <class T>
  void upload(const BufferTexture& target, TextureUnit unit, GLenum format,
              const std::vector<T>& data) const;
  void upload_frame(const DrawData& data);
  void upload_ground(const GroundLight& ground) const;

  void resize_framebuffer(int samples_x, int samples_y);
  void draw_tile(const DrawData& data, const Style& style, const Tile& tile);
  void draw_surfaces(const DrawData& data, const Style& style, const Eigen::Matrix4f& clip);
  void draw_ground(const DrawData& data, const Eigen::Matrix4f& clip, const Tile& tile,
                   int samples);
  void draw_background(const Tile& tile, int samples);
  void draw_dots(const DrawData& data, const Eigen::Matrix4f& clip);
  void set_backdrop(const GlProgram& program, const Tile& tile, int samples) const;

  std::unique_ptr<GlContext> context;
  int width, height;
  std::map<std::string, GlProgram> programs;
  GLuint cloth_array = 0, dot_array = 0, empty_array = 0;
  GLuint vertex_buffer = 0, index_buffer = 0, dot_buffer = 0, ground_texture = 0;
  BufferTexture colors, ranges, segments, corners;
  GLuint framebuffer = 0, color_target = 0, depth_target = 0;
  int target_width = 0, target_height = 0;
  GLint max_target = 0, max_texels = 0;
  std::vector<std::uint8_t> samples_read;
};

void Renderer::Impl::create_objects() {
  const GlFunctions& gl = context->gl();
  gl.GetIntegerv(GL_MAX_RENDERBUFFER_SIZE, &max_target);
  gl.GetIntegerv(GL_MAX_TEXTURE_BUFFER_SIZE, &max_texels);
  gl.GenVertexArrays(1, &empty_array);
  create_cloth_array();
  create_dot_array();
  for (BufferTexture* target : {&colors, &ranges, &segments, &corners}) {
    *target = create_buffer_texture();
  }
  gl.GenTextures(1, &ground_texture);
  gl.BindTexture(GL_TEXTURE_2D, ground_texture);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  gl.PixelStorei(GL_PACK_ALIGNMENT, 1);
  gl.PixelStorei(GL_UNPACK_ALIGNMENT, 1);
  gl.check("creating objects");
}

void Renderer::Impl::create_cloth_array() {
  const GlFunctions& gl = context->gl();
  gl.GenVertexArrays(1, &cloth_array);
  gl.GenBuffers(1, &vertex_buffer);
  gl.GenBuffers(1, &index_buffer);
  gl.BindVertexArray(cloth_array);
  gl.BindBuffer(GL_ARRAY_BUFFER, vertex_buffer);
  gl.BindBuffer(GL_ELEMENT_ARRAY_BUFFER, index_buffer);
  constexpr GLsizei kStride = sizeof(GpuVertex);
  gl.VertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, kStride,
                         offset_of(offsetof(GpuVertex, position)));
  gl.VertexAttribPointer(1, 3, GL_SHORT, GL_TRUE, kStride, offset_of(offsetof(GpuVertex, normal)));
  gl.VertexAttribPointer(2, 4, GL_UNSIGNED_BYTE, GL_TRUE, kStride,
                         offset_of(offsetof(GpuVertex, ambient)));
  gl.VertexAttribPointer(3, 1, GL_UNSIGNED_BYTE, GL_TRUE, kStride,
                         offset_of(offsetof(GpuVertex, key)));
  for (GLuint i = 0; i < 4; ++i) gl.EnableVertexAttribArray(i);
}

void Renderer::Impl::create_dot_array() {
  const GlFunctions& gl = context->gl();
  gl.GenVertexArrays(1, &dot_array);
  gl.GenBuffers(1, &dot_buffer);
  gl.BindVertexArray(dot_array);
  gl.BindBuffer(GL_ARRAY_BUFFER, dot_buffer);
  constexpr GLsizei kStride = sizeof(GpuDot);
  gl.VertexAttribPointer(0, 4, GL_FLOAT, GL_FALSE, kStride, offset_of(offsetof(GpuDot, ball)));
  gl.VertexAttribPointer(1, 4, GL_FLOAT, GL_FALSE, kStride, offset_of(offsetof(GpuDot, color)));
  for (GLuint i = 0; i < 2; ++i) {
    gl.EnableVertexAttribArray(i);
    gl.VertexAttribDivisor(i, 1);
  }
  gl.BindVertexArray(empty_array);
}

BufferTexture Renderer::Impl::create_buffer_texture() {
  BufferTexture result;
  context->gl().GenBuffers(1, &result.buffer);
  context->gl().GenTextures(1, &result.texture);
  return result;
}

const GlProgram& Renderer::Impl::program(const char* name, const char* vertex, const char* fragment,
                                         const std::string& defines) {
  const auto found = programs.find(name);
  if (found != programs.end()) return found->second;
  return programs.emplace(name, GlProgram(context->gl(), vertex, fragment, defines)).first->second;
}

const GlProgram& Renderer::Impl::surface_program(Surface surface, bool mesh_lines) {
  std::string name = "surface";
  std::string defines;
  if (surface == Surface::Borders) {
    name += " borders";
    defines += "#define BORDERS\n";
  }
  if (surface == Surface::Body) {
    name += " body";
    defines += "#define BODY\n";
  } else if (mesh_lines) {
    name += " mesh lines";
    defines += "#define MESH_LINES\n";
  }
  return program(name.c_str(), shaders::kClothVertex, shaders::kClothFragment, defines);
}

template <class T>
void Renderer::Impl::upload(GLenum target, GLuint buffer, const std::vector<T>& data) const {
  context->gl().BindBuffer(target, buffer);
  context->gl().BufferData(target, static_cast<GLsizeiptr>(data.size() * sizeof(T)), data.data(),
                           GL_STREAM_DRAW);
}

template <class T>
void Renderer::Impl::upload(const BufferTexture& target, TextureUnit unit, GLenum format,
                            const std::vector<T>& data) const {
  if (data.empty()) return;
  if (data.size() * sizeof(T) / 4 > static_cast<std::size_t>(max_texels)) {  // texels of >= 4 bytes
    throw BackendError("OpenGL: the mesh is larger than this driver's buffer textures");
  }
  upload(GL_TEXTURE_BUFFER, target.buffer, data);
  context->gl().ActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
  context->gl().BindTexture(GL_TEXTURE_BUFFER, target.texture);
  context->gl().TexBuffer(GL_TEXTURE_BUFFER, format, target.buffer);
}

void Renderer::Impl::upload_frame(const DrawData& data) {
  context->gl().BindVertexArray(cloth_array);
  upload(GL_ARRAY_BUFFER, vertex_buffer, data.vertices);
  upload(GL_ELEMENT_ARRAY_BUFFER, index_buffer, data.indices);
  upload(GL_ARRAY_BUFFER, dot_buffer, data.dots);
  upload(colors, kColorsUnit, GL_RGBA8, data.colors);
  upload(ranges, kRangesUnit, GL_RG32I, data.borders.ranges);
  upload(segments, kSegmentsUnit, GL_RGBA32F, data.borders.segments);
  upload(corners, kCornersUnit, GL_RGBA32F, data.corners);
  upload_ground(data.ground);
  context->gl().check("uploading the mesh");
}

void Renderer::Impl::upload_ground(const GroundLight& ground) const {
  const GlFunctions& gl = context->gl();
  gl.ActiveTexture(GL_TEXTURE0 + kGroundUnit);
  gl.BindTexture(GL_TEXTURE_2D, ground_texture);
  if (ground.texels.empty()) return;
  gl.TexImage2D(GL_TEXTURE_2D, 0, GL_RG8, GroundLight::kSize, GroundLight::kSize, 0, GL_RG,
                GL_UNSIGNED_BYTE, ground.texels.data());
}

void Renderer::Impl::resize_framebuffer(int samples_x, int samples_y) {
  if (samples_x == target_width && samples_y == target_height) return;
  const GlFunctions& gl = context->gl();
  target_width = target_height = 0;
  gl.DeleteFramebuffers(1, &framebuffer);
  gl.DeleteRenderbuffers(1, &color_target);
  gl.DeleteRenderbuffers(1, &depth_target);
  gl.GenFramebuffers(1, &framebuffer);
  gl.GenRenderbuffers(1, &color_target);
  gl.GenRenderbuffers(1, &depth_target);
  gl.BindFramebuffer(GL_FRAMEBUFFER, framebuffer);
  gl.BindRenderbuffer(GL_RENDERBUFFER, color_target);
  gl.RenderbufferStorage(GL_RENDERBUFFER, GL_RGBA8, samples_x, samples_y);
  gl.BindRenderbuffer(GL_RENDERBUFFER, depth_target);
  gl.RenderbufferStorage(GL_RENDERBUFFER, GL_DEPTH_COMPONENT24, samples_x, samples_y);
  gl.FramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, color_target);
  gl.FramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth_target);
  gl.check("creating the framebuffer");
  if (gl.CheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
    throw BackendError("OpenGL: a framebuffer of " + std::to_string(samples_x) + " x " +
                       std::to_string(samples_y) + " samples is not supported");
  }
  target_width = samples_x;
  target_height = samples_y;
}

void Renderer::Impl::set_backdrop(const GlProgram& used, const Tile& tile, int samples) const {
  const int below = height - tile.y - tile.height;
  used.set("u_bottom", static_cast<float>(below * samples));
  used.set("u_rows", static_cast<float>(height * samples));
}

void Renderer::Impl::draw_surfaces(const DrawData& data, const Style& style,
                                   const Eigen::Matrix4f& clip) {
  const GlFunctions& gl = context->gl();
  gl.BindVertexArray(cloth_array);
  struct Part {
    Surface surface;
    std::size_t first, count;
  };
  const std::size_t num_cloth = data.num_plain_triangles + data.num_border_triangles;
  for (const Part& part :
       {Part{Surface::Plain, 0, data.num_plain_triangles},
        Part{Surface::Borders, data.num_plain_triangles, data.num_border_triangles},
        Part{Surface::Body, num_cloth, data.num_body_triangles}}) {
    if (part.count == 0) continue;
    const GlProgram& used = surface_program(part.surface, style.mesh_lines);
    used.use();
    used.set("u_clip", clip);
    used.set("u_eye", Eigen::Vector3f(data.view.eye.cast<float>()));
    used.set("u_key_direction", data.key_direction);
    used.set("u_fill_direction", data.fill_direction);
    used.set("u_colors", static_cast<int>(kColorsUnit));
    used.set("u_first_triangle", static_cast<int>(part.first));
    used.set("u_pixel", static_cast<float>(data.view.pixel));
    used.set("u_samples", static_cast<float>(style.supersampling));
    used.set("u_ranges", static_cast<int>(kRangesUnit));
    used.set("u_segments", static_cast<int>(kSegmentsUnit));
    used.set("u_corners", static_cast<int>(kCornersUnit));
    used.set("u_border_pixels", data.border_pixels);
    used.set("u_line_pixels", data.line_pixels);
    used.set("u_back", style.back);
    used.set("u_body", linear(style.body));
    gl.DrawElements(GL_TRIANGLES, static_cast<GLsizei>(3 * part.count), GL_UNSIGNED_INT,
                    offset_of(3 * part.first * sizeof(std::uint32_t)));
  }
}

void Renderer::Impl::draw_ground(const DrawData& data, const Eigen::Matrix4f& clip,
                                 const Tile& tile, int samples) {
  const GlProgram& used = program("ground", shaders::kGroundVertex, shaders::kGroundFragment);
  used.use();
  set_backdrop(used, tile, samples);
  const Eigen::Vector2f size = data.ground.high - data.ground.low;
  used.set("u_clip", clip);
  used.set("u_ground_height", data.ground_height);
  used.set("u_radius", kGroundRadius);
  used.set("u_light", static_cast<int>(kGroundUnit));
  used.set("u_rectangle", Eigen::Vector4f(data.ground.low.x(), data.ground.low.y(), 1.0F / size.x(),
                                          1.0F / size.y()));
  context->gl().BindVertexArray(empty_array);
  context->gl().DrawArrays(GL_TRIANGLE_STRIP, 0, 4);
}

void Renderer::Impl::draw_background(const Tile& tile, int samples) {
  const GlProgram& used =
      program("background", shaders::kBackgroundVertex, shaders::kBackgroundFragment);
  used.use();
  set_backdrop(used, tile, samples);
  context->gl().BindVertexArray(empty_array);
  context->gl().DrawArrays(GL_TRIANGLES, 0, 3);
}

void Renderer::Impl::draw_dots(const DrawData& data, const Eigen::Matrix4f& clip) {
  const GlFunctions& gl = context->gl();
  const GlProgram& used = program("dots", shaders::kDotVertex, shaders::kDotFragment);
  used.use();
  used.set("u_clip", clip);
  used.set("u_eye", Eigen::Vector3f(data.view.eye.cast<float>()));
  used.set("u_right", Eigen::Vector3f(data.view.basis.right.cast<float>()));
  used.set("u_up", Eigen::Vector3f(data.view.basis.up.cast<float>()));
  gl.Enable(GL_BLEND);
  gl.BlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
  gl.BindVertexArray(dot_array);
  gl.DrawArraysInstanced(GL_TRIANGLE_STRIP, 0, 4, static_cast<GLsizei>(data.dots.size()));
  gl.Disable(GL_BLEND);
}

void Renderer::Impl::draw_tile(const DrawData& data, const Style& style, const Tile& tile) {
  const GlFunctions& gl = context->gl();
  const int samples = style.supersampling;
  const int samples_x = tile.width * samples;
  const int samples_y = tile.height * samples;
  resize_framebuffer(samples_x, samples_y);
  gl.BindFramebuffer(GL_FRAMEBUFFER, framebuffer);
  gl.Viewport(0, 0, samples_x, samples_y);
  gl.Disable(GL_CULL_FACE);
  gl.Disable(GL_BLEND);
  gl.Enable(GL_DEPTH_TEST);
  gl.DepthMask(GL_TRUE);
  gl.DepthFunc(GL_LESS);
  gl.Clear(GL_DEPTH_BUFFER_BIT);
  const Eigen::Matrix4f clip = clip_matrix(data.view, width, height, tile);
  // Front to back: what the cloth covers is never shaded as ground or background.
  if (!data.indices.empty()) draw_surfaces(data, style, clip);
  if (!data.ground.texels.empty()) draw_ground(data, clip, tile, samples);
  gl.DepthFunc(GL_LEQUAL);
  draw_background(tile, samples);
  if (!data.dots.empty()) draw_dots(data, clip);
  samples_read.resize(4 * static_cast<std::size_t>(samples_x) * samples_y);
  gl.ReadPixels(0, 0, samples_x, samples_y, GL_RGBA, GL_UNSIGNED_BYTE, samples_read.data());
  gl.check("drawing");
}

Image Renderer::Impl::draw(const Frame& frame, const Camera& camera, const Style& style) {
  const DrawData data = prepare(frame, camera, style, width, height);
  Image image;
  image.width = width;
  image.height = height;
  image.rgb.resize(3 * static_cast<std::size_t>(width) * height);
  const CurrentContext current(*context);
  upload_frame(data);
  const int side = std::min(kMaxTileSamples, static_cast<int>(max_target)) / style.supersampling;
  for (const Tile& tile : cut_into_tiles(width, height, side)) {
    draw_tile(data, style, tile);
    resolve_tile(samples_read, tile, style.supersampling, image);
  }
  draw_overlay(data, style, image);
  return image;
}

Renderer::Renderer(Provider provider, int width, int height) {
  if (std::min(width, height) < kMinSide || std::max(width, height) > kMaxSide) {
    throw InputError("picture size " + std::to_string(width) + "x" + std::to_string(height) +
                     ": must be within 16x16 ... 8192x8192");
  }
  impl_ = std::make_unique<Impl>(provider, width, height);
}
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;

Image Renderer::draw(const Frame& frame, const Camera& camera, const Style& style) {
  return impl_->draw(frame, camera, style);
}

std::string Renderer::description() const { return impl_->context->description(); }

}  // namespace piecework::render
