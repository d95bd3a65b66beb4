#pragma once

// Offscreen pictures of triangle meshes. Knows no solver: it takes positions, triangles and
// colours in memory and gives back pixels.

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <piecework/core/types.hpp>

namespace piecework::render {

struct Rgb {
  float r = 0, g = 0, b = 0;  ///< linear order, sRGB-encoded values in [0, 1]
};

enum class ColorMode { Domain, Dof, Strain, Shaded };

/// Which kind of unknown a vertex is (drawn as dots in ColorMode::Dof).
enum class DofClass : std::uint8_t { Internal, Duplicate, Corner };

/// A solid beside the cloth, drawn in Style::body. Smooth, but sharp edges stay sharp.
struct Body {
  const Positions* positions = nullptr;  ///< |V| x 3, m
  std::span<const Triangle> triangles;   ///< counter-clockwise seen from outside
};

/// Everything to draw; spans must outlive the call to draw().
struct Frame {
  const Positions* positions = nullptr;  ///< |V| x 3, m
  std::span<const Triangle> triangles;
  std::span<const int> triangle_domain;    ///< per triangle; needed by Domain and Dof
  std::span<const Rgb> domain_colors;      ///< per domain; see domain_palette()
  std::span<const float> triangle_value;   ///< per triangle; needed by Strain
  std::span<const DofClass> vertex_class;  ///< per vertex; needed by Dof
  std::span<const Body> bodies;            ///< what the cloth touches
};

struct Camera {
  Vec3 eye{1, 1, 2};
  Vec3 target{0, 0, 0};
  Vec3 up{0, 1, 0};
  double fov_degrees = 35;  ///< vertical
};

/// The nearest camera from the given direction that sees the whole box [low, high] (m), with a
/// margin. A box without extent is framed too.
/// \param azimuth_degrees    0 looks along -z, 90 along -x
/// \param elevation_degrees  0 looks level, 90 straight down; clamped to -90 ... 90
/// \throws InputError if the box is empty or a number is not finite or out of range.
Camera frame_box(const Vec3& low, const Vec3& high, double aspect, double azimuth_degrees,
                 double elevation_degrees, double fov_degrees);

struct Style {
  ColorMode color = ColorMode::Domain;
  bool borders = true;  ///< dark lines between domains
  bool mesh_lines = false;
  bool shadows = true;  ///< soft shadows of the key light, on cloth and ground
  bool ground = true;   ///< ground plane (y = const), visible by the shadows on it
  /// m; absent: just below the mesh. Give one height for all frames of an animation.
  std::optional<double> ground_height;
  bool ambient_occlusion = true;           ///< shadows of the sky; off in the fast path
  int supersampling = 2;                   ///< 1, 2 or 3 samples per pixel and axis
  bool legend = true;                      ///< Strain: colour bar; Dof: what dots mean, with counts
  float value_low = 0, value_high = 0.1F;  ///< range of the colour bar (Strain)
  std::string value_label = "strain";
  std::string caption;              ///< small text in the lower left corner, e.g. "t = 0.25 s"
  Rgb fabric{0.45F, 0.58F, 0.74F};  ///< colour of the cloth in ColorMode::Shaded
  Rgb body{0.74F, 0.72F, 0.69F};    ///< colour of bodies
  float back = 1;  ///< factor of the cloth's colours on its back side; below 1: folds show inside
};

struct Image {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;  ///< 3 bytes per pixel, top row first
};

/// Where OpenGL comes from.
enum class Provider { Auto, Osmesa, Egl };

/// An offscreen OpenGL context and its buffers. One per thread; not thread-safe.
class Renderer {
 public:
  /// \throws BackendError (exit code 6) that names the packages to install if no provider works;
  ///         InputError if the size is not within 16x16 ... 8192x8192.
  Renderer(Provider provider, int width, int height);
  ~Renderer();
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;

  /// Draws one frame; the same arguments give the same pixels, for every number of threads. An
  /// empty mesh leaves the background. The size of the scene does not matter.
  /// \throws InputError if a position is not finite, a span has the wrong length, a triangle or
  ///         domain does not exist, or camera or style are out of range; BackendError if the GL
  ///         reports an error. The renderer stays usable.
  Image draw(const Frame& frame, const Camera& camera, const Style& style);

  /// "OSMesa 22.3.6 (llvmpipe ...)", for environment blocks.
  [[nodiscard]] std::string description() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Providers with "works" or the reason why not (for `piecework doctor`).
struct ProviderReport {
  Provider provider;
  bool works;
  std::string detail;
};
std::vector<ProviderReport> probe_providers();

/// Well-separated colours for `count` domains; adjacent ones (pairs of domain numbers) differ
/// strongly. A function of its arguments only, so domains keep their colours from frame to frame.
std::vector<Rgb> domain_palette(int count, std::span<const std::array<int, 2>> adjacent);

}  // namespace piecework::render
