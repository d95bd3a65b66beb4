#include <piecework/mesh/checks.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include <piecework/core/error.hpp>
#include <piecework/mesh/import.hpp>
#include <piecework/mesh/topology.hpp>

namespace piecework::mesh {
namespace {

Vec3 vertex(const TriangleMesh& mesh, int v) { return mesh.positions.row(v).transpose(); }

double longest_edge_sq(const TriangleMesh& mesh, const Triangle& t) {
  const Vec3 a = vertex(mesh, t[0]);
  const Vec3 b = vertex(mesh, t[1]);
  const Vec3 c = vertex(mesh, t[2]);
  return std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
}

/// Height over longest edge; 0 for a triangle without extent.
double flatness(const TriangleMesh& mesh, const Triangle& t) {
  const Vec3 a = vertex(mesh, t[0]);
  const double double_area = (vertex(mesh, t[1]) - a).cross(vertex(mesh, t[2]) - a).norm();
  const double longest_sq = longest_edge_sq(mesh, t);
  return longest_sq > 0 ? double_area / longest_sq : 0;
}

/// Calls visit(first, last) for the sides of each edge.
template <class Visit>
void for_each_edge(const std::vector<HalfEdge>& sides, const Visit& visit) {
  for (std::size_t first = 0; first < sides.size();) {
    std::size_t last = first + 1;
    while (last < sides.size() && sides[last].v0 == sides[first].v0 &&
           sides[last].v1 == sides[first].v1)
      ++last;
    visit(first, last);
    first = last;
  }
}

EdgeUse edge_use(const std::vector<HalfEdge>& sides, std::size_t first, std::size_t last) {
  EdgeUse use{sides[first].v0, sides[first].v1, {}};
  for (std::size_t i = first; i < last; ++i) use.triangles.push_back(sides[i].triangle);
  return use;
}

[[noreturn]] void fail(const ItemNames& names, const std::string& item, const std::string& problem,
                       std::size_t count, const char* remedy) {
  const std::string more = count > 1 ? fmt::format(" (and {} more)", count - 1) : "";
  throw InputError(fmt::format("{}: {}: {}{}; {}", names.mesh, item, problem, more, remedy));
}

void check_areas(const TriangleMesh& mesh, const ItemNames& names) {
  const std::vector<int> flat = zero_area_triangles(mesh);
  if (!flat.empty()) {
    const Triangle& t = mesh.triangles[flat.front()];
    fail(names, names.triangle(flat.front()),
         fmt::format("zero area (height is {:.2g} of the longest edge, {:.3g} m)",
                     flatness(mesh, t), std::sqrt(longest_edge_sq(mesh, t))),
         flat.size(), "remove the triangle, or set `repair: true`");
  }
  for (int t = 0; t < mesh.num_triangles(); ++t) {
    const double steps = edge_steps(mesh, t);
    if (steps < kMinEdgeSteps)
      fail(names, names.triangle(t),
           fmt::format("so far from the origin that its longest edge is only {:.2g} rounding steps "
                       "of its coordinates",
                       steps),
           1, "move the mesh to the origin");
  }
}

std::string edge_text(const EdgeUse& edge, const ItemNames& names) {
  return fmt::format("edge from {} to {}", names.vertex(edge.v0), names.vertex(edge.v1));
}

std::string triangle_list(const EdgeUse& edge, const ItemNames& names) {
  std::string text;
  for (std::size_t i = 0; i < edge.triangles.size(); ++i) {
    const bool last = i + 1 == edge.triangles.size();
    text += (i == 0 ? "" : last ? " and " : ", ") + names.triangle(edge.triangles[i]);
  }
  return text;
}

void check_edges(const TriangleMesh& mesh, const ItemNames& names) {
  const std::vector<EdgeUse> crowded = crowded_edges(mesh.triangles);
  if (!crowded.empty())
    fail(names, edge_text(crowded.front(), names),
         fmt::format("more than two triangles on it: {}", triangle_list(crowded.front(), names)),
         crowded.size(),
         "separate the sheets that meet there, or set `repair: true` to drop triangles (layers at "
         "the same place that should stay apart: `weld: false`)");
  const std::vector<EdgeUse> clashing = clashing_edges(mesh.triangles);
  if (!clashing.empty())
    fail(names, edge_text(clashing.front(), names),
         fmt::format("inconsistent orientation, {} run through it in the same direction",
                     triangle_list(clashing.front(), names)),
         clashing.size(),
         "turn one of them, or set `repair: true` (layers at the same place that should stay "
         "apart: `weld: false`)");
}

}  // namespace

double edge_steps(const TriangleMesh& mesh, int triangle) {
  const Triangle& t = mesh.triangles[triangle];
  double largest = 0;
  for (int v : t) largest = std::max(largest, mesh.positions.row(v).cwiseAbs().maxCoeff());
  if (largest == 0) return 0;
  return std::sqrt(longest_edge_sq(mesh, t)) / (largest * std::numeric_limits<double>::epsilon());
}

std::vector<int> zero_area_triangles(const TriangleMesh& mesh) {
  std::vector<int> flat;
  for (int i = 0; i < mesh.num_triangles(); ++i) {
    const Triangle& t = mesh.triangles[i];
    const bool repeated = t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
    if (repeated || !(flatness(mesh, t) > kMinFlatness)) flat.push_back(i);
  }
  return flat;
}

std::vector<int> duplicate_triangles(const Triangles& triangles) {
  Triangles sorted = triangles;
  for (Triangle& t : sorted) std::sort(t.begin(), t.end());
  std::vector<int> order(triangles.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](int a, int b) { return sorted[a] != sorted[b] ? sorted[a] < sorted[b] : a < b; });
  std::vector<int> duplicates;
  for (std::size_t i = 1; i < order.size(); ++i) {
    if (sorted[order[i]] == sorted[order[i - 1]]) duplicates.push_back(order[i]);
  }
  std::sort(duplicates.begin(), duplicates.end());
  return duplicates;
}

std::vector<EdgeUse> crowded_edges(const Triangles& triangles) {
  const std::vector<HalfEdge> sides = sorted_half_edges(triangles);
  std::vector<EdgeUse> crowded;
  for_each_edge(sides, [&](std::size_t first, std::size_t last) {
    if (last - first > 2) crowded.push_back(edge_use(sides, first, last));
  });
  return crowded;
}

std::vector<EdgeUse> clashing_edges(const Triangles& triangles) {
  const std::vector<HalfEdge> sides = sorted_half_edges(triangles);
  std::vector<EdgeUse> clashing;
  for_each_edge(sides, [&](std::size_t first, std::size_t last) {
    if (last - first == 2 && sides[first].forward == sides[first + 1].forward)
      clashing.push_back(edge_use(sides, first, last));
  });
  return clashing;
}

std::vector<int> pinched_vertices(const Triangles& triangles, int num_vertices) {
  const std::vector<int> fan = corner_fans(triangles, sorted_half_edges(triangles));
  std::vector<int> vertex_fan(static_cast<std::size_t>(num_vertices), -1);
  std::vector<int> pinched;
  for (std::size_t corner = 0; corner < fan.size(); ++corner) {
    int& known = vertex_fan[triangles[corner / 3][corner % 3]];
    if (known < 0) known = fan[corner];
    if (known != fan[corner]) pinched.push_back(triangles[corner / 3][corner % 3]);
  }
  std::sort(pinched.begin(), pinched.end());
  pinched.erase(std::unique(pinched.begin(), pinched.end()), pinched.end());
  return pinched;
}

std::vector<int> isolated_vertices(const Triangles& triangles, int num_vertices) {
  std::vector<bool> used(static_cast<std::size_t>(num_vertices), false);
  for (const Triangle& t : triangles) {
    for (int v : t) used[v] = true;
  }
  std::vector<int> isolated;
  for (int v = 0; v < num_vertices; ++v) {
    if (!used[v]) isolated.push_back(v);
  }
  return isolated;
}

void check_coordinates(const Positions& positions, const ItemNames& names) {
  std::size_t bad = 0;
  int first = -1;
  for (int v = 0; v < static_cast<int>(positions.rows()); ++v) {
    if (positions.row(v).cwiseAbs().maxCoeff() <= kMaxCoordinate && positions.row(v).allFinite())
      continue;
    if (bad++ == 0) first = v;
  }
  if (bad == 0) return;
  const auto x = positions.row(first);
  const std::string values = fmt::format("({:g}, {:g}, {:g})", x(0), x(1), x(2));
  if (!x.allFinite())
    fail(names, names.vertex(first), fmt::format("position {} is not finite", values), bad,
         "correct or re-export the file");
  fail(names, names.vertex(first),
       fmt::format("position {} m is more than {:g} m from the origin", values, kMaxCoordinate),
       bad, "correct it, or set `units` to the length of the file's unit in metres");
}

void check_surface(const TriangleMesh& mesh, const ItemNames& names) {
  if (mesh.triangles.empty())
    throw InputError(fmt::format("{}: no triangles; give a mesh with faces", names.mesh));
  check_areas(mesh, names);
  const std::vector<int> duplicates = duplicate_triangles(mesh.triangles);
  if (!duplicates.empty())
    fail(names, names.triangle(duplicates.front()),
         "duplicate, an earlier triangle has the same vertices", duplicates.size(),
         "remove it, or set `repair: true` (layers at the same place that should stay apart: "
         "`weld: false`)");
  check_edges(mesh, names);
  const std::vector<int> pinched = pinched_vertices(mesh.triangles, mesh.num_vertices());
  if (!pinched.empty())
    fail(names, names.vertex(pinched.front()),
         "bow-tie, its triangles do not hang together in one fan", pinched.size(),
         "give each fan its own vertex, or set `repair: true`");
  const std::vector<int> isolated = isolated_vertices(mesh.triangles, mesh.num_vertices());
  if (!isolated.empty())
    fail(names, names.vertex(isolated.front()), "isolated, no face uses it", isolated.size(),
         "remove it, or set `repair: true`");
}

void validate(const TriangleMesh& mesh, const std::string& name) {
  const ItemNames names{name, [](int v) { return fmt::format("vertex {}", v); },
                        [&](int t) {
                          const Triangle& v = mesh.triangles[t];
                          return fmt::format("triangle {} ({}, {}, {})", t, v[0], v[1], v[2]);
                        }};
  for (int t = 0; t < mesh.num_triangles(); ++t) {
    for (int v : mesh.triangles[t]) {
      if (v < 0 || v >= mesh.num_vertices())
        fail(names, names.triangle(t),
             fmt::format("vertex index {} is out of range, there are {} vertices", v,
                         mesh.num_vertices()),
             1, "correct the mesh");
    }
  }
  check_coordinates(mesh.positions, names);
  check_surface(mesh, names);
}

}  // namespace piecework::mesh
