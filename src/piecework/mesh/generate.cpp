#include <piecework/mesh/generate.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include <piecework/core/error.hpp>
#include <piecework/mesh/delaunay.hpp>
#include <piecework/mesh/grid.hpp>
#include <piecework/mesh/import.hpp>
#include <piecework/mesh/quilt.hpp>
#include <piecework/mesh/solids.hpp>
#include <piecework/mesh/topology.hpp>

namespace piecework::mesh {
namespace {

/// Cells longer than this many times their width would be refused as zero-area triangles.
constexpr double kMaxCellAspect = 1e7;
constexpr double kMaxSize = 1e6;   // m; chosen: larger cloth is a mistake of units
constexpr double kMinSize = 1e-6;  // m
constexpr double kMaxJitter = 0.45;

[[noreturn]] void fail(GeneratorKind kind, const char* parameter, const std::string& problem) {
  throw InputError(fmt::format("{}: {}: {}", to_string(kind), parameter, problem));
}

void check_size(GeneratorKind kind, const char* parameter, double value) {
  if (!(value >= kMinSize && value <= kMaxSize))
    fail(kind, parameter,
         fmt::format("{} m is not allowed; give {:g} to {:g} m", value, kMinSize, kMaxSize));
}

void check_count(GeneratorKind kind, const char* parameter, int value, int smallest) {
  if (value < smallest)
    fail(kind, parameter, fmt::format("{} is too few; give at least {}", value, smallest));
}

/// \param cells  cells of the grid, two triangles each; for discs an upper bound
void check_triangles(GeneratorKind kind, double cells) {
  if (2 * cells > static_cast<double>(kMaxTriangles))
    fail(kind, "columns and rows",
         fmt::format("{:.0f} triangles; give fewer, at most {} are supported", 2 * cells,
                     kMaxTriangles));
}

void check_jitter(GeneratorKind kind, double jitter) {
  if (!(jitter >= 0 && jitter <= kMaxJitter))
    fail(kind, "jitter", fmt::format("{} is not allowed; give 0 to {}", jitter, kMaxJitter));
}

void check_aspect(GeneratorKind kind, double cell_x, double cell_y) {
  const double aspect = std::max(cell_x, cell_y) / std::min(cell_x, cell_y);
  if (!(aspect <= kMaxCellAspect))
    fail(kind, "columns and rows",
         fmt::format("cells are {:.2g} times longer than wide; at most {:g} times is allowed, give "
                     "more vertices along the longer side",
                     aspect, kMaxCellAspect));
}

/// Vertices first, first + step, ..., count of them.
std::vector<int> every(int first, int step, int count) {
  std::vector<int> vertices(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) vertices[i] = first + i * step;
  return vertices;
}

MeshDocument generate_sheet(GeneratorKind kind, const GeneratorOptions& o) {
  check_size(kind, "width", o.width);
  check_size(kind, "height", o.height);
  check_count(kind, "columns", o.columns, 2);
  check_count(kind, "rows", o.rows, 2);
  check_triangles(kind, (o.columns - 1.0) * (o.rows - 1.0));
  const Vec2 cell(o.width / (o.columns - 1), o.height / (o.rows - 1));
  check_aspect(kind, cell.x(), cell.y());
  const Grid grid{o.columns, o.rows};
  std::vector<Vec2> points;  // (x, -z): counter-clockwise there faces up
  points.reserve(static_cast<std::size_t>(o.columns) * static_cast<std::size_t>(o.rows));
  for (int j = 0; j < o.rows; ++j) {
    for (int i = 0; i < o.columns; ++i)
      points.emplace_back(o.width * i / (o.columns - 1), -o.height * j / (o.rows - 1));
  }
  MeshDocument document;
  Triangles& triangles = document.mesh.triangles;
  if (o.pattern == SheetPattern::Delaunay) {
    check_jitter(kind, o.jitter);
    jitter_grid(grid, cell, o.jitter, o.seed, points);
  }
  triangulate_grid(grid, o.pattern, /*rows_go_up=*/false, points, triangles);
  if (o.pattern == SheetPattern::Delaunay) flip_to_delaunay(points, triangles);
  set_flat_positions(points, o.height, document);

  const int last_row = o.columns * (o.rows - 1);
  document.vertex_sets["corners"] = {0, o.columns - 1, last_row, last_row + o.columns - 1};
  document.vertex_sets["left"] = every(0, o.columns, o.rows);
  document.vertex_sets["right"] = every(o.columns - 1, o.columns, o.rows);
  document.vertex_sets["bottom"] = every(0, 1, o.columns);
  document.vertex_sets["top"] = every(last_row, 1, o.columns);
  return document;
}

MeshDocument generate_tube(const GeneratorOptions& o) {
  const GeneratorKind kind = GeneratorKind::Tube;
  check_size(kind, "radius", o.radius);
  check_size(kind, "height", o.height);
  check_count(kind, "columns", o.columns, 3);
  check_count(kind, "rows", o.rows, 2);
  check_triangles(kind, 1.0 * o.columns * (o.rows - 1.0));
  // Cells are flat, so that the unrolled tube has the very lengths of the mesh.
  const double cell_x = 2 * o.radius * std::sin(std::numbers::pi / o.columns);
  check_aspect(kind, cell_x, o.height / (o.rows - 1));
  MeshDocument document;
  document.mesh.positions.resize(static_cast<Eigen::Index>(o.columns) * o.rows, 3);
  for (int j = 0; j < o.rows; ++j) {
    for (int i = 0; i < o.columns; ++i) {
      const double angle = 2 * std::numbers::pi * i / o.columns;
      document.mesh.positions.row(static_cast<Eigen::Index>(j) * o.columns + i)
          << o.radius * std::cos(angle),
          o.height * j / (o.rows - 1), -o.radius * std::sin(angle);
    }
  }
  // Cut open along the first column, the tube is a grid with one column more.
  const Grid unrolled{o.columns + 1, o.rows};
  Triangles flat;
  triangulate_grid(unrolled, SheetPattern::Alternating, /*rows_go_up=*/true, {}, flat);
  for (const Triangle& t : flat) {
    Triangle& triangle = document.mesh.triangles.emplace_back();
    for (int k = 0; k < 3; ++k) {
      const int column = t[k] % unrolled.columns;
      const int row = t[k] / unrolled.columns;
      triangle[k] = row * o.columns + column % o.columns;
      document.corner_uv.emplace_back(cell_x * column, o.height * row / (o.rows - 1));
    }
  }
  document.vertex_sets["bottom"] = every(0, 1, o.columns);
  document.vertex_sets["top"] = every(o.columns * (o.rows - 1), 1, o.columns);
  return document;
}

/// Fewest points of a ring of radius 1 + 1 / `inner` so that its chords stay outside the ring of
/// radius 1, with a margin of 30 %.
int fewest_ring_points(int inner) {
  if (inner == 0) return 3;
  const double half_chord = std::acos(inner / (inner + 1.0));
  return std::max(3, static_cast<int>(std::ceil(1.3 * std::numbers::pi / half_chord)));
}

MeshDocument generate_disc(const GeneratorOptions& o) {
  const GeneratorKind kind = GeneratorKind::Disc;
  check_size(kind, "radius", o.radius);
  check_count(kind, "rows", o.rows, 1);
  check_count(kind, "columns", o.columns, 3);
  check_triangles(kind, 1.0 * o.columns * o.rows);
  if (o.columns < fewest_ring_points(o.rows - 1))
    fail(kind, "columns",
         fmt::format("{} points around the rim are too few for {} rings; give at least {} (about 6 "
                     "per ring for even triangles)",
                     o.columns, o.rows, fewest_ring_points(o.rows - 1)));
  check_aspect(kind, 2 * o.radius * std::sin(std::numbers::pi / o.columns), o.radius / o.rows);
  std::vector<Vec2> points{Vec2::Zero()};
  MeshDocument document;
  Triangles& triangles = document.mesh.triangles;
  std::vector<LoopVertex> inner;
  for (int ring = 1; ring <= o.rows; ++ring) {
    const double radius = o.radius * ring / o.rows;
    const int even = static_cast<int>(std::lround(1.0 * o.columns * ring / o.rows));
    const int count = std::max(even, fewest_ring_points(ring - 1));
    std::vector<LoopVertex> outer;
    for (int i = 0; i < count; ++i) {
      const double turn = 1.0 * i / count;
      const double angle = 2 * std::numbers::pi * turn;
      outer.push_back({static_cast<int>(points.size()), turn});
      points.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
    }
    if (ring == 1) {
      for (int i = 0; i < count; ++i)
        triangles.push_back({0, outer[i].vertex, outer[(i + 1) % count].vertex});
    } else {
      stitch_loops(outer, inner, triangles);
    }
    inner = std::move(outer);
  }
  flip_to_delaunay(points, triangles);
  set_flat_positions(points, 0, document);
  document.vertex_sets["center"] = {0};
  return document;
}

MeshDocument generate_quilt_document(const GeneratorOptions& o) {
  const GeneratorKind kind = GeneratorKind::Quilt;
  check_size(kind, "width", o.width);
  check_size(kind, "height", o.height);
  check_count(kind, "patches_x", o.patches_x, 1);
  check_count(kind, "patches_y", o.patches_y, 1);
  constexpr int kMostPatches = 1000;
  if (o.patches_x > kMostPatches || o.patches_y > kMostPatches)
    fail(kind, "patches_x and patches_y", fmt::format("give at most {} each", kMostPatches));
  check_count(kind, "columns", o.columns, kMinPatchCells * o.patches_x + 1);
  check_count(kind, "rows", o.rows, kMinPatchCells * o.patches_y + 1);
  check_triangles(kind, kMaxQuiltDensity * kMaxQuiltDensity * o.columns * o.rows);
  check_aspect(kind, o.width / (o.columns - 1), o.height / (o.rows - 1));
  check_jitter(kind, o.jitter);
  return generate_quilt(o);
}

MeshDocument body(TriangleMesh mesh) {
  MeshDocument document;
  document.mesh = std::move(mesh);
  return document;
}

MeshDocument generate_round_body(GeneratorKind kind, const GeneratorOptions& o) {
  check_size(kind, "radius", o.radius);
  if (kind == GeneratorKind::Icosphere) {
    check_count(kind, "rows", o.rows, 1);
    check_triangles(kind, 10.0 * o.rows * o.rows);
    return body(icosphere(o.radius, o.rows));
  }
  constexpr int kFewestColumns = 8;
  check_count(kind, "columns", o.columns, kFewestColumns);
  check_triangles(kind, 3.0 * o.columns * o.columns);
  if (kind == GeneratorKind::Pot) return body(pot(o.radius, o.columns));
  check_size(kind, "height", o.height);
  check_aspect(kind, o.radius, o.height);
  return body(funnel(o.radius, o.height, o.columns));
}

MeshDocument generate_block(GeneratorKind kind, const GeneratorOptions& o) {
  check_size(kind, "width", o.width);
  check_size(kind, "height", o.height);
  check_size(kind, "depth", o.depth);
  const Vec3 size(o.width, o.height, o.depth);
  if (kind == GeneratorKind::Box) {
    MeshDocument document = body(box(size));
    document.mesh.positions.col(1).array() += 0.5 * o.height;
    return document;
  }
  check_count(kind, "rows", o.rows, 1);
  check_triangles(kind, 6.0 * o.rows);
  return body(stairs(size, o.rows));
}

MeshDocument generate_kind(GeneratorKind kind, const GeneratorOptions& options) {
  switch (kind) {
    case GeneratorKind::Sheet:
    case GeneratorKind::Strip:
      return generate_sheet(kind, options);
    case GeneratorKind::Tube:
      return generate_tube(options);
    case GeneratorKind::Disc:
      return generate_disc(options);
    case GeneratorKind::Icosphere:
    case GeneratorKind::Funnel:
    case GeneratorKind::Pot:
      return generate_round_body(kind, options);
    case GeneratorKind::Box:
    case GeneratorKind::Stairs:
      return generate_block(kind, options);
    case GeneratorKind::Quilt:
      break;
  }
  return generate_quilt_document(options);
}

}  // namespace

void set_flat_positions(const std::vector<Vec2>& points, double offset, MeshDocument& document) {
  document.mesh.positions.resize(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t v = 0; v < points.size(); ++v) {
    // 0.0 - y rather than -y: no negative zeros in the user's files.
    document.mesh.positions.row(static_cast<Eigen::Index>(v)) << points[v].x(), 0.0,
        0.0 - points[v].y();
  }
  document.corner_uv.reserve(3 * document.mesh.triangles.size());
  for (const Triangle& t : document.mesh.triangles) {
    for (int v : t) document.corner_uv.push_back(points[v] + Vec2(0, offset));
  }
}

MeshDocument generate(GeneratorKind kind, const GeneratorOptions& options) {
  MeshDocument document = generate_kind(kind, options);
  document.vertex_sets["border"] = border_vertices(find_edges(document.mesh.triangles));
  return document;
}

const char* to_string(GeneratorKind kind) {
  switch (kind) {
    case GeneratorKind::Sheet:
      return "sheet";
    case GeneratorKind::Strip:
      return "strip";
    case GeneratorKind::Tube:
      return "tube";
    case GeneratorKind::Disc:
      return "disc";
    case GeneratorKind::Icosphere:
      return "icosphere";
    case GeneratorKind::Box:
      return "box";
    case GeneratorKind::Stairs:
      return "stairs";
    case GeneratorKind::Funnel:
      return "funnel";
    case GeneratorKind::Pot:
      return "pot";
    case GeneratorKind::Quilt:
      break;
  }
  return "quilt";
}

const char* to_string(SheetPattern pattern) {
  switch (pattern) {
    case SheetPattern::Alternating:
      return "alternating";
    case SheetPattern::OneDiagonal:
      return "one_diagonal";
    case SheetPattern::Delaunay:
      break;
  }
  return "delaunay";
}

}  // namespace piecework::mesh
