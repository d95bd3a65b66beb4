#pragma once

// The quilt generator. Internal to mesh/; parameters are checked by generate().

#include <vector>

#include <piecework/mesh/generate.hpp>

namespace piecework::mesh {

inline constexpr int kMinPatchCells = 3;         ///< cells a quilt patch needs along each side
inline constexpr double kMaxQuiltDensity = 1.4;  ///< inner vertices per length, relative to borders

/// Patches share the vertices of their borders, which are spaced as columns and rows say (rounded
/// down to whole cells per patch). Inside, densities of 1, 0.7 and 1.4 times that and the three
/// sheet patterns take turns from patch to patch. Vertex 0 is the corner (0,0,0).
MeshDocument generate_quilt(const GeneratorOptions& options);

/// Lays points (x, -z) out in the xz plane; texture coordinates are the points moved up by
/// `offset`. \pre document.mesh.triangles is complete
void set_flat_positions(const std::vector<Vec2>& points, double offset, MeshDocument& document);

}  // namespace piecework::mesh
