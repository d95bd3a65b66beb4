#include <piecework/mesh/polygon.hpp>

#include <algorithm>
#include <cstddef>
#include <vector>

#include <Eigen/Geometry>

namespace piecework::mesh {
namespace {

/// Polygons of up to this many corners get their best ear cut first (cubic cost), others any ear.
constexpr std::size_t kBestEarCorners = 64;

/// Twice the signed area of a triangle.
double orientation(const Vec2& a, const Vec2& b, const Vec2& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

/// Corners in the polygon's mean plane (Newell's normal), counter-clockwise.
std::vector<Vec2> project(std::span<const Vec3> corners) {
  const Vec3 origin = corners.front();
  Vec3 normal = Vec3::Zero();
  for (std::size_t i = 0; i < corners.size(); ++i)
    normal += (corners[i] - origin).cross(corners[(i + 1) % corners.size()] - origin);
  const Vec3 n = normal.squaredNorm() > 0 ? normal.normalized() : Vec3::UnitZ();
  const Vec3 u = n.unitOrthogonal();
  const Vec3 v = n.cross(u);
  std::vector<Vec2> flat;
  flat.reserve(corners.size());
  for (const Vec3& p : corners) flat.emplace_back(u.dot(p - origin), v.dot(p - origin));
  return flat;
}

bool is_inside(const Vec2& p, const Vec2& a, const Vec2& b, const Vec2& c) {
  if (p == a || p == b || p == c) return false;
  return orientation(a, b, p) >= 0 && orientation(b, c, p) >= 0 && orientation(c, a, p) >= 0;
}

/// A polygon that loses one ear after the other.
class EarClipper {
 public:
  explicit EarClipper(std::vector<Vec2> points) : points_(std::move(points)) {
    for (std::size_t i = 0; i < points_.size(); ++i) rest_.push_back(static_cast<int>(i));
  }

  void run(Triangles& triangles) {
    while (rest_.size() > 4) {
      const std::size_t ear = choose_ear();
      triangles.push_back({at(ear + rest_.size() - 1), at(ear), at(ear + 1)});
      rest_.erase(rest_.begin() + static_cast<std::ptrdiff_t>(ear));
    }
    split_quad(triangles);
  }

 private:
  [[nodiscard]] int at(std::size_t i) const { return rest_[i % rest_.size()]; }
  [[nodiscard]] const Vec2& point(std::size_t i) const { return points_[at(i)]; }

  /// Roundness of the triangle at corner i of the rest, at most 0 where it is no ear.
  [[nodiscard]] double ear_quality(std::size_t i) const {
    const Vec2& a = point(i + rest_.size() - 1);
    const Vec2& b = point(i);
    const Vec2& c = point(i + 1);
    const double area = orientation(a, b, c);
    if (area <= 0) return 0;
    for (int other : rest_) {
      if (is_inside(points_[other], a, b, c)) return 0;
    }
    return area / std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  }

  /// The roundest ear; for large polygons the first; without any the most convex corner.
  [[nodiscard]] std::size_t choose_ear() const {
    std::size_t best = rest_.size();
    double best_quality = 0;
    for (std::size_t i = 0; i < rest_.size(); ++i) {
      const double quality = ear_quality(i);
      if (quality <= best_quality) continue;
      best = i;
      best_quality = quality;
      if (rest_.size() > kBestEarCorners) break;
    }
    return best < rest_.size() ? best : most_convex_corner();
  }

  [[nodiscard]] std::size_t most_convex_corner() const {
    const auto turn = [&](std::size_t i) {
      return orientation(point(i + rest_.size() - 1), point(i), point(i + 1));
    };
    std::size_t best = 0;
    for (std::size_t i = 1; i < rest_.size(); ++i) {
      if (turn(i) > turn(best)) best = i;
    }
    return best;
  }

  void split_quad(Triangles& triangles) const {
    const Vec2& a = point(0);
    const Vec2& b = point(1);
    const Vec2& c = point(2);
    const Vec2& d = point(3);
    const double along_ac = std::min(orientation(a, b, c), orientation(a, c, d));
    const double along_bd = std::min(orientation(a, b, d), orientation(b, c, d));
    bool use_bd = along_bd > along_ac;
    if (along_ac > 0 && along_bd > 0) {
      constexpr double kTie = 1 - 1e-9;  // squares that rounding distorts keep one pattern
      use_bd = (d - b).squaredNorm() < kTie * (c - a).squaredNorm();
    }
    if (use_bd) {
      triangles.push_back({at(0), at(1), at(3)});
      triangles.push_back({at(1), at(2), at(3)});
    } else {
      triangles.push_back({at(0), at(1), at(2)});
      triangles.push_back({at(0), at(2), at(3)});
    }
  }

  std::vector<Vec2> points_;
  std::vector<int> rest_;
};

}  // namespace

void triangulate_polygon(std::span<const Vec3> corners, Triangles& triangles) {
  if (corners.size() == 3) {
    triangles.push_back({0, 1, 2});
    return;
  }
  EarClipper(project(corners)).run(triangles);
}

}  // namespace piecework::mesh
