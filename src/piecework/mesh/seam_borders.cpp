// Borders that lie side by side: sewing by proximity, and triangles that face each other.

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include <piecework/core/parallel.hpp>
#include <piecework/mesh/seams.hpp>
#include <piecework/mesh/topology.hpp>

namespace piecework::mesh {
namespace {

using Edges = std::vector<std::array<int, 2>>;

std::size_t at(int index) { return static_cast<std::size_t>(index); }

/// The nearest edge to a vertex: x_vertex is about (1 - ratio) x_a + ratio x_b.
struct Hit {
  int vertex = 0;
  int a = 0;
  int b = 0;
  double ratio = 0;
  double distance = std::numeric_limits<double>::infinity();
};

/// A vertex's own edges, and ends of edges at its own neighbours, are no place to be sewn to.
Hit nearest_edge(const Positions& x, int vertex, const Edges& edges) {
  Hit best{.vertex = vertex};
  std::vector<int> neighbors;
  for (const auto& [a, b] : edges)
    if (a == vertex || b == vertex) neighbors.push_back(a == vertex ? b : a);
  const auto is_neighbor = [&](int v) {
    return std::find(neighbors.begin(), neighbors.end(), v) != neighbors.end();
  };
  const Vec3 p = x.row(vertex).transpose();
  for (const auto& [a, b] : edges) {
    if (a == vertex || b == vertex) continue;
    const Vec3 from = x.row(a).transpose();
    const Vec3 along = x.row(b).transpose() - from;
    const double ratio = std::clamp((p - from).dot(along) / along.squaredNorm(), 0.0, 1.0);
    if ((ratio == 0 && is_neighbor(a)) || (ratio == 1 && is_neighbor(b))) continue;
    const double distance = (p - from - ratio * along).norm();
    if (distance < best.distance) best = {vertex, a, b, ratio, distance};
  }
  return best;
}

std::vector<int> ends_of(const Edges& edges) {
  std::vector<int> vertices;
  for (const auto& edge : edges) vertices.insert(vertices.end(), edge.begin(), edge.end());
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  return vertices;
}

/// What the border vertices of `own` find on the edges of `other`. O(|own| |other|).
void add_hits(const Positions& x, const Edges& own, const Edges& other, double distance,
              std::vector<Hit>& hits) {
  const std::vector<int> vertices = ends_of(own);
  std::vector<Hit> found(vertices.size());
  parallel_for(
      vertices.size(), [&](std::size_t i) { found[i] = nearest_edge(x, vertices[i], other); }, 16);
  std::copy_if(found.begin(), found.end(), std::back_inserter(hits),
               [&](const Hit& hit) { return hit.distance <= distance; });
}

/// Run of every vertex: border vertices that found something and hang together through border
/// edges; -1 for the others.
std::vector<int> runs_of(const std::vector<Hit>& hits, const Edges& first, const Edges& second,
                         std::size_t num_vertices) {
  std::vector<int> run(num_vertices, -1);
  for (const Hit& hit : hits) run[at(hit.vertex)] = hit.vertex;
  const auto find = [&](int v) {
    while (run[at(v)] != v) v = run[at(v)];
    return v;
  };
  for (const Edges* edges : {&first, &second})
    for (const auto& [a, b] : *edges) {
      if (run[at(a)] < 0 || run[at(b)] < 0) continue;
      const int u = find(a);
      const int v = find(b);
      run[at(std::max(u, v))] = std::min(u, v);
    }
  std::vector<int> result(num_vertices, -1);
  for (const Hit& hit : hits) result[at(hit.vertex)] = find(hit.vertex);
  return result;
}

/// The free vertices that carry an edge, ascending.
std::vector<int> carriers_of(const SeamMap& seams, const Edge& edge) {
  std::vector<int> all;
  for (const int v : edge.vertices)
    seams.visit_carriers(v, [&](int c, double) { all.push_back(c); });
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  return all;
}

bool has_one_carrier(const SeamMap& seams, int vertex) {
  int count = 0;
  seams.visit_carriers(vertex, [&](int, double) { ++count; });
  return count == 1;
}

bool touches(const Triangle& triangle, const Edge& edge) {
  return std::any_of(triangle.begin(), triangle.end(),
                     [&](int v) { return v == edge.vertices[0] || v == edge.vertices[1]; });
}

/// Triangles on edges both ends of which are carried by one free vertex each.
class Facing {
 public:
  Facing(const std::vector<Edge>& edges, const SeamMap& seams) : sewn_(seams.row.size(), 0) {
    for (const int v : seams.slaves) sewn_[at(v)] = 1;
    for (const int v : seams.carrier) sewn_[at(v)] = 1;
    for (const Edge& edge : edges) {
      const auto [u, v] = edge.vertices;
      if (!is_sewn(u) && !is_sewn(v)) continue;
      const std::vector<int> ends = carriers_of(seams, edge);
      if (ends.size() != 2 || !has_one_carrier(seams, u) || !has_one_carrier(seams, v)) continue;
      for (const int t : edge.triangles) {
        if (t < 0) continue;
        if (is_sewn(u) && is_sewn(v)) on_both_[{ends[0], ends[1]}].push_back(t);
        if (edge.triangles[1] >= 0) continue;  // inside a patch
        for (const int end : ends) on_[end].push_back(t);
      }
    }
  }

  [[nodiscard]] bool is_sewn(int vertex) const { return sewn_[at(vertex)] != 0; }
  /// With an edge between two carriers, sewn at both ends.
  [[nodiscard]] const std::vector<int>& on_both(int low, int high) const {
    const auto found = on_both_.find({low, high});
    return found == on_both_.end() ? none_ : found->second;
  }
  /// With a border edge at a carrier.
  [[nodiscard]] const std::vector<int>& on(int carrier) const {
    const auto found = on_.find(carrier);
    return found == on_.end() ? none_ : found->second;
  }

 private:
  std::vector<char> sewn_;  ///< per vertex: a slave or a carrier
  std::map<std::array<int, 2>, std::vector<int>> on_both_;
  std::map<int, std::vector<int>> on_;
  std::vector<int> none_;
};

}  // namespace

std::vector<Stitch> stitch_near(const Positions& x, const Edges& first, const Edges& second,
                                double distance) {
  std::vector<Hit> hits;
  add_hits(x, first, second, distance, hits);
  if (first != second) add_hits(x, second, first, distance, hits);
  const std::vector<int> run = runs_of(hits, first, second, static_cast<std::size_t>(x.rows()));
  const auto target = [&](const Hit& hit) {
    const bool near_a = hit.ratio < 0.5;
    const int nearer = run[at(near_a ? hit.a : hit.b)];
    return nearer >= 0 ? nearer : run[at(near_a ? hit.b : hit.a)];
  };
  std::map<std::pair<int, int>, int> count;  // run, run it lies beside: vertices
  for (const Hit& hit : hits) ++count[{run[at(hit.vertex)], target(hit)}];
  std::vector<Stitch> stitches;
  for (const Hit& hit : hits) {
    const int own = run[at(hit.vertex)];
    const int other = target(hit);
    const auto back = count.find({other, own});
    const int finer = back == count.end() ? 0 : back->second;
    if (own != other &&
        (finer > count[{own, other}] || (finer == count[{own, other}] && own < other)))
      continue;  // the other side has more vertices, or as many and the higher numbers
    stitches.push_back(
        {.vertex = hit.vertex, .a = hit.a, .b = hit.b, .ratio = hit.ratio, .yields = true});
  }
  return stitches;
}

std::vector<int> collapsed_triangles(const Triangles& triangles, const SeamMap& seams) {
  std::vector<int> collapsed;
  if (seams.empty()) return collapsed;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    std::array<int, 3> place{};
    for (std::size_t k = 0; k < 3; ++k) {
      const int v = triangles[t][k];
      place[k] = -1 - v;  // like no other
      if (!has_one_carrier(seams, v)) continue;
      seams.visit_carriers(v, [&](int carrier, double) { place[k] = carrier; });
    }
    if (place[0] == place[1] || place[1] == place[2] || place[2] == place[0])
      collapsed.push_back(static_cast<int>(t));
  }
  return collapsed;
}

std::vector<std::array<int, 2>> seam_neighbors(const Triangles& triangles, const SeamMap& seams) {
  if (seams.empty()) return {};
  const std::vector<Edge> edges = find_edges(triangles);
  const Facing facing(edges, seams);
  std::vector<std::array<int, 2>> pairs;
  const auto pair_up = [&](const Edge& edge, const std::vector<int>& others) {
    const std::size_t before = pairs.size();
    for (const int other : others) {
      if (touches(triangles[at(other)], edge)) continue;  // on the same side, itself for one
      for (const int t : edge.triangles)
        if (t >= 0) pairs.push_back({std::min(t, other), std::max(t, other)});
    }
    return pairs.size() > before;
  };
  for (const Edge& edge : edges) {
    const auto [u, v] = edge.vertices;
    if (!seams.is_slave(u) && !seams.is_slave(v)) continue;
    const std::vector<int> all = carriers_of(seams, edge);
    if (!facing.is_sewn(u) || !facing.is_sewn(v) || all.size() < 2) continue;
    bool any = false;
    for (std::size_t i = 0; i < all.size(); ++i)
      for (std::size_t j = i + 1; j < all.size(); ++j)
        any = pair_up(edge, facing.on_both(all[i], all[j])) || any;
    if (any) continue;
    for (const int carrier : all) pair_up(edge, facing.on(carrier));
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

}  // namespace piecework::mesh
