#include "tangle.hpp"

#include <algorithm>
#include <cmath>

#include <piecework/colliders/audit.hpp>
#include <piecework/collision/broad_phase.hpp>

namespace piecework::untangle {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// Notes which piece of cloth passes through which closed mesh.
void note_passed(const Setting& setting, const collision::Intersection& crossing, Passed& passed) {
  int cloth = setting.surface.edges[at(crossing.edge)][0];
  int other = setting.surface.triangles[at(crossing.triangle)][0];
  if (!setting.surface.is_cloth(cloth)) std::swap(cloth, other);
  if (setting.surface.is_cloth(other)) return;
  const int mesh = setting.closed_mesh(other);
  if (mesh >= 0) passed.insert({setting.piece[at(cloth)], mesh});
}

void find_inside_meshes(const Setting& setting, const Positions& all, const Passed& passed,
                        std::vector<InsideMesh>& inside) {
  const auto is_passed = [&](int mesh) {
    return std::any_of(passed.begin(), passed.end(),
                       [&](const auto& p) { return p.second == mesh; });
  };
  for (int mesh = 0; mesh < static_cast<int>(setting.closed.size()); ++mesh) {
    if (!is_passed(mesh)) continue;
    const ClosedMesh& closed = setting.closed[at(mesh)];
    const Positions cloth = all.topRows(setting.model.num_vertices());
    for (const int v : colliders::points_inside(closed.triangles, closed.x, cloth))
      if (passed.contains({setting.piece[at(v)], mesh})) inside.push_back({v, mesh});
  }
}

void find_inside_bodies(const Setting& setting, const Positions& all,
                        std::vector<InsideBody>& inside) {
  for (int body = 0; body < static_cast<int>(setting.bodies.size()); ++body)
    for (int v = 0; v < setting.model.num_vertices(); ++v)
      if (setting.bodies[at(body)].signed_distance(all.row(v), setting.poses[at(body)]).distance <
          0)
        inside.push_back({v, body});
}

bool any_marked(const collision::PairVertices& vertices, const Setting& setting,
                const std::vector<char>& marked) {
  return std::any_of(vertices.begin(), vertices.end(),
                     [&](int v) { return setting.surface.is_cloth(v) && marked[at(v)]; });
}

/// A vertex of the one element is joined to one of the other, by an edge or a seam.
bool are_joined(const Setting& setting, const collision::PairVertices& v, std::size_t first_count) {
  for (std::size_t a = 0; a < first_count; ++a)
    for (std::size_t b = first_count; b < 4; ++b)
      if (setting.surface.is_cloth(v[a]) && setting.surface.is_cloth(v[b]) &&
          (setting.are_neighbours(v[a], v[b]) ||
           setting.are_sewn({v[a], v[a]}, {v[b], v[b], v[b]})))
        return true;
  return false;
}

}  // namespace

Positions all_positions(const Setting& setting, const Positions& x) {
  Positions all;
  contact::Points{x, setting.obstacle_x}.copy_to(all);
  return all;
}

Tangle find_tangle(const Setting& setting, const Positions& all, Passed& passed) {
  Tangle tangle;
  if (setting.surface.self || !setting.obstacles.triangles().empty())
    tangle.crossings = collision::find_intersections(setting.surface, all);
  std::erase_if(tangle.crossings, [&](const collision::Intersection& c) {
    return setting.are_sewn(setting.surface.edges[at(c.edge)],
                            setting.surface.triangles[at(c.triangle)]);
  });
  for (const collision::Intersection& c : tangle.crossings) note_passed(setting, c, passed);
  find_inside_meshes(setting, all, passed, tangle.in_mesh);
  find_inside_bodies(setting, all, tangle.in_body);
  return tangle;
}

Closeness find_close(const Setting& setting, const Positions& all, const std::vector<char>& marked,
                     double part) {
  Closeness close;
  const auto consider = [&](collision::PairKind kind, const collision::PairVertices& v) {
    const std::size_t first_count = kind == collision::PairKind::VertexTriangle ? 1 : 2;
    if (!any_marked(v, setting, marked) || are_joined(setting, v, first_count)) return;
    const double wanted =
        part * std::max(setting.distance_of(v[0]), setting.distance_of(v[first_count]));
    const collision::Closest closest =
        collision::closest(kind, {all.row(v[0]), all.row(v[1]), all.row(v[2]), all.row(v[3])});
    if (closest.distance_sq < wanted * wanted) close.pairs.push_back({v, closest, wanted});
  };
  std::vector<collision::VertexBox> boxes;
  for (Eigen::Index v = 0; v < all.rows(); ++v) boxes.push_back({all.row(v), all.row(v)});
  collision::BroadPhase broad_phase(setting.surface);
  const double reach =
      part * std::max(setting.distance, setting.obstacles.distance(setting.distance));
  const collision::CandidatePairs& pairs = broad_phase.find(boxes, reach);
  for (const auto& [v, t] : pairs.vertex_triangle) {
    const Triangle& triangle = setting.surface.triangles[at(t)];
    consider(collision::PairKind::VertexTriangle, {v, triangle[0], triangle[1], triangle[2]});
  }
  for (const auto& [a, b] : pairs.edge_edge) {
    const auto &e = setting.surface.edges[at(a)], &f = setting.surface.edges[at(b)];
    consider(collision::PairKind::EdgeEdge, {e[0], e[1], f[0], f[1]});
  }
  for (int body = 0; body < static_cast<int>(setting.bodies.size()); ++body)
    for (int v = 0; v < setting.model.num_vertices(); ++v) {
      if (!marked[at(v)] || !setting.is_free(v)) continue;
      const auto& [distance, normal] =
          setting.bodies[at(body)].signed_distance(all.row(v), setting.poses[at(body)]);
      const double missing = part * setting.distance_of_body(body) - distance;
      if (missing > 0) close.bodies.push_back({v, body, missing, normal});
    }
  return close;
}

}  // namespace piecework::untangle
