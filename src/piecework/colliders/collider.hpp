#pragma once

// Bodies that cloth collides with; their motion is prescribed. All lengths m, all times s.

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <piecework/colliders/motion.hpp>
#include <piecework/colliders/shapes.hpp>
#include <piecework/mesh/triangle_mesh.hpp>

namespace piecework::colliders {

/// Coefficients of dry friction.
struct Friction {
  double sticking = 0;        ///< up to which nothing slides, mu_s
  double sliding = sticking;  ///< of what slides, mu_k <= mu_s

  bool operator==(const Friction&) const = default;
};

/// What every collider has.
struct Traits {
  std::string name;
  std::optional<Friction> friction;  ///< absent: that of the scene
  std::optional<double> thickness;   ///< distance that cloth keeps, m; absent: that of the scene
};

/// A solid with a closed form, placed and moved rigidly.
class AnalyticCollider {
 public:
  /// \param placement  from the shape's coordinates to its place before the motion
  /// \throws InputError as validate(shape, name)
  AnalyticCollider(Traits traits, Shape shape, const Eigen::Isometry3d& placement,
                   RigidMotion motion);

  [[nodiscard]] const Traits& traits() const { return traits_; }
  [[nodiscard]] const Shape& shape() const { return shape_; }
  [[nodiscard]] const RigidMotion& motion() const { return motion_; }
  [[nodiscard]] bool is_static() const { return motion_.is_static(); }

  /// From the shape's coordinates to its place at `time`.
  [[nodiscard]] Eigen::Isometry3d pose(double time) const { return motion_.at(time) * placement_; }

  /// Of the point x in the world, with the normal in the world.
  [[nodiscard]] SignedDistance signed_distance(const Vec3& x, double time) const {
    return signed_distance(x, pose(time));
  }
  /// The same, for many points at one time: `pose` is pose(time).
  [[nodiscard]] SignedDistance signed_distance(const Vec3& x, const Eigen::Isometry3d& pose) const;

  /// Where a point that is at x at time t0 and moves with the body is at t1.
  [[nodiscard]] Vec3 carried(const Vec3& x, double t0, double t1) const;

  /// Triangles at `time`, for pictures: all vertices on the surface. What is unbounded is cut off
  /// at about `extent`. The triangles are the same at all times.
  [[nodiscard]] mesh::TriangleMesh tessellate(double time, double extent) const;

 private:
  Traits traits_;
  Shape shape_;
  Eigen::Isometry3d placement_;
  RigidMotion motion_;
};

/// Shape of a body over time, before it is placed: writes |V| x 3 positions at a time. Must give
/// the same bits for the same time, and be callable from several threads.
using Deformation = std::function<void(double time, Positions& out)>;

/// A triangle mesh that stands, moves rigidly or deforms as a sequence of meshes or an avatar does.
class MeshCollider {
 public:
  /// \param mesh  shape in its own coordinates; where it deforms, the shape at time 0
  /// \param placement  from its own coordinates to its place before the motion
  /// \param deformation  empty: none
  /// \throws InputError "<name>: ..." if a vertex number is out of range, a position is not finite,
  ///         there are no triangles, or the placement loses a dimension
  MeshCollider(Traits traits, mesh::TriangleMesh mesh, const Eigen::Affine3d& placement,
               RigidMotion motion, Deformation deformation = {});

  [[nodiscard]] const Traits& traits() const { return traits_; }
  /// Outward for a closed mesh with positive volume; turned by a mirroring placement.
  [[nodiscard]] const Triangles& triangles() const { return mesh_.triangles; }
  [[nodiscard]] int num_vertices() const { return mesh_.num_vertices(); }
  [[nodiscard]] bool is_static() const { return !deformation_ && motion_.is_static(); }
  /// Every edge has two triangles that run through it in opposite directions.
  [[nodiscard]] bool closed() const { return closed_; }

  /// \param[out] x  num_vertices() x 3; resized if it has another size
  void positions_at(double time, Positions& x) const;

 private:
  Traits traits_;
  mesh::TriangleMesh mesh_;  ///< placed, unless it deforms
  Eigen::Affine3d placement_;
  RigidMotion motion_;
  Deformation deformation_;
  bool closed_;
};

}  // namespace piecework::colliders
