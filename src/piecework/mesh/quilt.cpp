#include <piecework/mesh/quilt.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include <piecework/mesh/delaunay.hpp>
#include <piecework/mesh/grid.hpp>

namespace piecework::mesh {
namespace {

constexpr std::array<double, 3> kDensities{1.0, 0.7, kMaxQuiltDensity};
constexpr std::array<SheetPattern, 3> kPatterns{SheetPattern::Alternating, SheetPattern::Delaunay,
                                                SheetPattern::OneDiagonal};

class QuiltBuilder {
 public:
  explicit QuiltBuilder(const GeneratorOptions& options)
      : options_(options),
        cells_x_((options.columns - 1) / options.patches_x),
        cells_y_((options.rows - 1) / options.patches_y) {}

  MeshDocument run() {
    for (int py = 0; py < options_.patches_y; ++py) {
      for (int px = 0; px < options_.patches_x; ++px) add_patch(px, py);
    }
    set_flat_positions(points_, options_.height, document_);
    fill_layout();
    fill_sets();
    return std::move(document_);
  }

 private:
  [[nodiscard]] int lines_x() const { return cells_x_ * options_.patches_x; }
  [[nodiscard]] int lines_y() const { return cells_y_ * options_.patches_y; }

  /// Vertex of the border lattice, made when first asked for.
  int border_vertex(int i, int j) {
    const auto [entry, is_new] = border_.try_emplace({i, j}, static_cast<int>(points_.size()));
    if (is_new)
      points_.emplace_back(options_.width * i / lines_x(), -options_.height * j / lines_y());
    return entry->second;
  }

  /// Vertices once around the patch, counter-clockwise in (x, -z), a quarter turn per side.
  std::vector<LoopVertex> outer_loop(int px, int py) {
    const int i0 = px * cells_x_;
    const int j0 = py * cells_y_;
    return rectangle_loop(cells_x_, cells_y_,
                          [&](int i, int j) { return border_vertex(i0 + i, j0 + j); });
  }

  /// Loop around a grid of nx x ny cells whose vertices are vertex(i, j), j downwards.
  template <class Vertex>
  static std::vector<LoopVertex> rectangle_loop(int nx, int ny, const Vertex& vertex) {
    std::vector<LoopVertex> loop;
    for (int j = 0; j < ny; ++j) loop.push_back({vertex(0, j), 0.25 * j / ny});
    for (int i = 0; i < nx; ++i) loop.push_back({vertex(i, ny), 0.25 + 0.25 * i / nx});
    for (int j = 0; j < ny; ++j) loop.push_back({vertex(nx, ny - j), 0.5 + 0.25 * j / ny});
    for (int i = 0; i < nx; ++i) loop.push_back({vertex(nx - i, 0), 0.75 + 0.25 * i / nx});
    return loop;
  }

  void add_patch(int px, int py) {
    Triangles& triangles = document_.mesh.triangles;
    const auto first_triangle = static_cast<std::ptrdiff_t>(triangles.size());
    document_.layout.groups.push_back(
        {fmt::format("patch_{}_{}", px, py), static_cast<int>(first_triangle)});
    const double density = kDensities[static_cast<std::size_t>(px + 2 * py) % 3];
    const SheetPattern pattern = kPatterns[static_cast<std::size_t>(px + py) % 3];

    const std::vector<LoopVertex> outer = outer_loop(px, py);
    const Grid inner{inner_points(density, cells_x_), inner_points(density, cells_y_),
                     static_cast<int>(points_.size())};
    add_inner_points(px, py, inner, pattern);
    triangulate_grid(inner, pattern, /*rows_go_up=*/false, points_, triangles);
    stitch_loops(outer,
                 rectangle_loop(inner.columns - 1, inner.rows - 1,
                                [&](int i, int j) { return inner.vertex(i, j); }),
                 triangles);
    if (pattern != SheetPattern::Delaunay) return;
    Triangles patch(triangles.begin() + first_triangle, triangles.end());
    flip_patch(patch);
    std::copy(patch.begin(), patch.end(), triangles.begin() + first_triangle);
  }

  static int inner_points(double density, int cells) {
    return std::max(2, static_cast<int>(std::lround(density * cells)) - 1);
  }

  void add_inner_points(int px, int py, const Grid& inner, SheetPattern pattern) {
    const Vec2 size(options_.width / options_.patches_x, options_.height / options_.patches_y);
    const Vec2 cell(size.x() / (inner.columns + 1), size.y() / (inner.rows + 1));
    for (int j = 1; j <= inner.rows; ++j) {
      for (int i = 1; i <= inner.columns; ++i)
        points_.emplace_back(size.x() * px + cell.x() * i, -(size.y() * py + cell.y() * j));
    }
    if (pattern != SheetPattern::Delaunay) return;
    const auto patch = static_cast<std::uint64_t>(py) * 1000 + static_cast<std::uint64_t>(px);
    jitter_grid(inner, cell, options_.jitter, options_.seed + 7919 * patch, points_);
  }

  /// Flips within a patch, numbering its vertices anew for the duration.
  void flip_patch(Triangles& patch) const {
    std::vector<int> vertices;
    for (const Triangle& t : patch) vertices.insert(vertices.end(), t.begin(), t.end());
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    std::vector<Vec2> points;
    for (int v : vertices) points.push_back(points_[v]);
    for (Triangle& t : patch) {
      for (int& v : t)
        v = static_cast<int>(std::lower_bound(vertices.begin(), vertices.end(), v) -
                             vertices.begin());
    }
    flip_to_delaunay(points, patch);
    for (Triangle& t : patch) {
      for (int& v : t) v = vertices[v];
    }
  }

  /// Polygons are the triangles, so that exports can list them patch by patch.
  void fill_layout() {
    FileLayout& layout = document_.layout;
    layout.num_vertices = document_.mesh.num_vertices();
    layout.polygon_begin.resize(document_.mesh.triangles.size() + 1);
    for (std::size_t t = 0; t < layout.polygon_begin.size(); ++t)
      layout.polygon_begin[t] = static_cast<int>(3 * t);
    for (const Triangle& t : document_.mesh.triangles)
      layout.polygon_vertex.insert(layout.polygon_vertex.end(), t.begin(), t.end());
  }

  void fill_sets() {
    auto& sets = document_.vertex_sets;
    for (const auto& [place, vertex] : border_) {
      const auto [i, j] = place;
      const bool end_x = i == 0 || i == lines_x();
      const bool end_y = j == 0 || j == lines_y();
      if (i == 0) sets["left"].push_back(vertex);
      if (i == lines_x()) sets["right"].push_back(vertex);
      if (j == 0) sets["bottom"].push_back(vertex);
      if (j == lines_y()) sets["top"].push_back(vertex);
      if (end_x && end_y) sets["corners"].push_back(vertex);
    }
    const auto& groups = document_.layout.groups;
    for (std::size_t g = 0; g < groups.size(); ++g) {
      const int last =
          g + 1 < groups.size() ? groups[g + 1].first_polygon : document_.mesh.num_triangles();
      std::vector<int>& set = sets[groups[g].name];
      for (int t = groups[g].first_polygon; t < last; ++t)
        set.insert(set.end(), document_.mesh.triangles[t].begin(),
                   document_.mesh.triangles[t].end());
    }
    for (auto& [name, set] : sets) {
      std::sort(set.begin(), set.end());
      set.erase(std::unique(set.begin(), set.end()), set.end());
    }
  }

  const GeneratorOptions& options_;
  int cells_x_;  // border cells of a patch
  int cells_y_;
  std::vector<Vec2> points_;  // (x, -z)
  std::map<std::pair<int, int>, int> border_;
  MeshDocument document_;
};

}  // namespace

MeshDocument generate_quilt(const GeneratorOptions& options) { return QuiltBuilder(options).run(); }

}  // namespace piecework::mesh
