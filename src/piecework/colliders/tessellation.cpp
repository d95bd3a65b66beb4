#include <piecework/colliders/tessellation.hpp>

#include <cmath>
#include <numbers>
#include <vector>

#include <piecework/mesh/solids.hpp>

namespace piecework::colliders {
namespace {

using mesh::TriangleMesh;

// Chords of a full circle, and of a quarter of it. Chosen: round at the size of a picture.
constexpr int kColumns = 64;
constexpr int kQuarter = kColumns / 4;

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
void add_arc(std::vector<Vec2>& profile, const Vec2& center, double rounding) {
  for (int k = 0; k <= kQuarter; ++k) {
    const double angle = 0.5 * std::numbers::pi * k / kQuarter;
    profile.push_back(center + rounding * Vec2(std::cos(angle), std::sin(angle)));
  }
}

/// Surface of revolution of the profile, from the side to the top pole, and its mirror image below.
TriangleMesh turned(const std::vector<Vec2>& upper) {
  std::vector<Vec2> profile;
  for (auto p = upper.rbegin(); p != upper.rend(); ++p) profile.emplace_back(p->x(), -p->y());
  const bool meets = upper.front().y() == 0;
  profile.insert(profile.end(), upper.begin() + (meets ? 1 : 0), upper.end());
  return mesh::lathe(profile, kColumns);
}

TriangleMesh triangles_of(const Plane& plane, double extent) {
  return polygon_fan(HalfSpaces({plane}).faces(extent).front());
}

TriangleMesh triangles_of(const Sphere& sphere, double) {
  return placed(mesh::icosphere(sphere.radius, kQuarter), sphere.center, Vec3::UnitY());
}

TriangleMesh triangles_of(const Capsule& capsule, double) {
  const Vec3 axis = capsule.to - capsule.from;
  std::vector<Vec2> upper;
  add_arc(upper, Vec2(0, 0.5 * axis.norm()), capsule.radius);
  upper.back().x() = 0;  // the pole
  return placed(turned(upper), 0.5 * (capsule.from + capsule.to),
                axis.isZero(0) ? Vec3(Vec3::UnitY()) : axis);
}

TriangleMesh triangles_of(const Box& box, double) {
  return placed(mesh::box(2 * box.half_size, box.rounding, kQuarter / 2), box.center,
                Vec3::UnitY());
}

TriangleMesh triangles_of(const Cylinder& cylinder, double) {
  const Vec3 axis = cylinder.to - cylinder.from;
  const Vec2 rim(cylinder.radius, 0.5 * axis.norm());
  std::vector<Vec2> upper;
  if (cylinder.rounding > 0)
    add_arc(upper, rim.array() - cylinder.rounding, cylinder.rounding);
  else
    upper.push_back(rim);
  if (cylinder.rounding < cylinder.radius)
    upper.emplace_back(0, rim.y());
  else
    upper.back().x() = 0;
  return placed(turned(upper), 0.5 * (cylinder.from + cylinder.to), axis);
}

TriangleMesh triangles_of(const HalfSpaces& solid, double extent) {
  TriangleMesh mesh;
  for (const std::vector<Vec3>& face : solid.faces(extent)) mesh::append(polygon_fan(face), mesh);
  return mesh;
}

}  // namespace

TriangleMesh tessellate(const Shape& shape, double extent) {
  return std::visit([&](const auto& s) { return triangles_of(s, extent); }, shape);
}

}  // namespace piecework::colliders
