#pragma once

// Mends what import_mesh() would refuse, on request. Internal to mesh/.

#include <string>
#include <vector>

#include <piecework/mesh/work_mesh.hpp>

namespace piecework::mesh {

/// Drops zero-area, duplicate and out-of-manifold triangles (of an edge with more than two the
/// first matching pair stays) and isolated vertices, gives each fan of a bow-tie vertex its own
/// vertex (added after all others, in the file's polygons as well), and turns the minority of each
/// component's triangles to one orientation. One note per kind of repair that did something.
/// Positions are not moved.
/// \throws InputError if a component is one-sided (a Moebius strip).
void repair(RawMesh& raw, WorkMesh& work, std::vector<std::string>& notes);

}  // namespace piecework::mesh
