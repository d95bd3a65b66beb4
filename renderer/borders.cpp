#include <renderer/borders.hpp>

#include <algorithm>
#include <cstdint>

#include <piecework/core/parallel.hpp>

namespace piecework::render {
namespace {

struct Touch {
  int triangle, edge;
};

class BorderFinder {
 public:
  BorderFinder(const DisplayMesh& mesh, std::span<const int> triangle_domain, float reach)
      : mesh_(mesh),
        domain_(triangle_domain),
        reach_(reach),
        adjacency_(build_adjacency(mesh.cloth(), mesh.positions.size())) {}

  Borders run() {
    find_mixed_vertices();
    find_edges();
    find_touched_triangles();
    arrange_by_triangle();
    return std::move(result_);
  }

 private:
  int domain_of(int triangle) const { return domain_[mesh_.source[triangle]]; }

  void find_mixed_vertices() {
    mixed_.resize(mesh_.positions.size());
    parallel_for(mixed_.size(), [&](std::size_t v) {
      const std::span<const int> around = adjacency_.around(static_cast<int>(v));
      mixed_[v] = std::any_of(around.begin(), around.end(),
                              [&](int t) { return domain_of(t) != domain_of(around.front()); });
    });
  }

  void find_edges() {
    for (std::size_t t = 0; t < mesh_.cloth().size(); ++t) {
      const Triangle& v = mesh_.triangles[t];
      for (std::size_t i = 0; i < 3; ++i) {
        const int a = v[i];
        const int b = v[(i + 1) % 3];
        if (mixed_[a] != 0 && mixed_[b] != 0 && is_border(static_cast<int>(t), a, b)) {
          result_.edges.push_back({a, b});
        }
      }
    }
  }

  /// True for the first triangle of an edge whose triangles lie in different domains.
  bool is_border(int triangle, int a, int b) const {
    bool differs = false;
    for (int other : adjacency_.around(a)) {
      const Triangle& v = mesh_.triangles[other];
      if (other == triangle || std::find(v.begin(), v.end(), b) == v.end()) continue;
      if (other < triangle) return false;
      differs = differs || domain_of(other) != domain_of(triangle);
    }
    return differs;
  }

  float distance(const Vec3f& p, const std::array<int, 2>& edge) const {
    const Vec3f& a = mesh_.positions[edge[0]];
    const Vec3f along = mesh_.positions[edge[1]] - a;
    const float length_sq = along.squaredNorm();
    const float t = length_sq > 0 ? std::clamp((p - a).dot(along) / length_sq, 0.0F, 1.0F) : 0.0F;
    return (p - a - t * along).norm();
  }

  /// Walks outwards from each border edge over vertices within reach; at least the triangles
  /// around both ends are touched, so that lines have round joints.
  void find_touched_triangles() {
    seen_triangle_.assign(mesh_.cloth().size(), -1);
    seen_vertex_.assign(mesh_.positions.size(), -1);
    for (std::size_t e = 0; e < result_.edges.size(); ++e) {
      const int edge = static_cast<int>(e);
      todo_.assign(result_.edges[e].begin(), result_.edges[e].end());
      for (int v : todo_) seen_vertex_[v] = edge;
      while (!todo_.empty()) {
        const int vertex = todo_.back();
        todo_.pop_back();
        for (int t : adjacency_.around(vertex)) touch(t, edge);
      }
    }
  }

  /// Notes a triangle for an edge, once, and goes on to its vertices within reach.
  void touch(int triangle, int edge) {
    if (seen_triangle_[triangle] == edge) return;
    seen_triangle_[triangle] = edge;
    touches_.push_back({triangle, edge});
    for (int v : mesh_.triangles[triangle]) {
      if (seen_vertex_[v] == edge) continue;
      seen_vertex_[v] = edge;
      if (distance(mesh_.positions[v], result_.edges[edge]) < reach_) todo_.push_back(v);
    }
  }

  void arrange_by_triangle() {
    std::sort(touches_.begin(), touches_.end(), [](const Touch& x, const Touch& y) {
      return x.triangle != y.triangle ? x.triangle < y.triangle : x.edge < y.edge;
    });
    result_.segments.reserve(touches_.size());
    for (const Touch& touch : touches_) {
      if (result_.triangles.empty() || result_.triangles.back() != touch.triangle) {
        result_.triangles.push_back(touch.triangle);
        result_.ranges.push_back({static_cast<int>(result_.segments.size()), 0});
      }
      ++result_.ranges.back()[1];
      const Vec3f& a = mesh_.positions[result_.edges[touch.edge][0]];
      const Vec3f& b = mesh_.positions[result_.edges[touch.edge][1]];
      result_.segments.push_back({{a.x(), a.y(), a.z()}, 0, {b.x(), b.y(), b.z()}, 0});
    }
  }

  const DisplayMesh& mesh_;
  std::span<const int> domain_;
  float reach_;
  Adjacency adjacency_;
  std::vector<std::uint8_t> mixed_;
  std::vector<Touch> touches_;
  std::vector<int> seen_triangle_, seen_vertex_;  // the last edge that saw them
  std::vector<int> todo_;                         // vertices to go on from
  Borders result_;
};

}  // namespace

Borders find_borders(const DisplayMesh& mesh, std::span<const int> triangle_domain, float reach) {
  if (mesh.cloth().empty()) return {};
  return BorderFinder(mesh, triangle_domain, reach).run();
}

}  // namespace piecework::render
