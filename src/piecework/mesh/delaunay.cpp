#include <piecework/mesh/delaunay.hpp>

#include <algorithm>
#include <array>
#include <cstddef>

#include <piecework/core/error.hpp>
#include <piecework/mesh/topology.hpp>

namespace piecework::mesh {
namespace {

/// Determinants below this fraction of their scale (length^4) are rounding, not a violation.
constexpr double kInCircleTolerance = 1e-12;

/// True if d lies inside the circumcircle of the counter-clockwise triangle (a, b, c).
bool is_in_circle(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& d) {
  const Vec2 p = a - d;
  const Vec2 q = b - d;
  const Vec2 r = c - d;
  const double pp = p.squaredNorm();
  const double qq = q.squaredNorm();
  const double rr = r.squaredNorm();
  const double determinant = pp * (q.x() * r.y() - q.y() * r.x()) +
                             qq * (r.x() * p.y() - r.y() * p.x()) +
                             rr * (p.x() * q.y() - p.y() * q.x());
  const double largest = std::max({pp, qq, rr});
  return determinant > kInCircleTolerance * largest * largest;
}

class Flipper {
 public:
  Flipper(const std::vector<Vec2>& points, Triangles& triangles)
      : points_(points), triangles_(triangles), neighbours_(triangles.size(), {-1, -1, -1}) {
    for (const Edge& edge : find_edges(triangles_)) {
      const auto [a, b] = edge.triangles;
      if (b < 0) continue;
      neighbours_[a][opposite_side(a, edge.vertices)] = b;
      neighbours_[b][opposite_side(b, edge.vertices)] = a;
    }
  }

  void run() {
    for (int t = static_cast<int>(triangles_.size()) - 1; t >= 0; --t) push(t);
    while (!stack_.empty()) {
      const int t = stack_.back();
      stack_.pop_back();
      queued_[t] = false;
      for (int k = 0; k < 3; ++k) {
        if (flip_if_needed(t, k)) break;  // t was pushed again
      }
    }
  }

 private:
  /// Corner of triangle t that is on neither end of the edge.
  [[nodiscard]] int opposite_side(int t, const std::array<int, 2>& edge) const {
    for (int k = 0; k < 2; ++k) {
      if (triangles_[t][k] != edge[0] && triangles_[t][k] != edge[1]) return k;
    }
    return 2;
  }

  void push(int t) {
    if (queued_[t]) return;
    queued_[t] = true;
    stack_.push_back(t);
  }

  [[nodiscard]] int side_towards(int t, int neighbour) const {
    for (int k = 0; k < 2; ++k) {
      if (neighbours_[t][k] == neighbour) return k;
    }
    PIECEWORK_ASSERT(neighbours_[t][2] == neighbour);
    return 2;
  }

  void replace_neighbour(int t, int old_neighbour, int neighbour) {
    if (t >= 0) neighbours_[t][side_towards(t, old_neighbour)] = neighbour;
  }

  /// Looks at the edge opposite corner k of triangle t. With a = corner k of t and d = the corner
  /// across, (a, b, c) and (d, c, b) become (a, b, d) and (a, d, c).
  bool flip_if_needed(int t, int k) {
    const int u = neighbours_[t][k];
    if (u < 0) return false;
    const int m = side_towards(u, t);
    const int a = triangles_[t][k];
    const int b = triangles_[t][(k + 1) % 3];
    const int c = triangles_[t][(k + 2) % 3];
    const int d = triangles_[u][m];
    if (!is_in_circle(points_[a], points_[b], points_[c], points_[d])) return false;
    const int across_ca = neighbours_[t][(k + 1) % 3];
    const int across_ab = neighbours_[t][(k + 2) % 3];
    const int across_bd = neighbours_[u][(m + 1) % 3];
    const int across_dc = neighbours_[u][(m + 2) % 3];
    triangles_[t] = {a, b, d};
    neighbours_[t] = {across_bd, u, across_ab};
    triangles_[u] = {a, d, c};
    neighbours_[u] = {across_dc, across_ca, t};
    replace_neighbour(across_bd, u, t);
    replace_neighbour(across_ca, t, u);
    push(t);
    push(u);
    return true;
  }

  const std::vector<Vec2>& points_;
  Triangles& triangles_;
  std::vector<std::array<int, 3>> neighbours_;  // across the edge opposite each corner, or -1
  std::vector<int> stack_;
  std::vector<bool> queued_ = std::vector<bool>(triangles_.size(), false);
};

}  // namespace

void flip_to_delaunay(const std::vector<Vec2>& points, Triangles& triangles) {
  Flipper(points, triangles).run();
}

}  // namespace piecework::mesh
