#include "pushes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include <piecework/colliders/audit.hpp>

#include "groups.hpp"
#include "regions.hpp"

namespace piecework::untangle {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

using EdgeVertices = std::array<int, 2>;

Vec3 unit(const Vec3& v) { return v.stableNormalized(); }  // zero stays zero

/// Where an edge passes through a triangle.
struct Crossing {
  EdgeVertices edge;
  Triangle triangle;
  Vec3 along, normal;            ///< unit vectors
  double u;                      ///< along the edge, 0 to 1
  std::array<double, 3> weight;  ///< of the corners
  std::array<double, 2> height;  ///< of the ends above the triangle's plane, m
};

/// Nothing: edge or triangle has no size, and says nothing of directions.
std::optional<Crossing> crossing_at(const Setting& setting, const collision::Intersection& found,
                                    const Positions& x) {
  Crossing c{.edge = setting.surface.edges[at(found.edge)],
             .triangle = setting.surface.triangles[at(found.triangle)]};
  const Vec3 p = x.row(c.edge[0]), q = x.row(c.edge[1]), a = x.row(c.triangle[0]);
  c.along = unit(q - p);
  c.normal = unit(area_normal(c.triangle, x));
  if (c.along.isZero() || c.normal.isZero()) return std::nullopt;
  c.height = {(p - a).dot(c.normal), (q - a).dot(c.normal)};
  const double difference = c.height[0] - c.height[1];
  c.u = difference == 0 ? 0.5 : std::clamp(c.height[0] / difference, 0.0, 1.0);
  const Vec3 point = p + c.u * (q - p);
  const auto beta =
      collision::closest_vertex_triangle({point, a, x.row(c.triangle[1]), x.row(c.triangle[2])})
          .beta;
  c.weight = {-beta[1], -beta[2], -beta[3]};
  return c;
}

/// Calls visit(triangle) for those beside an edge.
template <class Visit>
void for_faces_beside(const Setting& setting, const EdgeVertices& edge, const Visit& visit) {
  const auto& [begin, item] = setting.triangles_at;
  for (int i = begin[at(edge[0])]; i < begin[at(edge[0]) + 1]; ++i) {
    const Triangle& face = setting.surface.triangles[at(item[at(i)])];
    if (std::find(face.begin(), face.end(), edge[1]) != face.end()) visit(item[at(i)]);
  }
}

Push vertex_push(int vertex, const Vec3& way) { return {{vertex}, {1}, unit(way), way.norm()}; }

/// Edge and triangle apart, by `way` of the edge relative to the triangle.
Push apart(const Crossing& c, const Vec3& way) {
  return {{c.edge[0], c.edge[1], c.triangle[0], c.triangle[1], c.triangle[2]},
          {1 - c.u, c.u, -c.weight[0], -c.weight[1], -c.weight[2]},
          unit(way),
          way.norm()};
}

/// The direction of the contour from the crossing into a face beside its edge; zero if there is
/// none.
Vec3 contour_direction(const Crossing& c, const Triangle& face, const Positions& x) {
  Vec3 middle = Vec3::Zero();
  for (const int v : face) middle += x.row(v).transpose() / 3;
  const Vec3 start = x.row(c.edge[0]);
  const Vec3 inward = (middle - start) - (middle - start).dot(c.along) * c.along;
  const Vec3 direction = unit(unit(area_normal(face, x)).cross(c.normal));
  return direction.dot(inward) < 0 ? Vec3(-direction) : direction;
}

/// The direction in which the edge has to move, relative to the triangle, for the contour of the
/// intersection to become shorter fastest [Volino and Magnenat-Thalmann 2006]: the sum over the
/// faces beside the edge of R - (E.R) / (E.N) N, with R where the contour goes in the face.
Vec3 shortening_direction(const Setting& setting, const Crossing& c, const Positions& x) {
  constexpr double kParallel = 1e-9;
  const double slope = c.along.dot(c.normal);
  if (std::abs(slope) < kParallel) return Vec3::Zero();
  Vec3 sum = Vec3::Zero();
  for_faces_beside(setting, c.edge, [&](int face) {
    const Vec3 R = contour_direction(c, setting.surface.triangles[at(face)], x);
    sum += R - c.along.dot(R) / slope * c.normal;
  });
  constexpr double kStraight = 1e-6;  // the contour of flat pieces has no corner: no direction
  return sum.norm() < kStraight ? Vec3(Vec3::Zero()) : unit(sum);
}

/// For an edge in the plane of the triangle: up from obstacles, and of two pieces of cloth the
/// lower one goes along its own normal.
Vec3 lifting_direction(const Setting& setting, const Crossing& c, const Positions& x) {
  const int first = c.edge[0], second = c.triangle[0];
  if (!setting.surface.is_cloth(second)) return c.normal;
  Vec3 own = Vec3::Zero();
  const auto& [begin, item] = setting.triangles_at;
  for (int i = begin[at(first)]; i < begin[at(first) + 1]; ++i)
    own += area_normal(setting.surface.triangles[at(item[at(i)])], x);
  own = unit(own);
  if (!setting.surface.is_cloth(first)) return -own.dot(c.normal) < 0 ? Vec3(-own) : own;
  const bool along_own = setting.piece[at(first)] == setting.piece[at(second)]
                             ? own.dot(c.normal) < 0 || first < second
                             : setting.piece[at(first)] < setting.piece[at(second)];
  return along_own ? own : Vec3(-c.normal);
}

/// Which crossings lie on one contour of intersection: those on the same two triangles. Per
/// crossing the first one of its contour.
std::vector<int> contours(const Setting& setting,
                          const std::vector<collision::Intersection>& found) {
  Groups groups(static_cast<int>(found.size()));
  std::map<std::pair<int, int>, int> first;  // crossing on two triangles
  for (int i = 0; i < static_cast<int>(found.size()); ++i) {
    const collision::Intersection& c = found[at(i)];
    for_faces_beside(setting, setting.surface.edges[at(c.edge)], [&](int face) {
      const auto key = std::minmax(face, c.triangle);
      groups.join(i, first.try_emplace({key.first, key.second}, i).first->second);
    });
  }
  return groups.all();
}

class CrossingPushes {
 public:
  CrossingPushes(const Setting& setting, const Tangle& tangle, const Positions& x, double step,
                 std::vector<Push>& pushes)
      : setting_(setting),
        x_(x),
        step_(step),
        regions_(setting, tangle.crossings),
        pushes_(pushes) {
    for (const InsideMesh& in : tangle.in_mesh) inside_.insert({in.vertex, in.mesh});
  }

  void add_all(const std::vector<collision::Intersection>& found) {
    const std::vector<int> contour = contours(setting_, found);
    std::vector<char> pulled(found.size(), 0);  // by contour
    std::vector<std::optional<Crossing>> open(found.size());
    for (std::size_t i = 0; i < found.size(); ++i) {
      const auto c = crossing_at(setting_, found[i], x_);
      if (!c) continue;
      const int mesh = mesh_of(*c);
      if (mesh >= 0)
        out_of_mesh(*c, mesh);
      else if (pull_back(*c))
        pulled[at(contour[i])] = 1;
      else
        open[i] = c;
    }
    for (std::size_t i = 0; i < found.size(); ++i)
      if (open[i] && !pulled[at(contour[i])]) shorten(*open[i]);
  }

 private:
  [[nodiscard]] int mesh_of(const Crossing& c) const {
    for (const int v : {c.edge[0], c.triangle[0]})
      if (!setting_.surface.is_cloth(v)) return setting_.closed_mesh(v);
    return -1;
  }

  /// Where cloth passes through a surface it goes outward, with an end of the edge that is inside.
  void out_of_mesh(const Crossing& c, int mesh) {
    const double gap = 0.5 * setting_.closed[at(mesh)].distance;
    if (!setting_.surface.is_cloth(c.edge[0])) {
      Vec3 outward = Vec3::Zero();
      for_faces_beside(setting_, c.edge, [&](int face) {
        outward += unit(area_normal(setting_.surface.triangles[at(face)], x_));
      });
      outward *= setting_.closed[at(mesh)].orientation;
      if (!outward.isZero()) pushes_.push_back(apart(c, -gap * unit(outward)));
      return;
    }
    const Vec3 outward = setting_.closed[at(mesh)].orientation * c.normal;
    double way = gap;
    for (std::size_t end = 0; end < 2; ++end)
      if (inside_.contains({c.edge[end], mesh})) way = gap + std::abs(c.height[end]);
    pushes_.push_back(apart(c, std::min(way, setting_.model.mean_edge) * outward));
  }

  /// Back through the triangle with what has come through it.
  bool pull_back(const Crossing& c) {
    if (!setting_.surface.is_cloth(c.edge[0])) return false;
    const auto end = regions_.smaller_end(c.edge);
    if (!end) return false;
    const double height = c.height[*end];
    const double gap = 0.5 * setting_.distance_of(c.triangle[0]);
    const double way = std::min(std::abs(height) + gap, std::max(step_, gap));
    // In the plane to rounding: the other end says where back is.
    const double side = height != 0 ? height : -c.height[1 - *end];
    if (side == 0) return false;
    pushes_.push_back(apart(c, side > 0 ? Vec3(-way * c.normal) : Vec3(way * c.normal)));
    return true;
  }

  void shorten(const Crossing& c) {
    constexpr double kInPlane = 1e-6;
    const Vec3 direction = std::abs(c.along.dot(c.normal)) < kInPlane
                               ? lifting_direction(setting_, c, x_)
                               : shortening_direction(setting_, c, x_);
    if (!direction.isZero()) pushes_.push_back(apart(c, step_ * direction));
  }

  const Setting& setting_;
  const Positions& x_;
  double step_;
  Regions regions_;
  std::set<std::pair<int, int>> inside_;
  std::vector<Push>& pushes_;
};

Positions cloth_normals(const Setting& setting, const Positions& x) {
  Positions normals = Positions::Zero(setting.model.num_vertices(), 3);
  for (const Triangle& t : setting.model.triangles)
    for (const int v : t) normals.row(v) += area_normal(t, x);
  for (Eigen::Index v = 0; v < normals.rows(); ++v) normals.row(v) = unit(normals.row(v));
  return normals;
}

/// Out to the nearest point of the surface, if that is not along the cloth: cloth that stands in a
/// body is drawn out the way that it came in, by what passes through the surface.
void push_out_of_meshes(const Setting& setting, const Tangle& tangle, const Positions& x,
                        std::vector<Push>& pushes) {
  if (tangle.in_mesh.empty()) return;
  constexpr double kAcross = 0.4;  // cosine
  const Positions normals = cloth_normals(setting, x);
  for (const auto& [v, mesh] : tangle.in_mesh) {
    const ClosedMesh& closed = setting.closed[at(mesh)];
    const Vec3 p = x.row(v);
    const NearestSurface::Foot foot = closed.way_out.nearest(p);
    const double depth = (foot.point - p).norm();
    const double gap = 0.5 * closed.distance;
    const Vec3 way = foot.point + gap * foot.outward - p;
    const Vec3 normal = normals.row(v);
    if (depth <= gap || std::abs(unit(way).dot(normal)) > kAcross)
      pushes.push_back(vertex_push(v, way));
  }
}

/// Where triangles of cloth and a closed mesh pass through each other: the middle of the points on
/// each triangle, which lies inside of the mesh where that is convex.
struct Pierced {
  Vec3 sum = Vec3::Zero();
  int count = 0;
  [[nodiscard]] Vec3 middle() const { return sum / count; }
};
using PiercedTriangles = std::map<std::pair<int, int>, Pierced>;  // by mesh and triangle

PiercedTriangles pierced_triangles(const Setting& setting, const Tangle& tangle,
                                   const Positions& x) {
  PiercedTriangles pierced;
  for (const collision::Intersection& found : tangle.crossings) {
    const auto c = crossing_at(setting, found, x);
    if (!c) continue;
    const bool cloth_edge = setting.surface.is_cloth(c->edge[0]);
    if (cloth_edge && setting.surface.is_cloth(c->triangle[0])) continue;
    const int mesh = setting.closed_mesh(cloth_edge ? c->triangle[0] : c->edge[0]);
    if (mesh < 0) continue;
    const Vec3 point = (1 - c->u) * x.row(c->edge[0]) + c->u * x.row(c->edge[1]);
    const auto add = [&](int t) {
      Pierced& p = pierced[{mesh, t}];
      p.sum += point;
      ++p.count;
    };
    if (cloth_edge)
      for_faces_beside(setting, c->edge, add);
    else
      add(found.triangle);
  }
  return pierced;
}

/// Triangles out of meshes that they are pierced by, though their corners may be outside.
void push_pierced_out(const Setting& setting, const Tangle& tangle, const Positions& x,
                      std::vector<Push>& pushes) {
  const PiercedTriangles pierced = pierced_triangles(setting, tangle, x);
  for (int m = 0; m < static_cast<int>(setting.closed.size()); ++m) {
    const ClosedMesh& closed = setting.closed[at(m)];
    std::vector<int> triangles;
    for (const auto& [key, p] : pierced)
      if (key.first == m) triangles.push_back(key.second);
    Positions middles(static_cast<Eigen::Index>(triangles.size()), 3);
    for (std::size_t i = 0; i < triangles.size(); ++i)
      middles.row(static_cast<Eigen::Index>(i)) = pierced.at({m, triangles[i]}).middle();
    for (const int i : colliders::points_inside(closed.triangles, closed.x, middles)) {
      const Vec3 p = middles.row(i);
      const NearestSurface::Foot foot = closed.way_out.nearest(p);
      const Vec3 way = foot.point + 0.5 * closed.distance * foot.outward - p;
      const Triangle& t = setting.surface.triangles[at(triangles[at(i)])];
      const auto beta =
          collision::closest_vertex_triangle({p, x.row(t[0]), x.row(t[1]), x.row(t[2])}).beta;
      pushes.push_back({{t[0], t[1], t[2]}, {-beta[1], -beta[2], -beta[3]}, unit(way), way.norm()});
    }
  }
}

void push_out_of_bodies(const Setting& setting, const Tangle& tangle, const Positions& x,
                        std::vector<Push>& pushes) {
  for (const auto& [v, body] : tangle.in_body) {
    const auto& [distance, normal] =
        setting.bodies[at(body)].signed_distance(x.row(v), setting.poses[at(body)]);
    pushes.push_back(vertex_push(v, (0.5 * setting.distance_of_body(body) - distance) * normal));
  }
}

}  // namespace

Displacements::Displacements(const Setting& setting, const std::vector<Push>& pushes)
    : u(Positions::Zero(setting.model.num_vertices(), 3)),
      pushed(at(setting.model.num_vertices()), 0) {
  std::vector<double> farthest(pushed.size(), 0);
  for (const Push& push : pushes)
    for (std::size_t k = 0; k < push.vertices.size(); ++k)
      if (push.weight[k] != 0 && setting.is_free(push.vertices[k])) {
        double& most = farthest[at(push.vertices[k])];
        most = std::max(most, push.amount);
        pushed[at(push.vertices[k])] = 1;
      }
  constexpr int kSweeps = 4;
  for (int sweep = 0; sweep < kSweeps; ++sweep)
    for (const Push& push : pushes) meet(setting, push, farthest);
}

void Displacements::meet(const Setting& setting, const Push& push,
                         const std::vector<double>& farthest) {
  constexpr double kLeast = 0.1;  // a vertex that has hardly any part in a push is not thrown far
  double met = 0, squares = 0;
  for (std::size_t k = 0; k < push.vertices.size(); ++k) {
    if (push.weight[k] == 0 || !setting.is_free(push.vertices[k])) continue;
    met += push.weight[k] * u.row(push.vertices[k]).dot(push.direction);
    squares += push.weight[k] * push.weight[k];
  }
  if (squares == 0 || met >= push.amount) return;
  const double factor = (push.amount - met) / std::max(squares, kLeast);
  for (std::size_t k = 0; k < push.vertices.size(); ++k) {
    if (push.weight[k] == 0 || !setting.is_free(push.vertices[k])) continue;
    Vec3 moved = u.row(push.vertices[k]).transpose() + factor * push.weight[k] * push.direction;
    const double length = moved.norm(), most = farthest[at(push.vertices[k])];
    if (length > most) moved *= most / length;
    u.row(push.vertices[k]) = moved;
  }
}

std::vector<Push> untangling_pushes(const Setting& setting, const Tangle& tangle,
                                    const Positions& all, double step) {
  std::vector<Push> pushes;
  push_out_of_bodies(setting, tangle, all, pushes);
  push_out_of_meshes(setting, tangle, all, pushes);
  push_pierced_out(setting, tangle, all, pushes);
  CrossingPushes crossing_pushes(setting, tangle, all, step, pushes);
  crossing_pushes.add_all(tangle.crossings);
  return pushes;
}

std::vector<Push> opening_pushes(const Closeness& close) {
  std::vector<Push> pushes;
  for (const NearBody& near : close.bodies)
    pushes.push_back(vertex_push(near.vertex, near.missing * near.outward));
  for (const NearPair& near : close.pairs) {
    const double distance = std::sqrt(near.closest.distance_sq);
    if (!(distance > 0)) continue;
    Push push{{}, {}, near.closest.offset / distance, near.wanted - distance};
    std::copy(near.vertices.begin(), near.vertices.end(), push.vertices.begin());
    std::copy(near.closest.beta.begin(), near.closest.beta.end(), push.weight.begin());
    pushes.push_back(push);
  }
  return pushes;
}

}  // namespace piecework::untangle
