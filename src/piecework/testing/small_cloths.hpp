#pragma once

// Small cloths for tests and benchmarks, made without the generators that they help to test.

#include <optional>

#include <piecework/mesh/triangle_mesh.hpp>
#include <piecework/model/constraints.hpp>

namespace piecework::testing {

/// columns x rows vertices over size x size metres in the xz plane (x fastest), diagonals
/// alternating from cell to cell.
mesh::TriangleMesh grid_mesh(int columns, int rows, double size = 1.0);

/// A closed sphere of radius r: subdivided octahedron, 4^level * 8 triangles.
mesh::TriangleMesh sphere_mesh(int level, double radius = 1.0);

/// Two meshes side by side in one, not connected.
mesh::TriangleMesh disjoint_union(const mesh::TriangleMesh& a, const mesh::TriangleMesh& b);

/// Cotton of scene A: 0.5 kg/m^2, 261.08 N/m, and the given bending stiffness (N m).
model::Material cotton(std::optional<double> bending = 7.014e-6);

/// A model whose rest shape is the mesh.
model::ClothModel cloth_model(const mesh::TriangleMesh& mesh, const model::Material& material);

/// Random numbers in [-size, size], seeded.
Positions random_positions(int rows, double size, std::uint64_t seed);

}  // namespace piecework::testing
