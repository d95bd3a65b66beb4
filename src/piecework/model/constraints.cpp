#include <piecework/model/constraints.hpp>

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <piecework/core/error.hpp>

namespace piecework::model {
namespace {

double signed_area(const std::array<Vec2, 3>& corner) {
  const Vec2 a = corner[1] - corner[0];
  const Vec2 b = corner[2] - corner[0];
  return 0.5 * (a.x() * b.y() - a.y() * b.x());
}

/// Cotangent of the angle at `at` between the directions to `to` and `other`.
double cotangent(const Vec2& at, const Vec2& to, const Vec2& other) {
  const Vec2 a = to - at;
  const Vec2 b = other - at;
  return a.dot(b) / std::abs(a.x() * b.y() - a.y() * b.x());
}

/// An isometric copy of a triangle in the plane: x0 at the origin, x1 on the first axis.
std::array<Vec2, 3> flatten(const Vec3& x0, const Vec3& x1, const Vec3& x2) {
  const Vec3 a = x1 - x0;
  const Vec3 b = x2 - x0;
  const double length = a.norm();
  const Vec3 axis = a / length;
  const double along = b.dot(axis);
  return {Vec2(0, 0), Vec2(length, 0), Vec2(along, axis.cross(b).norm())};
}

bool has_area(const std::array<Vec2, 3>& corner) {
  const double longest_sq =
      std::max({(corner[1] - corner[0]).squaredNorm(), (corner[2] - corner[0]).squaredNorm(),
                (corner[2] - corner[1]).squaredNorm()});
  return std::isfinite(longest_sq) && std::abs(signed_area(corner)) > 1e-14 * longest_sq;
}

void check_areas(const RestShape& rest, const std::string& name, const char* remedy) {
  for (std::size_t t = 0; t < rest.corners.size(); ++t)
    if (!has_area(rest.corners[t]))
      throw InputError(
          fmt::format("{}: triangle {}: zero area in the rest shape; {}", name, t, remedy));
}

void check_constant(const std::string& part, const char* constant, double value,
                    bool zero_allowed) {
  if (std::isfinite(value) && (value > 0 || (zero_allowed && value == 0))) return;
  throw InputError(fmt::format("{}: material {} = {}: give a finite value {} 0", part, constant,
                               value, zero_allowed ? ">=" : ">"));
}

void check_part(const ClothPart& part) {
  check_constant(part.name, "density", part.material.density, false);
  check_constant(part.name, "stretching", part.material.stretching, true);
  if (part.material.bending) check_constant(part.name, "bending", *part.material.bending, true);
  if (part.rest.corners.size() != part.triangles.size() ||
      (part.rest.positions.rows() != 0 && part.rest.positions.rows() != part.start.rows()))
    throw InputError(
        fmt::format("{}: rest shape and start shape differ in size ({} and {} triangles); "
                    "both need the same faces and vertices",
                    part.name, part.rest.corners.size(), part.triangles.size()));
  if (!part.start.allFinite())
    throw InputError(
        fmt::format("{}: a start position is not finite; check the transform", part.name));
}

/// Where a vertex of a triangle lies in the triangle's flat rest shape.
const Vec2& rest_corner(const ClothPart& part, int triangle, int vertex) {
  const auto t = static_cast<std::size_t>(triangle);
  std::size_t k = 0;
  while (part.triangles[t][k] != vertex) ++k;
  return part.rest.corners[t][k];
}

/// A triangle's corners in the order (x0, x1, opposite) of a hinge.
std::array<Vec2, 3> hinge_side(const ClothPart& part, const mesh::Hinge& hinge, std::size_t side) {
  const int t = hinge.triangles[side];
  return {rest_corner(part, t, hinge.vertices[0]), rest_corner(part, t, hinge.vertices[1]),
          rest_corner(part, t, hinge.vertices[2 + side])};
}

BendConstraint make_bend(const ClothPart& part, const mesh::Hinge& hinge, int first_vertex) {
  const auto t0 = hinge_side(part, hinge, 0);
  const auto t1 = hinge_side(part, hinge, 1);
  BendConstraint bend{};
  bend.coefficient = hinge_coefficients(t0, t1);
  bend.weight = *part.material.bending / (std::abs(signed_area(t0)) + std::abs(signed_area(t1)));
  Vec3 curvature = Vec3::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    bend.vertices[i] = hinge.vertices[i] + first_vertex;
    if (part.rest.positions.rows() > 0)
      curvature += bend.coefficient[i] * part.rest.positions.row(hinge.vertices[i]).transpose();
  }
  // Rounding must not make a flat sheet slightly curved: flat hinges need no local work at all.
  const double length = curvature.norm();
  bend.rest_length = length > 1e-9 * (t0[1] - t0[0]).norm() ? length : 0.0;
  return bend;
}

void add_stretch(const ClothPart& part, int first_vertex, ClothModel& model) {
  for (std::size_t t = 0; t < part.triangles.size(); ++t) {
    const auto& corner = part.rest.corners[t];
    const double area = std::abs(signed_area(corner));
    Mat2 edges;
    edges << corner[1] - corner[0], corner[2] - corner[0];
    Triangle vertices = part.triangles[t];
    for (int& vertex : vertices) {
      vertex += first_vertex;
      model.mass[vertex] += part.material.density * area / 3.0;
    }
    model.triangles.push_back(vertices);
    model.triangle_mass.push_back(part.material.density * area);
    model.stretch.push_back({vertices, edges.inverse(), part.material.stretching * area});
  }
}

/// Returns the sum of the rest lengths of the part's edges.
double add_hinges(const ClothPart& part, const std::vector<mesh::Edge>& edges, int first_vertex,
                  int first_triangle, ClothModel& model) {
  for (mesh::Hinge hinge : mesh::find_hinges(part.triangles, edges)) {
    if (part.material.bending) model.bend.push_back(make_bend(part, hinge, first_vertex));
    model.hinge_bends.push_back(part.material.bending.has_value());
    for (int& vertex : hinge.vertices) vertex += first_vertex;
    for (int& triangle : hinge.triangles) triangle += first_triangle;
    model.hinges.push_back(hinge);
  }
  double length = 0;
  for (const mesh::Edge& edge : edges)
    length += (rest_corner(part, edge.triangles[0], edge.vertices[1]) -
               rest_corner(part, edge.triangles[0], edge.vertices[0]))
                  .norm();
  return length;
}

}  // namespace

RestShape rest_from_positions(const Positions& positions, const Triangles& triangles,
                              const std::string& name) {
  RestShape rest;
  rest.positions = positions;
  rest.corners.reserve(triangles.size());
  for (const Triangle& t : triangles)
    rest.corners.push_back(flatten(positions.row(t[0]).transpose(), positions.row(t[1]).transpose(),
                                   positions.row(t[2]).transpose()));
  check_areas(rest, name, "remove the triangle or import with `repair: true`");
  return rest;
}

RestShape rest_from_uv(const std::vector<Vec2>& corner_uv, const Triangles& triangles,
                       const std::string& name) {
  if (corner_uv.size() != 3 * triangles.size())
    throw InputError(fmt::format(
        "{}: rest: \"uv\", but the mesh has no texture coordinates; use rest: \"self\"", name));
  RestShape rest;
  for (std::size_t t = 0; t < triangles.size(); ++t)
    rest.corners.push_back({corner_uv[3 * t], corner_uv[3 * t + 1], corner_uv[3 * t + 2]});
  check_areas(rest, name, "its texture coordinates coincide or are in line; use rest: \"self\"");
  return rest;
}

std::array<double, 4> hinge_coefficients(const std::array<Vec2, 3>& t0,
                                         const std::array<Vec2, 3>& t1) {
  const double c01 = cotangent(t0[0], t0[1], t0[2]);
  const double c03 = cotangent(t0[1], t0[0], t0[2]);
  const double c02 = cotangent(t1[0], t1[1], t1[2]);
  const double c04 = cotangent(t1[1], t1[0], t1[2]);
  return {c03 + c04, c01 + c02, -c01 - c03, -c02 - c04};
}

ClothModel build_model(const std::vector<ClothPart>& parts) {
  ClothModel model;
  Eigen::Index total = 0;
  for (const ClothPart& part : parts) {
    check_part(part);
    total += part.start.rows();
  }
  model.mass = Eigen::VectorXd::Zero(total);
  model.start.resize(total, 3);

  double edge_length = 0;
  std::size_t num_edges = 0;
  int first_vertex = 0;
  for (const ClothPart& part : parts) {
    const int first_triangle = static_cast<int>(model.triangles.size());
    const int num_vertices = static_cast<int>(part.start.rows());
    model.parts.push_back({part.name, first_vertex, num_vertices, first_triangle,
                           static_cast<int>(part.triangles.size())});
    model.start.middleRows(first_vertex, num_vertices) = part.start;
    add_stretch(part, first_vertex, model);
    const auto edges = mesh::find_edges(part.triangles);
    edge_length += add_hinges(part, edges, first_vertex, first_triangle, model);
    num_edges += edges.size();
    first_vertex += num_vertices;
  }
  model.mean_edge = edge_length / static_cast<double>(std::max<std::size_t>(1, num_edges));
  return model;
}

}  // namespace piecework::model
