#pragma once

// Building blocks of the generators, in the plane: grids of cells and bands between two loops of
// points. Internal to mesh/. Points are (x, y) with y up; triangles are counter-clockwise.

#include <cstdint>
#include <span>
#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/mesh/generate.hpp>

namespace piecework::mesh {

/// A grid of columns x rows vertices, numbered `first` + row * columns + column.
struct Grid {
  int columns;
  int rows;
  int first = 0;
  [[nodiscard]] int vertex(int column, int row) const { return first + row * columns + column; }
};

/// Moves the inner vertices of a grid by up to `jitter` (< 0.5) of the cell in x and y, in the
/// order of their numbers.
void jitter_grid(const Grid& grid, const Vec2& cell, double jitter, std::uint64_t seed,
                 std::vector<Vec2>& points);

/// Appends the two triangles of every cell, row by row. With `rows_go_up` row 1 lies above row 0 in
/// the plane, else below it. Delaunay cells get a diagonal that does not fold them over; the edges
/// are not flipped yet.
void triangulate_grid(const Grid& grid, SheetPattern pattern, bool rows_go_up,
                      const std::vector<Vec2>& points, Triangles& triangles);

/// One point of a closed loop of points.
struct LoopVertex {
  int vertex;
  double turn;  ///< where it is on the loop, ascending from 0 to below 1
};

/// Appends the triangles of the band between two loops that run counter-clockwise around the same
/// middle, both starting at turn 0: points of like turns are joined.
void stitch_loops(std::span<const LoopVertex> outer, std::span<const LoopVertex> inner,
                  Triangles& triangles);

}  // namespace piecework::mesh
