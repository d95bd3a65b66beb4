#include <piecework/colliders/tessellation.hpp>

#include <cmath>
#include <numbers>
#include <vector>

#include <fmt/format.h>

#include <piecework/core/error.hpp>
#include <piecework/mesh/solids.hpp>

namespace piecework::colliders {
namespace {

using mesh::TriangleMesh;

/// How far out what is unbounded is cut off, m, and the chords of a quarter of a circle.
struct Fineness {
  double extent;
  int quarter;
};

/// Turns +y to `axis` and the origin to `middle`.
TriangleMesh placed(TriangleMesh mesh, const Vec3& middle, const Vec3& axis) {
  const Mat3 turn = Eigen::Quaterniond::FromTwoVectors(Vec3::UnitY(), axis).toRotationMatrix();
  mesh.positions = mesh.positions * turn.transpose();
  mesh.positions.rowwise() += middle.transpose();
  return mesh;
}

TriangleMesh polygon_fan(const std::vector<Vec3>& corners) {
  TriangleMesh fan;
  fan.positions.resize(static_cast<Eigen::Index>(corners.size()), 3);
  for (std::size_t i = 0; i < corners.size(); ++i)
    fan.positions.row(static_cast<Eigen::Index>(i)) = corners[i].transpose();
  for (int i = 1; i + 1 < fan.num_vertices(); ++i) fan.triangles.push_back({0, i, i + 1});
  return fan;
}

/// Upper quarter circle about (radius, height) from the side to the top.
void add_arc(std::vector<Vec2>& profile, const Vec2& center, double rounding, int chords) {
  for (int k = 0; k <= chords; ++k) {
    const double angle = 0.5 * std::numbers::pi * k / chords;
    profile.push_back(center + rounding * Vec2(std::cos(angle), std::sin(angle)));
  }
}

/// Surface of revolution of the profile, from the side to the top pole, and its mirror image below.
TriangleMesh turned(const std::vector<Vec2>& upper, int quarter) {
  std::vector<Vec2> profile;
  for (auto p = upper.rbegin(); p != upper.rend(); ++p) profile.emplace_back(p->x(), -p->y());
  const bool meets = upper.front().y() == 0;
  profile.insert(profile.end(), upper.begin() + (meets ? 1 : 0), upper.end());
  return mesh::lathe(profile, 4 * quarter);
}

TriangleMesh triangles_of(const Plane& plane, const Fineness& fineness) {
  return polygon_fan(HalfSpaces({plane}).faces(fineness.extent).front());
}

TriangleMesh triangles_of(const Sphere& sphere, const Fineness& fineness) {
  return placed(mesh::icosphere(sphere.radius, fineness.quarter), sphere.center, Vec3::UnitY());
}

TriangleMesh triangles_of(const Capsule& capsule, const Fineness& fineness) {
  const Vec3 axis = capsule.to - capsule.from;
  std::vector<Vec2> upper;
  add_arc(upper, Vec2(0, 0.5 * axis.norm()), capsule.radius, fineness.quarter);
  upper.back().x() = 0;  // the pole
  return placed(turned(upper, fineness.quarter), 0.5 * (capsule.from + capsule.to),
                axis.isZero(0) ? Vec3(Vec3::UnitY()) : axis);
}

TriangleMesh triangles_of(const Box& box, const Fineness& fineness) {
  return placed(mesh::box(2 * box.half_size, box.rounding, (fineness.quarter + 1) / 2), box.center,
                Vec3::UnitY());
}

TriangleMesh triangles_of(const Cylinder& cylinder, const Fineness& fineness) {
  const Vec3 axis = cylinder.to - cylinder.from;
  const Vec2 rim(cylinder.radius, 0.5 * axis.norm());
  std::vector<Vec2> upper;
  if (cylinder.rounding > 0)
    add_arc(upper, rim.array() - cylinder.rounding, cylinder.rounding, fineness.quarter);
  else
    upper.push_back(rim);
  if (cylinder.rounding < cylinder.radius)
    upper.emplace_back(0, rim.y());
  else
    upper.back().x() = 0;
  return placed(turned(upper, fineness.quarter), 0.5 * (cylinder.from + cylinder.to), axis);
}

TriangleMesh triangles_of(const HalfSpaces& solid, const Fineness& fineness) {
  TriangleMesh mesh;
  for (const std::vector<Vec3>& face : solid.faces(fineness.extent))
    mesh::append(polygon_fan(face), mesh);
  return mesh;
}

TriangleMesh triangles_of(const Shape& shape, const Fineness& fineness) {
  return std::visit([&](const auto& s) { return triangles_of(s, fineness); }, shape);
}

double size_of(const TriangleMesh& mesh) {
  return (mesh.positions.colwise().maxCoeff() - mesh.positions.colwise().minCoeff()).maxCoeff();
}

/// Joins what rounding has set apart. There are few corners, so each is compared with all.
TriangleMesh joined(const TriangleMesh& mesh, double tolerance) {
  TriangleMesh out;
  out.positions.resize(mesh.num_vertices(), 3);
  std::vector<int> number;
  int count = 0;
  for (Eigen::Index v = 0; v < mesh.positions.rows(); ++v) {
    int same = 0;
    while (same < count &&
           (out.positions.row(same) - mesh.positions.row(v)).lpNorm<Eigen::Infinity>() > tolerance)
      ++same;
    if (same == count) out.positions.row(count++) = mesh.positions.row(v);
    number.push_back(same);
  }
  out.positions.conservativeResize(count, 3);
  const auto renumbered = [&](int v) { return number[static_cast<std::size_t>(v)]; };
  for (const Triangle& t : mesh.triangles) {
    const Triangle u{renumbered(t[0]), renumbered(t[1]), renumbered(t[2])};
    if (u[0] != u[1] && u[1] != u[2] && u[2] != u[0]) out.triangles.push_back(u);
  }
  return out;
}

TriangleMesh closed_polyhedron(const HalfSpaces& solid, const std::string& name) {
  // Cut off at first where no scene reaches, then near it, where rounding is smaller.
  constexpr double kFar = 1e7, kRounding = 1e-9;
  const double size = size_of(triangles_of(solid, {kFar, 1}));
  if (!(size < 0.1 * kFar))
    throw InputError(fmt::format(
        "{}: its planes leave a side open, which no triangles close; add planes, or leave out "
        "\"surface\"",
        name));
  return joined(triangles_of(solid, {4 * size, 1}), kRounding * size);
}

}  // namespace

TriangleMesh tessellate(const Shape& shape, double extent) {
  return triangles_of(shape, {extent, kRoundInPictures});
}

TriangleMesh closed_surface(const Shape& shape, int quarter, const std::string& name) {
  if (const auto* solid = std::get_if<HalfSpaces>(&shape)) return closed_polyhedron(*solid, name);
  return triangles_of(shape, {0, quarter});
}

}  // namespace piecework::colliders
