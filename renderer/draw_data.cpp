#include <renderer/draw_data.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include <renderer/color.hpp>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>

namespace piecework::render {
namespace {

constexpr float kLongestEdge = 0.02F;   // display units: light stored at vertices is fine enough
constexpr float kGroundGap = 0.004F;    // display units: below the lowest vertex
constexpr double kKeyAzimuth = 48.0;    // degrees to the left of the viewer
constexpr double kKeyElevation = 50.0;  // degrees
constexpr double kFillAzimuth = -65.0;  // to the right
constexpr double kFillElevation = 18.0;

void require(bool condition, const std::string& text) {
  if (!condition) throw InputError(text);
}

std::string sizes(const char* what, std::size_t found, const char* per, std::size_t needed) {
  return std::string("frame: ") + what + ": " + std::to_string(found) + " values for " +
         std::to_string(needed) + " " + per;
}

void check_domains(const Frame& frame) {
  const std::size_t count = frame.triangles.size();
  require(frame.triangle_domain.size() == count,
          sizes("triangle_domain", frame.triangle_domain.size(), "triangles", count));
  for (std::size_t t = 0; t < count; ++t) {
    const int domain = frame.triangle_domain[t];
    require(domain >= 0 && static_cast<std::size_t>(domain) < frame.domain_colors.size(),
            "frame: triangle " + std::to_string(t) + ": domain " + std::to_string(domain) +
                " has no colour; domain_colors has " + std::to_string(frame.domain_colors.size()));
  }
}

void check_values(const Frame& frame, const Style& style) {
  const std::size_t count = frame.triangles.size();
  require(frame.triangle_value.size() == count,
          sizes("triangle_value", frame.triangle_value.size(), "triangles", count));
  for (std::size_t t = 0; t < count; ++t) {
    require(!std::isnan(frame.triangle_value[t]),
            "frame: triangle " + std::to_string(t) + ": value is not a number");
  }
  require(std::isfinite(style.value_low) && std::isfinite(style.value_high) &&
              style.value_low < style.value_high,
          "style: value_low must be below value_high, both finite");
}

bool uses_domains(ColorMode mode) { return mode == ColorMode::Domain || mode == ColorMode::Dof; }

void check(const Frame& frame, const Style& style) {
  require(style.supersampling >= 1 && style.supersampling <= 3,
          "style: supersampling: must be 1, 2 or 3");
  require(!style.ground_height || std::isfinite(*style.ground_height),
          "style: ground_height: must be finite");
  require(style.back >= 0 && style.back <= 1, "style: back: must be within 0 ... 1");
  if (frame.triangles.empty()) return;
  const auto num_vertices =
      static_cast<std::size_t>(frame.positions != nullptr ? frame.positions->rows() : 0);
  if (uses_domains(style.color)) check_domains(frame);
  if (style.color == ColorMode::Strain) check_values(frame, style);
  if (style.color == ColorMode::Dof) {
    require(frame.vertex_class.size() == num_vertices,
            sizes("vertex_class", frame.vertex_class.size(), "vertices", num_vertices));
  }
}

DisplayView display_view(const Camera& camera, const DisplayMesh& mesh, int height) {
  DisplayView view;
  view.basis = view_basis(camera);
  view.eye = mesh.to_display(camera.eye);
  require(view.eye.norm() < 1e6, "camera: the eye is too far from the mesh to draw it");
  const double depth = -view.eye.dot(view.basis.forward);  // of the mesh's centre
  view.near_depth = std::max({depth - 4.0, 0.02 * depth, 0.01});
  float farthest = 0;  // bodies may be large
  for (const Vec3f& p : mesh.positions) farthest = std::max(farthest, p.norm());
  view.far_depth = std::max(depth, 0.0) + std::max(12.0, static_cast<double>(farthest));
  view.pixel = 2.0 * view.basis.slope / height;
  return view;
}

/// A direction given relative to the viewer's azimuth, so that every view is lit well.
Vec3f light_direction(const DisplayView& view, double azimuth_degrees, double elevation_degrees) {
  constexpr double kRadians = std::numbers::pi / 180.0;
  Vec3 back = -view.basis.forward;
  if (std::hypot(back.x(), back.z()) < 1e-3) back = -view.basis.up;
  const double azimuth = std::atan2(back.x(), back.z()) - azimuth_degrees * kRadians;
  const double elevation = elevation_degrees * kRadians;
  return Vec3(std::cos(elevation) * std::sin(azimuth), std::sin(elevation),
              std::cos(elevation) * std::cos(azimuth))
      .cast<float>();
}

std::uint8_t sqrt_code(float encoded) {
  return static_cast<std::uint8_t>(
      std::lround(255.0F * std::sqrt(linear_from_srgb(std::clamp(encoded, 0.0F, 1.0F)))));
}

std::array<std::uint8_t, 4> color_code(const Rgb& color) {
  return {sqrt_code(color.r), sqrt_code(color.g), sqrt_code(color.b), 255};
}

/// Codes of all colours a frame can use, and which of them a triangle has.
class Colorist {
 public:
  Colorist(const Frame& frame, const Style& style) : frame_(frame), style_(style) {
    if (uses_domains(style.color)) {
      for (const Rgb& color : frame.domain_colors) {
        codes_.push_back(color_code(style.color == ColorMode::Dof ? muted(color) : color));
      }
    } else if (style.color == ColorMode::Strain) {
      for (int i = 0; i < kSteps; ++i) {
        codes_.push_back(color_code(strain_color(static_cast<float>(i) / (kSteps - 1))));
      }
    } else {
      codes_.push_back(color_code(style.fabric));
    }
  }

  std::array<std::uint8_t, 4> operator()(int triangle) const {
    if (uses_domains(style_.color)) return codes_[frame_.triangle_domain[triangle]];
    if (style_.color == ColorMode::Shaded) return codes_.front();
    const float range = style_.value_high - style_.value_low;
    const float t = (frame_.triangle_value[triangle] - style_.value_low) / range;
    return codes_[std::lround(std::clamp(t, 0.0F, 1.0F) * (kSteps - 1))];
  }

 private:
  static constexpr int kSteps = 256;
  const Frame& frame_;
  const Style& style_;
  std::vector<std::array<std::uint8_t, 4>> codes_;
};

void set_vertices(const std::vector<VertexLight>& light, DrawData& data) {
  const auto code = [](float x) { return static_cast<std::int16_t>(std::lround(32767.0F * x)); };
  data.vertices.resize(data.mesh.positions.size());
  parallel_for(data.vertices.size(), [&](std::size_t v) {
    const Vec3f& p = data.mesh.positions[v];
    const Vec3f& n = data.mesh.normals[v];
    data.vertices[v] = {{p.x(), p.y(), p.z()},
                        {code(n.x()), code(n.y()), code(n.z()), 0},
                        light[v].ambient,
                        {light[v].key, 0, 0, 0}};
  });
}

/// The cloth's triangles in drawing order: those that carry border lines need a costlier shader and
/// come last.
std::vector<int> drawing_order(const DisplayMesh& mesh, const std::vector<int>& last) {
  std::vector<int> order;
  order.reserve(mesh.cloth().size());
  std::size_t next = 0;
  for (std::size_t t = 0; t < mesh.cloth().size(); ++t) {
    if (next < last.size() && last[next] == static_cast<int>(t)) {
      ++next;
    } else {
      order.push_back(static_cast<int>(t));
    }
  }
  order.insert(order.end(), last.begin(), last.end());
  return order;
}

/// Corners of a triangle of the frame, for mesh lines; w of the first is the square root of twice
/// its area, which is about the length of its edges.
void set_corners(const DisplayMesh& mesh, const Triangle& triangle, std::array<float, 4>* out) {
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3f& p = mesh.positions[triangle[k]];
    out[k] = {p.x(), p.y(), p.z(), 0};
  }
  const Vec3f& p = mesh.positions[triangle[0]];
  const Vec3f area = (mesh.positions[triangle[1]] - p).cross(mesh.positions[triangle[2]] - p);
  out[0][3] = std::sqrt(area.norm());
}

void set_triangles(const Frame& frame, const Style& style, DrawData& data) {
  const std::vector<int> order = drawing_order(data.mesh, data.borders.triangles);
  const Colorist colorist(frame, style);
  data.num_border_triangles = data.borders.triangles.size();
  data.num_plain_triangles = order.size() - data.num_border_triangles;
  data.num_body_triangles = data.mesh.triangles.size() - order.size();
  data.indices.resize(3 * data.mesh.triangles.size());
  data.colors.resize(order.size());
  data.corners.resize(style.mesh_lines ? 3 * order.size() : 0);
  parallel_for(order.size(), [&](std::size_t i) {
    const int t = order[i];
    data.colors[i] = colorist(data.mesh.source[t]);
    for (std::size_t k = 0; k < 3; ++k) {
      data.indices[3 * i + k] = static_cast<std::uint32_t>(data.mesh.triangles[t][k]);
    }
    if (style.mesh_lines) {
      set_corners(data.mesh, frame.triangles[data.mesh.source[t]], &data.corners[3 * i]);
    }
  });
  for (std::size_t t = order.size(); t < data.mesh.triangles.size(); ++t)
    std::copy(data.mesh.triangles[t].begin(), data.mesh.triangles[t].end(), &data.indices[3 * t]);
}

float sqrt_linear(float encoded) { return std::sqrt(linear_from_srgb(encoded)); }

GpuDot make_dot(const Vec3f& p, float radius, const Rgb& color) {
  return {{p.x(), p.y(), p.z(), radius},
          {sqrt_linear(color.r), sqrt_linear(color.g), sqrt_linear(color.b), 1.0F}};
}

/// Dots as large as the mesh allows, but visible and not clumsy in the picture.
void set_dots(const Frame& frame, int height, DrawData& data) {
  double sum = 0;
  for (const Triangle& v : frame.triangles) {
    sum += static_cast<double>((data.mesh.positions[v[0]] - data.mesh.positions[v[1]]).norm());
  }
  const double edge = sum / static_cast<double>(frame.triangles.size());
  const double depth = std::max(data.view.eye.norm(), 0.5);
  const double pixel = data.view.pixel * depth * height / 1080.0;  // of a 1080-row picture
  const auto radius = static_cast<float>(std::clamp(0.36 * edge, 2.2 * pixel, 6.0 * pixel));
  for (DofClass kind : {DofClass::Duplicate, DofClass::Corner}) {
    const float size = kind == DofClass::Corner ? 1.75F * radius : radius;
    for (std::size_t v = 0; v < frame.vertex_class.size(); ++v) {
      if (frame.vertex_class[v] != kind) continue;
      data.dots.push_back(make_dot(data.mesh.positions[v], size, dot_color(kind)));
    }
    if (kind == DofClass::Duplicate) data.num_duplicates = data.dots.size();
  }
  data.num_corners = data.dots.size() - data.num_duplicates;
}

}  // namespace

Rgb dot_color(DofClass kind) {
  return kind == DofClass::Corner ? Rgb{0.72F, 0.09F, 0.16F} : Rgb{0.97F, 0.56F, 0.12F};
}

DrawData prepare(const Frame& frame, const Camera& camera, const Style& style, int width,
                 int height) {
  check(frame, style);
  DrawData data;
  const bool light_varies = style.shadows || style.ambient_occlusion;
  data.mesh = build_display_mesh(frame, light_varies ? kLongestEdge : 0.0F);
  data.view = display_view(camera, data.mesh, height);
  data.key_direction = light_direction(data.view, kKeyAzimuth, kKeyElevation);
  data.fill_direction = light_direction(data.view, kFillAzimuth, kFillElevation);
  if (data.mesh.empty()) return data;

  LightOptions options;
  options.key_direction = data.key_direction;
  options.shadows = style.shadows;
  options.ambient_occlusion = style.ambient_occlusion;
  data.ground_height = data.mesh.low.y() - kGroundGap;
  if (style.ground_height) {
    const double y = (*style.ground_height - data.mesh.centre.y()) * data.mesh.scale;
    data.ground_height = static_cast<float>(std::clamp(y, -1e6, 1e6));
  }
  const bool above = data.view.eye.y() > static_cast<double>(data.ground_height);
  if (style.ground && above && light_varies) options.ground_height = data.ground_height;
  Lighting light = compute_lighting(data.mesh, options);
  data.ground = std::move(light.ground);
  set_vertices(light.vertices, data);

  const float scale = static_cast<float>(std::min(width, height)) / 1080.0F;
  data.border_pixels = 0.38F + 0.75F * scale;
  data.line_pixels = 0.25F + 0.20F * scale;
  if (style.borders && uses_domains(style.color)) {
    const double reach =
        data.view.pixel * (data.view.eye.norm() + 1.0) *
        (static_cast<double>(data.border_pixels) + 2.0);  // wider where seen edge-on
    data.borders = find_borders(data.mesh, frame.triangle_domain, static_cast<float>(reach));
  }
  set_triangles(frame, style, data);
  if (style.color == ColorMode::Dof && !frame.triangles.empty()) set_dots(frame, height, data);
  return data;
}

}  // namespace piecework::render
