#include "setting.hpp"

#include <algorithm>
#include <utility>

#include <piecework/colliders/audit.hpp>

#include "groups.hpp"

namespace piecework::untangle {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

std::vector<int> pieces(const model::ClothModel& model, const collision::Surface& surface) {
  Groups groups(model.num_vertices());
  for (const auto& [v, w] : surface.edges)
    if (surface.is_cloth(v)) groups.join(v, w);
  for (const int slave : model.sewing.map().slaves)
    model.sewing.map().visit_carriers(slave,
                                      [&](int carrier, double) { groups.join(slave, carrier); });
  return groups.all();
}

std::vector<ClosedMesh> closed_meshes(const contact::Colliders& colliders, int num_cloth,
                                      double distance) {
  std::vector<ClosedMesh> closed;
  int first = num_cloth;
  for (const colliders::MeshCollider& mesh : colliders.meshes) {
    Positions x;
    mesh.positions_at(0, x);
    if (mesh.closed()) {
      NearestSurface way_out(mesh.triangles(), x);
      if (!way_out.empty())
        closed.push_back({mesh.triangles(), x, first, mesh.traits().thickness.value_or(distance),
                          colliders::signed_volume(mesh.triangles(), x) < 0 ? -1.0 : 1.0,
                          std::move(way_out)});
    }
    first += mesh.num_vertices();
  }
  return closed;
}

}  // namespace

Setting::Setting(const model::ClothModel& cloth, const contact::Colliders& colliders,
                 const std::vector<char>& held_vertices, const UntangleOptions& options)
    : model(cloth),
      held(held_vertices),
      distance(options.distance),
      obstacles(colliders.meshes),
      surface(obstacles.surface(cloth, options.self)),
      triangles_at(mesh::vertex_triangles(surface.triangles, surface.num_vertices)),
      piece(pieces(cloth, surface)),
      closed(closed_meshes(colliders, cloth.num_vertices(), options.distance)),
      bodies(colliders.bodies) {
  model.sewing.mark_held(held);
  obstacles.place(0, obstacle_x);
  for (const colliders::AnalyticCollider& body : bodies) poses.push_back(body.pose(0));
}

double Setting::distance_of(int v) const {
  if (surface.is_cloth(v)) return distance;
  return obstacles.of_vertex(v - surface.num_cloth_vertices).traits().thickness.value_or(distance);
}

double Setting::distance_of_body(int body) const {
  return bodies[at(body)].traits().thickness.value_or(distance);
}

int Setting::closed_mesh(int v) const {
  for (std::size_t m = 0; m < closed.size(); ++m)
    if (v >= closed[m].first_vertex && v < closed[m].first_vertex + closed[m].x.rows())
      return static_cast<int>(m);
  return -1;
}

bool Setting::are_sewn(const std::array<int, 2>& edge, const Triangle& triangle) const {
  if (model.sewing.empty() || !surface.is_cloth(edge[0]) || !surface.is_cloth(triangle[0]))
    return false;
  bool sewn = false;
  for (const int v : edge)
    for (const int w : triangle)
      model.sewing.map().visit_carriers(v, [&](int a, double) {
        model.sewing.map().visit_carriers(w, [&](int b, double) { sewn = sewn || a == b; });
      });
  return sewn;
}

bool Setting::are_neighbours(int v, int w) const {
  const std::array<int, 2> edge{std::min(v, w), std::max(v, w)};
  // Edges of cloth come first and ascend.
  const auto end = std::partition_point(surface.edges.begin(), surface.edges.end(),
                                        [&](const auto& e) { return surface.is_cloth(e[0]); });
  return std::binary_search(surface.edges.begin(), end, edge);
}

}  // namespace piecework::untangle
