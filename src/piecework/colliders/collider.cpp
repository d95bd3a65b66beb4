#include <piecework/colliders/collider.hpp>

#include <cmath>
#include <utility>

#include <fmt/format.h>

#include <piecework/colliders/tessellation.hpp>
#include <piecework/core/error.hpp>
#include <piecework/mesh/topology.hpp>

namespace piecework::colliders {
namespace {

/// Untouched coordinates keep their bits.
template <class Transform>
void apply(const Transform& transform, Positions& x) {
  if (!transform.linear().isIdentity(0)) x = x * transform.linear().transpose();
  if (!transform.translation().isZero(0)) x.rowwise() += transform.translation().transpose();
}

bool is_closed(const Triangles& triangles) {
  const std::vector<mesh::HalfEdge> sides = mesh::sorted_half_edges(triangles);
  if (sides.size() % 2 != 0) return false;
  for (std::size_t i = 0; i < sides.size(); i += 2) {
    const mesh::HalfEdge& a = sides[i];
    const mesh::HalfEdge& b = sides[i + 1];
    const bool crowded = i + 2 < sides.size() && sides[i + 2].v0 == a.v0 && sides[i + 2].v1 == a.v1;
    if (a.v0 != b.v0 || a.v1 != b.v1 || a.v0 == a.v1 || a.forward == b.forward || crowded)
      return false;
  }
  return true;
}

void check(const std::string& name, const mesh::TriangleMesh& mesh,
           const Eigen::Affine3d& placement) {
  if (mesh.triangles.empty())
    throw InputError(fmt::format("{}: no triangles; give a mesh that has some", name));
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const int v : mesh.triangles[t])
      if (v < 0 || v >= mesh.num_vertices())
        throw InputError(fmt::format("{}: triangle {} names vertex {} of {}; correct the mesh",
                                     name, t, v, mesh.num_vertices()));
  for (Eigen::Index v = 0; v < mesh.positions.rows(); ++v)
    if (!mesh.positions.row(v).allFinite())
      throw InputError(
          fmt::format("{}: vertex {} is not at a finite position; correct the mesh", name, v));
  const double determinant = placement.linear().determinant();
  if (!placement.matrix().allFinite() || determinant == 0)
    throw InputError(fmt::format("{}: its scale flattens it; give factors other than 0", name));
}

}  // namespace

AnalyticCollider::AnalyticCollider(Traits traits, Shape shape, const Eigen::Isometry3d& placement,
                                   RigidMotion motion)
    : traits_(std::move(traits)),
      shape_(std::move(shape)),
      placement_(placement),
      motion_(std::move(motion)) {
  validate(shape_, traits_.name);
}

SignedDistance AnalyticCollider::signed_distance(const Vec3& x,
                                                 const Eigen::Isometry3d& pose) const {
  const Vec3 local = pose.linear().transpose() * (x - pose.translation());
  const SignedDistance inner = colliders::signed_distance(shape_, local);
  return {inner.distance, pose.linear() * inner.normal};
}

Vec3 AnalyticCollider::carried(const Vec3& x, double t0, double t1) const {
  if (is_static()) return x;
  const Eigen::Isometry3d before = motion_.at(t0);
  return motion_.at(t1) * Vec3(before.linear().transpose() * (x - before.translation()));
}

mesh::TriangleMesh AnalyticCollider::tessellate(double time, double extent) const {
  mesh::TriangleMesh mesh = colliders::tessellate(shape_, extent);
  apply(pose(time), mesh.positions);
  return mesh;
}

MeshCollider::MeshCollider(Traits traits, mesh::TriangleMesh mesh, const Eigen::Affine3d& placement,
                           RigidMotion motion, Deformation deformation)
    : traits_(std::move(traits)),
      mesh_(std::move(mesh)),
      placement_(placement),
      motion_(std::move(motion)),
      deformation_(std::move(deformation)),
      closed_(is_closed(mesh_.triangles)) {
  check(traits_.name, mesh_, placement_);
  if (placement_.linear().determinant() < 0)
    for (Triangle& t : mesh_.triangles) std::swap(t[1], t[2]);
  apply(placement_, mesh_.positions);
}

void MeshCollider::positions_at(double time, Positions& x) const {
  if (deformation_) {
    deformation_(time, x);
    apply(placement_, x);
  } else {
    x = mesh_.positions;
  }
  if (!motion_.is_static()) apply(motion_.at(time), x);
}

}  // namespace piecework::colliders
