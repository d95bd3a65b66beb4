#include <piecework/mesh/topology.hpp>

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <tuple>

#include <piecework/core/error.hpp>

namespace piecework::mesh {
namespace {

int max_index(const Triangles& triangles) {
  int largest = -1;
  for (const Triangle& t : triangles) largest = std::max({largest, t[0], t[1], t[2]});
  return largest;
}

/// Turns counts stored at [r + 1] into the offsets of compressed rows.
void counts_to_offsets(std::vector<int>& begin) {
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
}

int opposite_vertex(const Triangle& triangle, const Edge& edge) {
  for (int v : triangle) {
    if (v != edge.vertices[0] && v != edge.vertices[1]) return v;
  }
  PIECEWORK_ASSERT(false);
  return -1;
}

/// Root of `item` in a union-find forest, halving the path on the way.
int find_root(std::vector<int>& parent, int item) {
  while (parent[item] != item) {
    parent[item] = parent[parent[item]];
    item = parent[item];
  }
  return item;
}

/// Makes the smaller root the root of both.
void unite(std::vector<int>& parent, int a, int b) {
  a = find_root(parent, a);
  b = find_root(parent, b);
  parent[std::max(a, b)] = std::min(a, b);
}

/// Corner number (3 per triangle) of `vertex` in triangle `t`.
int corner_of(const Triangles& triangles, int t, int vertex) {
  for (int k = 0; k < 2; ++k) {
    if (triangles[t][k] == vertex) return 3 * t + k;
  }
  return 3 * t + 2;
}

/// Renumbers a union-find forest to 0, 1, ... by first member. Returns the number of sets.
int number_sets(std::vector<int>& parent, std::vector<int>& number) {
  number.resize(parent.size());
  int count = 0;
  for (int i = 0; i < static_cast<int>(parent.size()); ++i) {
    const int root = find_root(parent, i);
    number[i] = root == i ? count++ : number[root];
  }
  return count;
}

}  // namespace

std::vector<HalfEdge> sorted_half_edges(const Triangles& triangles) {
  // Buckets by v0 first: the rows are short, so this is several times faster than one big sort.
  std::vector<int> begin(static_cast<std::size_t>(max_index(triangles)) + 2, 0);
  for (const Triangle& t : triangles) {
    for (int k = 0; k < 3; ++k) ++begin[std::min(t[k], t[(k + 1) % 3]) + 1];
  }
  counts_to_offsets(begin);
  std::vector<HalfEdge> sides(3 * triangles.size());
  std::vector<int> next(begin.begin(), begin.end() - 1);
  for (int i = 0; i < static_cast<int>(triangles.size()); ++i) {
    const Triangle& t = triangles[i];
    for (int k = 0; k < 3; ++k) {
      const int from = t[k];
      const int to = t[(k + 1) % 3];
      sides[next[std::min(from, to)]++] = {std::min(from, to), std::max(from, to), i, from < to};
    }
  }
  for (std::size_t row = 0; row + 1 < begin.size(); ++row) {
    std::sort(sides.begin() + begin[row], sides.begin() + begin[row + 1],
              [](const HalfEdge& a, const HalfEdge& b) {
                return std::tie(a.v1, a.triangle, b.forward) <
                       std::tie(b.v1, b.triangle, a.forward);
              });
  }
  return sides;
}

std::vector<Edge> find_edges(const Triangles& triangles) {
  const std::vector<HalfEdge> sides = sorted_half_edges(triangles);
  std::vector<Edge> edges;
  edges.reserve(sides.size() / 2 + 1);
  for (std::size_t i = 0; i < sides.size();) {
    const HalfEdge& side = sides[i];
    const bool shared =
        i + 1 < sides.size() && sides[i + 1].v0 == side.v0 && sides[i + 1].v1 == side.v1;
    edges.push_back({{side.v0, side.v1}, {side.triangle, shared ? sides[i + 1].triangle : -1}});
    i += shared ? 2 : 1;
  }
  return edges;
}

std::vector<Hinge> find_hinges(const Triangles& triangles, const std::vector<Edge>& edges) {
  std::vector<Hinge> hinges;
  hinges.reserve(edges.size());
  for (const Edge& edge : edges) {
    if (edge.triangles[1] < 0) continue;
    hinges.push_back(
        {{edge.vertices[0], edge.vertices[1], opposite_vertex(triangles[edge.triangles[0]], edge),
          opposite_vertex(triangles[edge.triangles[1]], edge)},
         edge.triangles});
  }
  return hinges;
}

int edge_components(const Triangles& triangles, const std::vector<Edge>& edges,
                    std::vector<int>& component) {
  std::vector<int> parent(triangles.size());
  std::iota(parent.begin(), parent.end(), 0);
  for (const Edge& edge : edges) {
    if (edge.triangles[1] >= 0) unite(parent, edge.triangles[0], edge.triangles[1]);
  }
  return number_sets(parent, component);
}

std::vector<int> border_vertices(const std::vector<Edge>& edges) {
  std::vector<int> border;
  for (const Edge& edge : edges) {
    if (edge.triangles[1] < 0)
      border.insert(border.end(), edge.vertices.begin(), edge.vertices.end());
  }
  std::sort(border.begin(), border.end());
  border.erase(std::unique(border.begin(), border.end()), border.end());
  return border;
}

std::vector<int> corner_fans(const Triangles& triangles, const std::vector<HalfEdge>& sides) {
  std::vector<int> parent(3 * triangles.size());
  std::iota(parent.begin(), parent.end(), 0);
  for (std::size_t i = 1; i < sides.size(); ++i) {
    const HalfEdge& a = sides[i - 1];
    const HalfEdge& b = sides[i];
    if (a.v0 != b.v0 || a.v1 != b.v1) continue;
    for (int vertex : {a.v0, a.v1})
      unite(parent, corner_of(triangles, a.triangle, vertex),
            corner_of(triangles, b.triangle, vertex));
  }
  std::vector<int> fan;
  number_sets(parent, fan);
  return fan;
}

Adjacency vertex_triangles(const Triangles& triangles, int num_vertices) {
  Adjacency adjacency;
  adjacency.begin.assign(static_cast<std::size_t>(num_vertices) + 1, 0);
  for (const Triangle& t : triangles) {
    for (int v : t) ++adjacency.begin[v + 1];
  }
  counts_to_offsets(adjacency.begin);
  adjacency.item.resize(3 * triangles.size());
  std::vector<int> next(adjacency.begin.begin(), adjacency.begin.end() - 1);
  for (int i = 0; i < static_cast<int>(triangles.size()); ++i) {
    for (int v : triangles[i]) adjacency.item[next[v]++] = i;
  }
  return adjacency;
}

}  // namespace piecework::mesh
