#pragma once

// Orthographic depth images of the mesh, drawn on the CPU. Cheap enough (a few ms for 100 K
// triangles) to look at the mesh from many directions: light from an area or from the whole sky.

#include <vector>

#include <renderer/display_mesh.hpp>

namespace piecework::render {

/// Nearest and farthest surface along one direction, on a square grid.
class DepthMap {
 public:
  /// Draws all triangles seen along -direction (unit length) on a grid of size x size cells.
  void draw(const DisplayMesh& mesh, const Vec3f& direction, int size);

  /// Part (0 ... 1) of light from +direction that arrives at p, and from -direction.
  /// \param bias  display units along the direction within which a surface does not shade itself
  [[nodiscard]] float visible_from_front(const Vec3f& p, float bias) const;
  [[nodiscard]] float visible_from_back(const Vec3f& p, float bias) const;

  [[nodiscard]] const Vec3f& direction() const { return w_; }
  /// Side of a grid cell in display units.
  [[nodiscard]] float texel() const { return 1.0F / scale_; }

 private:
  struct Point {
    float x, y, z;  ///< grid units, and display units along the direction
  };
  [[nodiscard]] Point project(const Vec3f& p) const {
    return {(p.dot(u_) - u0_) * scale_, (p.dot(v_) - v0_) * scale_, p.dot(w_)};
  }
  void fit(const DisplayMesh& mesh, const Vec3f& direction);
  void draw_triangle(const Point& a, const Point& b, const Point& c);
  template <class Lit>
  [[nodiscard]] float bilinear(const Point& p, const Lit& lit) const;

  int size_ = 0;
  Vec3f u_{1, 0, 0}, v_{0, 0, 1}, w_{0, 1, 0};
  float u0_ = 0, v0_ = 0, scale_ = 1;
  std::vector<float> nearest_;   ///< largest depth along the direction, -infinity where empty
  std::vector<float> farthest_;  ///< smallest, +infinity where empty
  std::vector<Point> points_;
};

}  // namespace piecework::render
