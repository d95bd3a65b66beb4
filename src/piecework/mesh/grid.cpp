#include <piecework/mesh/grid.hpp>

#include <algorithm>
#include <cstddef>
#include <utility>

#include <piecework/core/random.hpp>

namespace piecework::mesh {
namespace {

double orientation(const Vec2& a, const Vec2& b, const Vec2& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

/// True if the counter-clockwise quad (a, b, c, d) may be cut from a to c: the triangle that is
/// worse off keeps at least as much area as with the other cut.
bool prefers_ac(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& d) {
  return std::min(orientation(a, b, c), orientation(a, c, d)) >=
         std::min(orientation(a, b, d), orientation(b, c, d));
}

}  // namespace

void jitter_grid(const Grid& grid, const Vec2& cell, double jitter, std::uint64_t seed,
                 std::vector<Vec2>& points) {
  Random random(seed);
  for (int row = 1; row + 1 < grid.rows; ++row) {
    for (int column = 1; column + 1 < grid.columns; ++column) {
      Vec2& point = points[grid.vertex(column, row)];
      point.x() += random.uniform(-jitter, jitter) * cell.x();
      point.y() += random.uniform(-jitter, jitter) * cell.y();
    }
  }
}

void triangulate_grid(const Grid& grid, SheetPattern pattern, bool rows_go_up,
                      const std::vector<Vec2>& points, Triangles& triangles) {
  for (int row = 0; row + 1 < grid.rows; ++row) {
    for (int column = 0; column + 1 < grid.columns; ++column) {
      // Counter-clockwise from the cell's first vertex.
      const int a = grid.vertex(column, row);
      int b = grid.vertex(column + 1, row);
      const int c = grid.vertex(column + 1, row + 1);
      int d = grid.vertex(column, row + 1);
      if (!rows_go_up) std::swap(b, d);
      bool cut_ac = pattern == SheetPattern::OneDiagonal || (column + row) % 2 == 0;
      if (pattern == SheetPattern::Delaunay)
        cut_ac = prefers_ac(points[a], points[b], points[c], points[d]);
      if (cut_ac) {
        triangles.push_back({a, b, c});
        triangles.push_back({a, c, d});
      } else {
        triangles.push_back({a, b, d});
        triangles.push_back({b, c, d});
      }
    }
  }
}

void stitch_loops(std::span<const LoopVertex> outer, std::span<const LoopVertex> inner,
                  Triangles& triangles) {
  const auto next_turn = [](std::span<const LoopVertex> loop, std::size_t i) {
    return i + 1 < loop.size() ? loop[i + 1].turn : 1.0;
  };
  const auto vertex = [](std::span<const LoopVertex> loop, std::size_t i) {
    return loop[i % loop.size()].vertex;
  };
  std::size_t i = 0;
  std::size_t j = 0;
  while (i < outer.size() || j < inner.size()) {
    const bool step_outer =
        j == inner.size() || (i < outer.size() && next_turn(outer, i) <= next_turn(inner, j));
    if (step_outer) {
      triangles.push_back({vertex(outer, i), vertex(outer, i + 1), vertex(inner, j)});
      ++i;
    } else {
      triangles.push_back({vertex(outer, i), vertex(inner, j + 1), vertex(inner, j)});
      ++j;
    }
  }
}

}  // namespace piecework::mesh
