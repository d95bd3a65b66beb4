#include <piecework/mesh/solids.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

namespace piecework::mesh {
namespace {

constexpr double kPi = std::numbers::pi;

/// Vertices first ... first + columns - 1, or a single one where the surface closes.
struct Ring {
  int first;
  bool pole;
};

/// The band between two rings, `above` on the left of someone who walks around seen from outside.
void add_band(const Ring& below, const Ring& above, int columns, Triangles& triangles) {
  for (int i = 0; i < columns; ++i) {
    const int next = (i + 1) % columns;
    const int a0 = below.pole ? below.first : below.first + i;
    const int a1 = below.pole ? below.first : below.first + next;
    const int b0 = above.pole ? above.first : above.first + i;
    const int b1 = above.pole ? above.first : above.first + next;
    if (!below.pole) triangles.push_back({a0, a1, b1});
    if (!above.pole) triangles.push_back({a0, b1, b0});
  }
}

TriangleMesh surface(const std::vector<Vec3>& points, Triangles triangles) {
  TriangleMesh mesh;
  mesh.positions.resize(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t v = 0; v < points.size(); ++v)
    mesh.positions.row(static_cast<Eigen::Index>(v)) = points[v].transpose();
  mesh.triangles = std::move(triangles);
  return mesh;
}

/// Axes perpendicular to the tangent of a path; the next pair follows from it by two reflections.
struct Frame {
  Vec3 normal, tangent;
  [[nodiscard]] Vec3 binormal() const { return tangent.cross(normal); }
};

Vec3 reflect(const Vec3& v, const Vec3& mirror) {
  return v - 2 * mirror.dot(v) / mirror.squaredNorm() * mirror;
}

Frame next_frame(const Frame& frame, const Vec3& step, const Vec3& tangent) {
  const Vec3 normal = reflect(frame.normal, step);
  const Vec3 across = tangent - reflect(frame.tangent, step);
  // Without a bend left there is nothing to mirror a second time.
  return {across.isZero(1e-15) ? normal : reflect(normal, across), tangent};
}

Vec3 tangent_at(std::span<const Vec3> path, std::size_t i) {
  const Vec3& before = path[i == 0 ? 0 : i - 1];
  const Vec3& after = path[std::min(i + 1, path.size() - 1)];
  return (after - before).normalized();
}

/// Points of the Catmull-Rom curve through `points`, `parts` per span.
template <class Point>
std::vector<Point> smooth(const std::vector<Point>& points, int parts) {
  std::vector<Point> curve;
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    const Point& p1 = points[i];
    const Point& p2 = points[i + 1];
    const Point m1 = 0.5 * (p2 - points[i == 0 ? 0 : i - 1]);
    const Point m2 = 0.5 * (points[std::min(i + 2, points.size() - 1)] - p1);
    for (int k = 0; k < parts; ++k) {
      const double t = 1.0 * k / parts, u = 1 - t;
      curve.push_back((1 + 2 * t) * u * u * p1 + t * u * u * m1 + t * t * (3 - 2 * t) * p2 -
                      t * t * u * m2);
    }
  }
  curve.push_back(points.back());
  return curve;
}

/// Cuts the segments of a profile so that none is longer than `spacing`.
std::vector<Vec2> subdivide(const std::vector<Vec2>& profile, double spacing) {
  std::vector<Vec2> fine;
  for (std::size_t i = 0; i + 1 < profile.size(); ++i) {
    const Vec2 step = profile[i + 1] - profile[i];
    const int parts = std::max(1, static_cast<int>(std::ceil(step.norm() / spacing)));
    for (int k = 0; k < parts; ++k) fine.push_back(profile[i] + 1.0 * k / parts * step);
  }
  fine.push_back(profile.back());
  return fine;
}

/// Coordinates of the grid lines along one axis of a rounded box before it is rounded: the radial
/// projection of a corner makes equal arcs of them.
std::vector<double> grid_lines(double half, double rounding, int segments) {
  if (rounding == 0) return {-half, half};
  std::vector<double> lines;
  for (int k = segments; k >= 0; --k)
    lines.push_back(-(half - rounding) - rounding * std::tan(0.25 * kPi * k / segments));
  for (int k = half > rounding ? 0 : 1; k <= segments; ++k)
    lines.push_back((half - rounding) + rounding * std::tan(0.25 * kPi * k / segments));
  return lines;
}

/// Numbers the surface points of a grid of lines as they are asked for.
class BoxBuilder {
 public:
  BoxBuilder(const Vec3& half, double rounding, int segments)
      : core_(half.array() - rounding), rounding_(rounding) {
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      lines_[static_cast<std::size_t>(axis)] = grid_lines(half[axis], rounding, segments);
  }

  TriangleMesh run() {
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (const bool high : {false, true}) add_side(axis, high);
    return surface(points_, std::move(triangles_));
  }

 private:
  using Index = std::array<std::size_t, 3>;

  void add_side(std::size_t axis, bool high) {
    const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
    Index index{};
    index[axis] = high ? lines_[axis].size() - 1 : 0;
    const auto corner = [&](std::size_t i, std::size_t j) {
      index[u] = i;
      index[v] = j;
      return vertex(index);
    };
    for (std::size_t j = 0; j + 1 < lines_[v].size(); ++j)
      for (std::size_t i = 0; i + 1 < lines_[u].size(); ++i) {
        const int a = corner(i, j), b = corner(i + 1, j), c = corner(i + 1, j + 1),
                  d = corner(i, j + 1);
        triangles_.push_back(high ? Triangle{a, b, c} : Triangle{a, c, b});
        triangles_.push_back(high ? Triangle{a, c, d} : Triangle{a, d, c});
      }
  }

  int vertex(const Index& index) {
    const auto [found, is_new] = numbers_.try_emplace(index, static_cast<int>(points_.size()));
    if (!is_new) return found->second;
    const Vec3 p(lines_[0][index[0]], lines_[1][index[1]], lines_[2][index[2]]);
    const Vec3 inner = p.cwiseMin(core_).cwiseMax(-core_);
    points_.push_back(rounding_ > 0 ? Vec3(inner + rounding_ * (p - inner).normalized()) : p);
    return found->second;
  }

  Vec3 core_;
  double rounding_;
  std::array<std::vector<double>, 3> lines_;
  std::map<Index, int> numbers_;
  std::vector<Vec3> points_;
  Triangles triangles_;
};

constexpr std::array<std::array<int, 3>, 20> kIcosahedron = {
    {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
     {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
     {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}}};

std::array<Vec3, 12> icosahedron_corners() {
  const double g = std::numbers::phi;
  return {Vec3(-1, g, 0), Vec3(1, g, 0), Vec3(-1, -g, 0), Vec3(1, -g, 0),
          Vec3(0, -1, g), Vec3(0, 1, g), Vec3(0, -1, -g), Vec3(0, 1, -g),
          Vec3(g, 0, -1), Vec3(g, 0, 1), Vec3(-g, 0, -1), Vec3(-g, 0, 1)};
}

/// Corners of the icosahedron with their share of a point; without shares of 0, so that points on
/// a common edge have one key.
using Shares = std::vector<std::pair<int, int>>;

Shares shares_of(const std::array<int, 3>& face, const std::array<int, 3>& parts) {
  Shares shares;
  for (std::size_t k = 0; k < 3; ++k)
    if (parts[k] > 0) shares.emplace_back(face[k], parts[k]);
  std::sort(shares.begin(), shares.end());
  return shares;
}

}  // namespace

void append(const TriangleMesh& piece, TriangleMesh& mesh) {
  const int first = mesh.num_vertices();
  Positions positions(first + piece.num_vertices(), 3);
  positions << mesh.positions, piece.positions;
  mesh.positions = std::move(positions);
  for (const Triangle& t : piece.triangles)
    mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
}

TriangleMesh lathe(std::span<const Vec2> profile, int columns) {
  std::vector<Vec3> points;
  std::vector<Ring> rings;
  for (const Vec2& p : profile) {
    const bool pole = p.x() == 0;
    rings.push_back({static_cast<int>(points.size()), pole});
    for (int i = 0; i < (pole ? 1 : columns); ++i) {
      const double angle = 2 * kPi * i / columns;
      points.emplace_back(p.x() * std::cos(angle), p.y(), -p.x() * std::sin(angle));
    }
  }
  Triangles triangles;
  for (std::size_t j = 0; j + 1 < rings.size(); ++j)
    add_band(rings[j], rings[j + 1], columns, triangles);
  if (!rings.front().pole) add_band(rings.back(), rings.front(), columns, triangles);
  return surface(points, std::move(triangles));
}

TriangleMesh sweep(std::span<const Vec3> path, std::span<const double> radii, int columns) {
  std::vector<Vec3> points{path.front()};
  std::vector<Ring> rings{{0, true}};
  const Vec3 start = tangent_at(path, 0);
  Frame frame{start.unitOrthogonal(), start};
  for (std::size_t j = 0; j < path.size(); ++j) {
    if (j > 0) frame = next_frame(frame, path[j] - path[j - 1], tangent_at(path, j));
    rings.push_back({static_cast<int>(points.size()), false});
    for (int i = 0; i < columns; ++i) {
      const double angle = 2 * kPi * i / columns;
      points.push_back(path[j] + radii[j] * (std::cos(angle) * frame.normal +
                                             std::sin(angle) * frame.binormal()));
    }
  }
  rings.push_back({static_cast<int>(points.size()), true});
  points.push_back(path.back());
  Triangles triangles;
  for (std::size_t j = 0; j + 1 < rings.size(); ++j)
    add_band(rings[j], rings[j + 1], columns, triangles);
  return surface(points, std::move(triangles));
}

TriangleMesh icosphere(double radius, int parts) {
  const std::array<Vec3, 12> corners = icosahedron_corners();
  std::vector<Vec3> points;
  Triangles triangles;
  std::map<Shares, int> numbers;
  const auto vertex = [&](const std::array<int, 3>& face, int i, int j) {
    const Shares shares = shares_of(face, {parts - i - j, i, j});
    const auto [found, is_new] = numbers.try_emplace(shares, static_cast<int>(points.size()));
    if (is_new) {
      Vec3 sum = Vec3::Zero();
      for (const auto& [corner, share] : shares) sum += share * corners[corner];
      points.push_back(radius * sum.normalized());
    }
    return found->second;
  };
  for (const std::array<int, 3>& face : kIcosahedron)
    for (int i = 0; i < parts; ++i)
      for (int j = 0; i + j < parts; ++j) {
        const int a = vertex(face, i, j), b = vertex(face, i + 1, j), c = vertex(face, i, j + 1);
        triangles.push_back({a, b, c});
        if (i + j + 2 <= parts) triangles.push_back({b, vertex(face, i + 1, j + 1), c});
      }
  return surface(points, std::move(triangles));
}

TriangleMesh box(const Vec3& size, double rounding, int segments) {
  return BoxBuilder(0.5 * size, rounding, segments).run();
}

TriangleMesh stairs(const Vec3& size, int steps) {
  // Of each riser: on the ground, at its foot (not of the first), at its head (a last riser, behind
  // the stairs, has none). Two walls of them: first x < 0, then x > 0.
  const auto ground = [](int s) { return s == 0 ? 0 : 3 * s - 1; };
  const auto foot = [](int s) { return s == 0 ? 0 : 3 * s; };
  const auto head = [](int s) { return 3 * s + 1; };
  const int wall = 3 * steps + 1;
  std::vector<Vec3> points;
  for (const double x : {-0.5 * size.x(), 0.5 * size.x()})
    for (int s = 0; s <= steps; ++s) {
      const auto add = [&](int level) {
        points.emplace_back(x, size.y() * level / steps, size.z() * s / steps);
      };
      add(0);
      if (s > 0) add(s);
      if (s < steps) add(s + 1);
    }
  Triangles triangles;
  const auto side = [&](int a, int b, int c) {
    triangles.push_back({a, b, c});
    triangles.push_back({wall + a, wall + c, wall + b});
  };
  const auto strip = [&](int a, int b) {
    triangles.push_back({a, b, wall + b});
    triangles.push_back({a, wall + b, wall + a});
  };
  for (int s = 0; s < steps; ++s) {
    side(foot(s + 1), head(s), foot(s));
    if (s > 0) side(foot(s + 1), foot(s), ground(s));
    side(foot(s + 1), ground(s), ground(s + 1));
    strip(foot(s), head(s));
    strip(head(s), foot(s + 1));
    strip(ground(s + 1), ground(s));
  }
  strip(foot(steps), ground(steps));
  return surface(points, std::move(triangles));
}

TriangleMesh funnel(double radius, double height, int columns) {
  const double wall = 0.05 * radius, r = 0.5 * wall, spout = 0.2 * radius;
  // The middle of the wall, with the directions across it; at the bend the wall keeps its width.
  const Vec2 low(spout - r, r), bend(spout - r, 0.35 * height), high(radius - r, height - r);
  const Vec2 along = (high - bend).normalized();
  const Vec2 across(along.y(), -along.x());
  const Vec2 miter = r * (across + Vec2::UnitX()) / (1 + across.x());
  std::vector<Vec2> profile;
  const auto add_rim = [&](const Vec2& middle, const Vec2& from) {
    constexpr int kArcs = 6;
    for (int k = 0; k <= kArcs; ++k)
      profile.push_back(middle + r * (Eigen::Rotation2Dd(kPi * k / kArcs) * from));
  };
  add_rim(low, -Vec2::UnitX());
  profile.push_back(bend + miter);
  add_rim(high, across);
  profile.push_back(bend - miter);
  profile.push_back(profile.front());
  std::vector<Vec2> ring = subdivide(profile, 2 * kPi * 0.6 * radius / columns);
  ring.pop_back();  // the first point again
  return lathe(ring, columns);
}

TriangleMesh pot(double radius, int columns) {
  const int parts = std::max(2, columns / 12);
  const auto turned = [&](std::vector<Vec2> curve) {
    for (Vec2& p : curve) p *= radius;
    return lathe(subdivide(curve, 2 * kPi * radius / columns), columns);
  };
  const auto swept = [&](const std::vector<Eigen::Vector4d>& stations) {
    std::vector<Vec3> path;
    std::vector<double> radii;
    for (const Eigen::Vector4d& s : smooth(stations, parts)) {
      path.push_back(radius * s.head<3>());
      radii.push_back(radius * s[3]);
    }
    return sweep(path, radii, std::max(8, columns / 3));
  };
  std::vector<Vec2> body = smooth<Vec2>(
      {{0.60, 0.05}, {0.86, 0.28}, {1.0, 0.62}, {0.90, 0.96}, {0.66, 1.16}, {0.60, 1.22}}, parts);
  body.insert(body.begin(), {Vec2(0, 0), Vec2(0.58, 0), Vec2(0.60, 0.02)});
  body.insert(body.end(), {Vec2(0.57, 1.24), Vec2(0, 1.24)});
  std::vector<Vec2> lid = smooth<Vec2>({{0.53, 1.27},
                                        {0.36, 1.36},
                                        {0.15, 1.415},
                                        {0.09, 1.46},
                                        {0.14, 1.54},
                                        {0.16, 1.60},
                                        {0.10, 1.68}},
                                       parts);
  lid.insert(lid.begin(), {Vec2(0, 1.2), Vec2(0.53, 1.2), Vec2(0.55, 1.235)});
  lid.emplace_back(0, 1.7);
  TriangleMesh mesh = turned(body);
  append(turned(lid), mesh);
  append(swept({{0.60, 0.40, 0, 0.26},
                {1.02, 0.50, 0, 0.20},
                {1.30, 0.82, 0, 0.125},
                {1.52, 1.16, 0, 0.09},
                {1.66, 1.24, 0, 0.085}}),
         mesh);
  append(swept({{-0.60, 0.96, 0, 0.08},
                {-1.12, 1.13, 0, 0.075},
                {-1.48, 0.98, 0, 0.07},
                {-1.46, 0.66, 0, 0.07},
                {-1.18, 0.40, 0, 0.075},
                {-0.75, 0.36, 0, 0.08}}),
         mesh);
  return mesh;
}

}  // namespace piecework::mesh
