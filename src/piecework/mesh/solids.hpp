#pragma once

// Closed surfaces for bodies: turned, swept, subdivided. Triangles face outward.

#include <span>

#include <piecework/mesh/triangle_mesh.hpp>

namespace piecework::mesh {

/// Adds the triangles and vertices of `piece` behind those of `mesh`.
void append(const TriangleMesh& piece, TriangleMesh& mesh);

/// Surface of revolution about y. `profile` lists (radius, height), m, outside to its right: up the
/// outside, down the inside. With radius 0 (exactly) at both ends it closes there in two poles;
/// with radius above 0 everywhere its last point is joined to its first: a ring.
/// \pre at least 2 points between poles or 3 in a ring; radius above 0 between the ends; columns >=
/// 3
TriangleMesh lathe(std::span<const Vec2> profile, int columns);

/// A tube along a path with flat ends: circles of the given radii (m) perpendicular to it, which
/// turn as little as possible along it [Wang et al. 2008, double reflection].
/// \pre at least 2 points, no two successive ones equal; as many radii, above 0; columns >= 3
TriangleMesh sweep(std::span<const Vec3> path, std::span<const double> radii, int columns);

/// Sphere about the origin from an icosahedron whose edges are cut into `parts`: 20 parts^2
/// triangles, all vertices at `radius` (m). \pre parts >= 1
TriangleMesh icosphere(double radius, int parts);

/// Box about the origin, edges and corners rounded with `rounding` (m) in arcs of `segments`
/// chords; with `rounding` 0 it has 8 vertices.
/// \pre 0 <= rounding <= half of the smallest size; segments >= 1
TriangleMesh box(const Vec3& size, double rounding = 0, int segments = 1);

/// Stairs that climb along +z, solid down to the ground: `steps` steps in width x height x depth
/// (x, y, z; m), the middle of the lowest front edge in the origin. \pre steps >= 1
TriangleMesh stairs(const Vec3& size, int steps);

/// A funnel about y: a cone from `radius` (m) down to a spout of a fifth of it, `height` high in
/// all (m), with walls a twentieth of the radius thick and round rims; its spout stands on y = 0.
/// \pre columns >= 3
TriangleMesh funnel(double radius, double height, int columns);

/// A round pot with lid, spout (towards +x) and handle, four closed pieces that overlap; its
/// belly has `radius` (m), its foot stands on y = 0, in all it is 1.7 radii high. \pre columns >= 8
TriangleMesh pot(double radius, int columns);

}  // namespace piecework::mesh
