#include <piecework/colliders/audit.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include <piecework/collision/distance.hpp>
#include <piecework/core/parallel.hpp>

namespace piecework::colliders {
namespace {

/// Bodies so many times larger or smaller than the cloth are called implausible. Chosen: a floor
/// mesh may well be ten times as large as a towel.
constexpr double kImplausible = 30;

/// Triangles whose area is at most this fraction of their longest edge squared have none.
constexpr double kFlat = 1e-12;

int count_zero_area(const Triangles& triangles, const Positions& x) {
  return static_cast<int>(std::count_if(triangles.begin(), triangles.end(), [&](const auto& t) {
    const Vec3 a = x.row(t[0]), b = x.row(t[1]), c = x.row(t[2]);
    const double longest_sq =
        std::max({(b - a).squaredNorm(), (c - a).squaredNorm(), (c - b).squaredNorm()});
    return (b - a).cross(c - a).norm() <= kFlat * longest_sq;
  }));
}

int count_duplicates(Triangles triangles) {
  for (Triangle& t : triangles) std::sort(t.begin(), t.end());
  std::sort(triangles.begin(), triangles.end());
  return static_cast<int>(triangles.end() - std::unique(triangles.begin(), triangles.end()));
}

/// Numbers of the steps to look at.
std::vector<int> audited_steps(int steps) {
  std::vector<int> chosen;
  const int count = std::min(steps, kMaxAuditedSteps);
  for (int i = 0; i < count; ++i)
    chosen.push_back(static_cast<int>(static_cast<std::int64_t>(i) * steps / count));
  return chosen;
}

/// \param positions_at  (time, Positions&)
template <class PositionsAt>
double largest_displacement(const PositionsAt& positions_at, const AuditOptions& options) {
  double largest_sq = 0;
  Positions before, after;
  for (const int step : audited_steps(options.steps)) {
    positions_at(step * options.h, before);
    positions_at((step + 1) * options.h, after);
    largest_sq = std::max(largest_sq, (after - before).rowwise().squaredNorm().maxCoeff());
  }
  return std::sqrt(largest_sq);
}

/// Triangles that a ray along +x may cross, by cells of a grid in y and z.
class RayGrid {
 public:
  RayGrid(const Triangles& triangles, const Positions& x) : triangles_(triangles), x_(x) {
    low_ = x.rightCols<2>().colwise().minCoeff().transpose();
    const Vec2 size = x.rightCols<2>().colwise().maxCoeff().transpose() - low_;
    side_ = std::max(1, static_cast<int>(std::sqrt(0.5 * static_cast<double>(triangles.size()))));
    for (Eigen::Index k = 0; k < 2; ++k) per_m_[k] = size[k] > 0 ? side_ / size[k] : 0;
    cells_.resize(static_cast<std::size_t>(side_) * static_cast<std::size_t>(side_));
    for (int t = 0; t < static_cast<int>(triangles.size()); ++t) add(t);
  }

  /// Crossings of the ray from p towards +x, those outward counted up and those inward down.
  [[nodiscard]] int crossings(const Vec3& p) const {
    const Vec2 q = p.tail<2>();
    const std::array<int, 2> at{cell_of(q, 0), cell_of(q, 1)};
    int sum = 0;
    for (const int t : cells_[index(at[0], at[1])]) sum += crossing(triangles_[t], p);
    return sum;
  }

 private:
  [[nodiscard]] int cell_of(const Vec2& q, Eigen::Index k) const {
    return std::clamp(
        static_cast<int>(std::floor(std::clamp((q[k] - low_[k]) * per_m_[k], -1.0, side_ + 1.0))),
        0, side_ - 1);
  }
  [[nodiscard]] std::size_t index(int i, int j) const {
    return static_cast<std::size_t>(j) * static_cast<std::size_t>(side_) +
           static_cast<std::size_t>(i);
  }

  void add(int t) {
    Vec2 low = Vec2::Constant(std::numeric_limits<double>::infinity()), high = -low;
    for (const int v : triangles_[t]) {
      low = low.cwiseMin(x_.row(v).tail<2>().transpose());
      high = high.cwiseMax(x_.row(v).tail<2>().transpose());
    }
    for (int j = cell_of(low, 1); j <= cell_of(high, 1); ++j)
      for (int i = cell_of(low, 0); i <= cell_of(high, 0); ++i) cells_[index(i, j)].push_back(t);
  }

  /// Whether the line through p along x passes below (in y) of the edge, seen in the yz plane. The
  /// same bits for both triangles of an edge.
  [[nodiscard]] bool passes(int v, int w, const Vec3& p) const {
    const int first = std::min(v, w), second = std::max(v, w);
    const double z0 = x_(first, 2), z1 = x_(second, 2);
    if ((z0 > p.z()) == (z1 > p.z())) return false;
    return p.y() < x_(first, 1) + (p.z() - z0) / (z1 - z0) * (x_(second, 1) - x_(first, 1));
  }

  [[nodiscard]] int crossing(const Triangle& t, const Vec3& p) const {
    const bool hit = passes(t[0], t[1], p) != (passes(t[1], t[2], p) != passes(t[2], t[0], p));
    if (!hit) return 0;
    const Vec3 a = x_.row(t[0]), b = x_.row(t[1]), c = x_.row(t[2]);
    const Vec3 normal = (b - a).cross(c - a);
    if (normal.x() == 0 || !(normal.dot(a - p) / normal.x() > 0)) return 0;
    return normal.x() > 0 ? 1 : -1;
  }

  const Triangles& triangles_;
  const Positions& x_;
  Vec2 low_, per_m_;
  int side_;
  std::vector<std::vector<int>> cells_;
};

/// Distance from a point to the nearest triangle, with balls around triangles that rule most out.
class NearestTriangle {
 public:
  NearestTriangle(const Triangles& triangles, const Positions& x) : triangles_(triangles), x_(x) {
    for (const Triangle& t : triangles) {
      const Vec3 center = (x.row(t[0]) + x.row(t[1]) + x.row(t[2])).transpose() / 3;
      double radius = 0;
      for (const int v : t) radius = std::max(radius, (Vec3(x.row(v)) - center).norm());
      balls_.push_back({center, radius});
    }
  }

  [[nodiscard]] double distance(const Vec3& p) const {
    double best = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < balls_.size(); ++i) {
      if ((p - balls_[i].center).norm() - balls_[i].radius > best) continue;
      const Triangle& t = triangles_[i];
      const collision::PairPoints pair{p, x_.row(t[0]), x_.row(t[1]), x_.row(t[2])};
      best = std::min(best, std::sqrt(collision::closest_vertex_triangle(pair).distance_sq));
    }
    return best;
  }

 private:
  struct Ball {
    Vec3 center;
    double radius;
  };
  const Triangles& triangles_;
  const Positions& x_;
  std::vector<Ball> balls_;
};

/// Half of the length of a diagonal: what of a plane counts as near the cloth.
double reach(const Positions& cloth) {
  return 0.5 * (cloth.colwise().maxCoeff() - cloth.colwise().minCoeff()).norm();
}

bool is_bounded(const Shape& shape) {
  return !std::holds_alternative<Plane>(shape) && !std::holds_alternative<HalfSpaces>(shape);
}

std::string size_text(const Audit& audit) {
  const Vec3 size = audit.high - audit.low;
  return fmt::format("{:.3g} x {:.3g} x {:.3g} m", size.x(), size.y(), size.z());
}

}  // namespace

double signed_volume(const Triangles& triangles, const Positions& x) {
  const Eigen::RowVector3d origin = x.colwise().mean();
  double sum = 0;
  for (const Triangle& t : triangles)
    sum += (x.row(t[0]) - origin).dot((x.row(t[1]) - origin).cross(x.row(t[2]) - origin));
  return sum / 6;
}

std::vector<int> points_inside(const Triangles& triangles, const Positions& x,
                               const Positions& points) {
  const RayGrid grid(triangles, x);
  std::vector<char> is_inside(static_cast<std::size_t>(points.rows()));
  parallel_for(is_inside.size(), [&](std::size_t i) {
    is_inside[i] = grid.crossings(points.row(static_cast<Eigen::Index>(i))) != 0;
  });
  std::vector<int> inside;
  for (std::size_t i = 0; i < is_inside.size(); ++i)
    if (is_inside[i]) inside.push_back(static_cast<int>(i));
  return inside;
}

Audit audit(const AnalyticCollider& collider, const Positions& cloth, const AuditOptions& options) {
  Audit result;
  const mesh::TriangleMesh start = collider.tessellate(0, reach(cloth));
  result.low = start.positions.colwise().minCoeff();
  result.high = start.positions.colwise().maxCoeff();
  result.bounded = is_bounded(collider.shape());
  if (!collider.is_static())
    result.step_displacement = largest_displacement(
        [&](double time, Positions& x) {
          const Eigen::Isometry3d moved = collider.motion().at(time);
          x = start.positions * moved.linear().transpose();
          x.rowwise() += moved.translation().transpose();
        },
        options);
  const Eigen::Isometry3d pose = collider.pose(0);
  for (Eigen::Index v = 0; v < cloth.rows(); ++v) {
    const double distance = collider.signed_distance(cloth.row(v), pose).distance;
    if (!(distance < 0)) continue;
    result.inside.push_back(static_cast<int>(v));
    result.depth = std::max(result.depth, -distance);
  }
  return result;
}

Audit audit(const MeshCollider& collider, const Positions& cloth, const AuditOptions& options) {
  Audit result;
  const Triangles& triangles = collider.triangles();
  Positions x;
  collider.positions_at(0, x);
  result.num_triangles = static_cast<int>(triangles.size());
  result.low = x.colwise().minCoeff();
  result.high = x.colwise().maxCoeff();
  result.closed = collider.closed();
  result.zero_area = count_zero_area(triangles, x);
  result.duplicates = count_duplicates(triangles);
  if (!collider.is_static())
    result.step_displacement = largest_displacement(
        [&](double time, Positions& out) { collider.positions_at(time, out); }, options);
  if (!result.closed) return result;
  result.volume = signed_volume(triangles, x);
  result.inside = points_inside(triangles, x, cloth);
  if (result.inside.empty()) return result;
  const NearestTriangle surface(triangles, x);
  result.depth = parallel_max(
      result.inside.size(),
      [&](std::size_t i) { return surface.distance(cloth.row(result.inside[i])); },
      /*grain=*/16);
  return result;
}

std::vector<std::string> notes(const Audit& audit, const Traits& traits, double cloth_extent) {
  const std::string name = fmt::format("collider {}", traits.name);
  std::string summary = name + ":";
  if (audit.num_triangles > 0)
    summary +=
        fmt::format(" {} triangles, {},", audit.num_triangles, audit.closed ? "closed" : "open");
  summary += audit.bounded ? " " + size_text(audit) : " an exact solid without bounds";
  if (audit.step_displacement > 0)
    summary += fmt::format(", moves up to {:.3g} mm per step", 1e3 * audit.step_displacement);
  std::vector<std::string> lines{summary};
  const auto add = [&](const std::string& text) { lines.push_back(name + ": " + text); };

  const double ratio = (audit.high - audit.low).maxCoeff() / cloth_extent;
  if (audit.bounded && ratio > kImplausible)
    add(fmt::format("{:.3g} times as large as the cloth; check its units", ratio));
  if (audit.bounded && ratio < 1 / kImplausible)
    add(fmt::format("{:.3g} times smaller than the cloth; check its units", 1 / ratio));
  if (audit.volume < 0)
    add(fmt::format("inside out (volume {:.3g} m^3); turn its triangles around", audit.volume));
  if (audit.zero_area > 0) add(fmt::format("{} triangles without area", audit.zero_area));
  if (audit.duplicates > 0) add(fmt::format("{} duplicate triangles", audit.duplicates));
  if (traits.thickness && audit.step_displacement > *traits.thickness)
    add(
        fmt::format("moves {:.3g} mm per step, more than its thickness of {:.3g} mm; smaller steps "
                    "lose less contact",
                    1e3 * audit.step_displacement, 1e3 * *traits.thickness));
  if (!audit.inside.empty())
    add(fmt::format("{} cloth vertices start inside, the deepest {:.3g} mm deep",
                    audit.inside.size(), 1e3 * audit.depth));
  return lines;
}

}  // namespace piecework::colliders
