#include <renderer/depth_map.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace piecework::render {

void DepthMap::fit(const DisplayMesh& mesh, const Vec3f& direction) {
  w_ = direction;
  // An axis at right angles to w, chosen from the smallest component of w.
  Eigen::Index smallest = 0;
  w_.cwiseAbs().minCoeff(&smallest);
  u_ = w_.cross(Vec3f::Unit(smallest)).normalized();
  v_ = w_.cross(u_);
  const Vec3f centre = 0.5F * (mesh.low + mesh.high);
  const Vec3f half = 0.5F * (mesh.high - mesh.low);
  const float extent_u = half.dot(u_.cwiseAbs());
  const float extent_v = half.dot(v_.cwiseAbs());
  const float extent = std::max({extent_u, extent_v, 1e-6F});
  scale_ = 0.5F * static_cast<float>(size_ - 4) / extent;  // two empty cells around
  u0_ = centre.dot(u_) - 0.5F * static_cast<float>(size_) / scale_;
  v0_ = centre.dot(v_) - 0.5F * static_cast<float>(size_) / scale_;
}

void DepthMap::draw(const DisplayMesh& mesh, const Vec3f& direction, int size) {
  size_ = size;
  fit(mesh, direction);
  const auto cells = static_cast<std::size_t>(size_) * static_cast<std::size_t>(size_);
  nearest_.assign(cells, -std::numeric_limits<float>::infinity());
  farthest_.assign(cells, std::numeric_limits<float>::infinity());
  points_.resize(mesh.positions.size());
  for (std::size_t v = 0; v < points_.size(); ++v) points_[v] = project(mesh.positions[v]);
  for (const auto& [a, b, c] : mesh.triangles) draw_triangle(points_[a], points_[b], points_[c]);
}

void DepthMap::draw_triangle(const Point& a, const Point& b, const Point& c) {
  // Cell (i, j) is sampled at its centre (i + 0.5, j + 0.5).
  const auto first = [](float x) { return static_cast<int>(std::ceil(x - 0.5F)); };
  const auto last = [](float x) { return static_cast<int>(std::floor(x - 0.5F)); };
  const int x0 = std::max(first(std::min({a.x, b.x, c.x})), 0);
  const int x1 = std::min(last(std::max({a.x, b.x, c.x})), size_ - 1);
  const int y0 = std::max(first(std::min({a.y, b.y, c.y})), 0);
  const int y1 = std::min(last(std::max({a.y, b.y, c.y})), size_ - 1);
  if (x0 > x1 || y0 > y1) return;
  const float area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
  if (std::abs(area) < 1e-12F) return;
  // Barycentric weights of b and c, and depth, are linear over the grid: start value and steps.
  const float inverse = 1.0F / area;
  const float wb_x = (c.y - a.y) * inverse;
  const float wb_y = -(c.x - a.x) * inverse;
  const float wc_x = -(b.y - a.y) * inverse;
  const float wc_y = (b.x - a.x) * inverse;
  const float z_x = wb_x * (b.z - a.z) + wc_x * (c.z - a.z);
  const float z_y = wb_y * (b.z - a.z) + wc_y * (c.z - a.z);
  const float px = static_cast<float>(x0) + 0.5F - a.x;
  constexpr float kEdge = -1e-5F;  // neighbours overlap rather than leave a gap
  for (int y = y0; y <= y1; ++y) {
    const float py = static_cast<float>(y) + 0.5F - a.y;
    float wb = px * wb_x + py * wb_y;
    float wc = px * wc_x + py * wc_y;
    float z = a.z + px * z_x + py * z_y;
    std::size_t cell = static_cast<std::size_t>(y) * size_ + static_cast<std::size_t>(x0);
    for (int x = x0; x <= x1; ++x, ++cell, wb += wb_x, wc += wc_x, z += z_x) {
      if (wb < kEdge || wc < kEdge || wb + wc > 1.0F - kEdge) continue;
      nearest_[cell] = std::max(nearest_[cell], z);
      farthest_[cell] = std::min(farthest_[cell], z);
    }
  }
}

template <class Lit>
float DepthMap::bilinear(const Point& p, const Lit& lit) const {
  const float x = p.x - 0.5F;
  const float y = p.y - 0.5F;
  const float limit = static_cast<float>(size_ - 1);
  if (!(x >= 0 && y >= 0 && x < limit && y < limit)) return 1.0F;  // nothing is drawn out there
  const int i = static_cast<int>(x);
  const int j = static_cast<int>(y);
  const float fx = x - static_cast<float>(i);
  const float fy = y - static_cast<float>(j);
  const std::size_t cell = static_cast<std::size_t>(j) * size_ + static_cast<std::size_t>(i);
  const float low = (1 - fx) * lit(cell) + fx * lit(cell + 1);
  const float high = (1 - fx) * lit(cell + size_) + fx * lit(cell + size_ + 1);
  return (1 - fy) * low + fy * high;
}

float DepthMap::visible_from_front(const Vec3f& p, float bias) const {
  const Point q = project(p);
  const float limit = q.z + bias;
  return bilinear(q, [&](std::size_t cell) { return nearest_[cell] <= limit ? 1.0F : 0.0F; });
}

float DepthMap::visible_from_back(const Vec3f& p, float bias) const {
  const Point q = project(p);
  const float limit = q.z - bias;
  return bilinear(q, [&](std::size_t cell) { return farthest_[cell] >= limit ? 1.0F : 0.0F; });
}

}  // namespace piecework::render
