#pragma once

// Sharp edges of bodies, which smooth normals would hide.

#include <renderer/display_mesh.hpp>

namespace piecework::render {

/// Where triangles around a vertex meet at more than `degrees`, gives each smooth part a vertex of
/// its own, at the same place; new vertices follow the old ones. Normals are not set.
void split_at_creases(DisplayMesh& mesh, float degrees);

}  // namespace piecework::render
