#pragma once

// Solids whose signed distance has a closed form.
//
// Distances are Euclidean and exact, outside and inside, so they are 1-Lipschitz; the normal is
// the gradient wherever there is one. Where there is none (centres, axes, bisectors of faces) it
// is one of the directions nearby, always of unit length, by the rule that each shape states.

#include <string>
#include <variant>
#include <vector>

#include <piecework/core/types.hpp>

namespace piecework::colliders {

struct SignedDistance {
  double distance;  ///< m; negative inside
  Vec3 normal;      ///< outward, unit length
};

/// The half-space below a plane.
struct Plane {
  Vec3 point = Vec3::Zero();    ///< m
  Vec3 normal = Vec3::UnitY();  ///< outward, of any length but 0
};

/// At its centre the normal is +y.
struct Sphere {
  Vec3 center = Vec3::Zero();  ///< m
  double radius = 1;           ///< m
};

/// All points within `radius` of a segment, which may be a point (whose direction counts as +y). On
/// the segment the normal is perpendicular to it.
struct Capsule {
  Vec3 from = Vec3::Zero();  ///< m
  Vec3 to = Vec3::UnitY();   ///< m
  double radius = 1;         ///< m
};

/// Edges parallel to x, y and z. Where several faces are equally near the normal is that of the
/// first in the order +x, -x, +y, ...
struct Box {
  Vec3 center = Vec3::Zero();          ///< m
  Vec3 half_size = Vec3::Constant(1);  ///< m
  double rounding = 0;                 ///< radius of edges and corners, m; the box keeps its size
};

/// A solid cylinder with flat ends. On its axis the normal of the side is perpendicular to the
/// axis; where side and end are equally near the side wins.
struct Cylinder {
  Vec3 from = Vec3::Zero();  ///< middle of one end, m
  Vec3 to = Vec3::UnitY();   ///< middle of the other, m
  double radius = 1;         ///< m
  double rounding = 0;       ///< radius of the rims, m; the cylinder keeps its size
};

/// What lies below all of some planes: a convex polyhedron, a corner, a slab, a wedge. Where
/// several faces are equally near the normal is that of the first.
class HalfSpaces {
 public:
  static constexpr std::size_t kMaxPlanes = 64;

  /// \param rounding  radius of edges and corners, m; the faces stay where they are
  /// \throws InputError if there are no planes or more than kMaxPlanes, if a normal has no
  ///         direction, or if no point lies below all planes (moved inward by `rounding`)
  explicit HalfSpaces(const std::vector<Plane>& planes, double rounding = 0);

  /// Corners of each face, counter-clockwise seen from outside, unbounded faces cut off `extent`
  /// (m) away from the middle of the corners (without corners: from the origin). Not rounded.
  [[nodiscard]] std::vector<std::vector<Vec3>> faces(double extent) const;

  [[nodiscard]] SignedDistance signed_distance(const Vec3& p) const;

 private:
  struct Face {
    Vec3 normal;    ///< unit length
    double offset;  ///< normal . x <= offset, m
  };
  /// The part of the line through two faces that lies below all others.
  struct Edge {
    Vec3 origin, direction;
    double begin, end;  ///< may be infinite
  };

  /// Of parallel faces only the lowest counts.
  void add_face(const Face& face);
  void find_edges();
  [[nodiscard]] bool contains(const Vec3& p) const;
  /// The nearest point of the solid, or nothing if it is empty. \pre p lies outside
  [[nodiscard]] bool nearest(const Vec3& p, Vec3& foot) const;

  std::vector<Face> faces_;  ///< moved inward by rounding_
  std::vector<Edge> edges_;
  double rounding_;
};

using Shape = std::variant<Plane, Sphere, Capsule, Box, Cylinder, HalfSpaces>;

/// Distance of p (m) from the surface, and the direction away from it.
SignedDistance signed_distance(const Shape& shape, const Vec3& p);

/// \throws InputError "<name>: ..." if a number is not finite, a size is not above 0, a direction
/// is
///         missing or a rounding is larger than the shape.
void validate(const Shape& shape, const std::string& name);

}  // namespace piecework::colliders
