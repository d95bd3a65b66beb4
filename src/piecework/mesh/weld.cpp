#include <algorithm>
#include <array>
#include <cstddef>
#include <numeric>
#include <string_view>
#include <tuple>
#include <unordered_map>

#include <piecework/mesh/polygon.hpp>
#include <piecework/mesh/topology.hpp>
#include <piecework/mesh/work_mesh.hpp>

namespace piecework::mesh {
namespace {

class DisjointSets {
 public:
  explicit DisjointSets(int count) : parent_(static_cast<std::size_t>(count)) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }
  int find(int item) {
    while (parent_[item] != item) {
      parent_[item] = parent_[parent_[item]];
      item = parent_[item];
    }
    return item;
  }
  void unite(int a, int b) {
    a = find(a);
    b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<int> parent_;
};

/// Group number of each polygon; groups of one name are one group.
std::vector<int> polygon_groups(const RawMesh& raw) {
  std::vector<int> group(static_cast<std::size_t>(raw.num_polygons()), -1);
  std::unordered_map<std::string_view, int> numbers;
  const auto& groups = raw.layout.groups;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const int number = numbers.try_emplace(groups[g].name, static_cast<int>(g)).first->second;
    const int last = g + 1 < groups.size() ? groups[g + 1].first_polygon : raw.num_polygons();
    std::fill(group.begin() + groups[g].first_polygon, group.begin() + last, number);
  }
  return group;
}

/// Vertices that weld() may merge.
std::vector<bool> weldable_vertices(const WorkMesh& work, const std::vector<HalfEdge>& sides) {
  const Positions& x = work.mesh.positions;
  std::vector<bool> weldable(static_cast<std::size_t>(work.mesh.num_vertices()), false);
  for (std::size_t i = 0; i < sides.size(); ++i) {
    const auto same_edge = [&](std::size_t j) {
      return j < sides.size() && sides[j].v0 == sides[i].v0 && sides[j].v1 == sides[i].v1;
    };
    const bool border = !same_edge(i + 1) && !(i > 0 && same_edge(i - 1));
    if (border || x.row(sides[i].v0) == x.row(sides[i].v1))
      weldable[sides[i].v0] = weldable[sides[i].v1] = true;
  }
  return weldable;
}

struct WeldCandidate {
  std::array<double, 3> position;
  int group;
  int vertex;
  [[nodiscard]] auto place() const { return std::tie(position, group); }
};

/// Weldable vertices of each group, sorted by place.
std::vector<WeldCandidate> weld_candidates(const RawMesh& raw, const WorkMesh& work,
                                           const std::vector<bool>& weldable) {
  const std::vector<int> group = polygon_groups(raw);
  std::vector<WeldCandidate> candidates;
  for (int t = 0; t < work.mesh.num_triangles(); ++t) {
    for (int v : work.mesh.triangles[t]) {
      if (!weldable[v]) continue;
      const auto x = work.mesh.positions.row(v);
      candidates.push_back({{x(0), x(1), x(2)}, group[work.triangle_polygon[t]], v});
    }
  }
  std::sort(candidates.begin(), candidates.end(), [](const auto& a, const auto& b) {
    return std::tie(a.position, a.group, a.vertex) < std::tie(b.position, b.group, b.vertex);
  });
  return candidates;
}

Triangles with_roots(const Triangles& triangles, DisjointSets& sets) {
  Triangles result = triangles;
  for (Triangle& t : result) {
    for (int& v : t) v = sets.find(v);
  }
  return result;
}

/// Moves the mesh to one vertex per set.
void merge_sets(WorkMesh& work, DisjointSets& sets) {
  const int num_vertices = work.mesh.num_vertices();
  std::vector<int> number(static_cast<std::size_t>(num_vertices));
  int count = 0;
  for (int v = 0; v < num_vertices; ++v) {
    const int root = sets.find(v);
    number[v] = root == v ? count++ : number[root];
    if (root == v) work.mesh.positions.row(number[v]) = work.mesh.positions.row(v).eval();
  }
  work.mesh.positions.conservativeResize(count, 3);
  for (Triangle& t : work.mesh.triangles) {
    for (int& v : t) v = number[v];
  }
  for (int& v : work.vertex_map) v = number[v];
}

}  // namespace

WorkMesh triangulate(const RawMesh& raw) {
  const FileLayout& layout = raw.layout;
  WorkMesh work;
  work.mesh.positions.resize(static_cast<Eigen::Index>(raw.positions.size()), 3);
  for (std::size_t v = 0; v < raw.positions.size(); ++v)
    work.mesh.positions.row(static_cast<Eigen::Index>(v)) = raw.positions[v].transpose();
  work.vertex_map.resize(raw.positions.size());
  std::iota(work.vertex_map.begin(), work.vertex_map.end(), 0);
  const bool all_have_uv =
      !layout.polygon_uv.empty() &&
      std::none_of(layout.polygon_uv.begin(), layout.polygon_uv.end(), [](int i) { return i < 0; });
  std::vector<Vec3> corners;
  Triangles pieces;
  for (int polygon = 0; polygon < raw.num_polygons(); ++polygon) {
    const int begin = layout.polygon_begin[polygon];
    corners.clear();
    for (int c = begin; c < layout.polygon_begin[polygon + 1]; ++c)
      corners.push_back(raw.positions[layout.polygon_vertex[c]]);
    pieces.clear();
    triangulate_polygon(corners, pieces);
    for (const Triangle& piece : pieces) {
      Triangle& triangle = work.mesh.triangles.emplace_back();
      for (int k = 0; k < 3; ++k) {
        triangle[k] = layout.polygon_vertex[begin + piece[k]];
        if (all_have_uv) work.corner_uv.push_back(layout.uv[layout.polygon_uv[begin + piece[k]]]);
      }
      work.triangle_polygon.push_back(polygon);
    }
  }
  return work;
}

int weld(const RawMesh& raw, WorkMesh& work) {
  const Triangles& triangles = work.mesh.triangles;
  const std::vector<WeldCandidate> candidates =
      weld_candidates(raw, work, weldable_vertices(work, sorted_half_edges(triangles)));
  DisjointSets places(work.mesh.num_vertices());
  for (std::size_t i = 1; i < candidates.size(); ++i) {
    if (candidates[i - 1].place() == candidates[i].place())
      places.unite(candidates[i - 1].vertex, candidates[i].vertex);
  }
  // Of the vertices at one place, only those that share a fan become one.
  const Triangles placed = with_roots(triangles, places);
  const std::vector<int> fan = corner_fans(placed, sorted_half_edges(placed));
  std::vector<int> fan_vertex(fan.size(), -1);
  DisjointSets merged(work.mesh.num_vertices());
  for (std::size_t corner = 0; corner < fan.size(); ++corner) {
    const int vertex = triangles[corner / 3][corner % 3];
    if (fan_vertex[fan[corner]] < 0) fan_vertex[fan[corner]] = vertex;
    merged.unite(fan_vertex[fan[corner]], vertex);
  }
  const int before = work.mesh.num_vertices();
  merge_sets(work, merged);
  return before - work.mesh.num_vertices();
}

}  // namespace piecework::mesh
