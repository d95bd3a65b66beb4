#pragma once

// Strict reader of Wavefront OBJ. Internal to mesh/.

#include <cstddef>
#include <string>
#include <string_view>

#include <piecework/mesh/raw_mesh.hpp>

namespace piecework::mesh {

/// Reads v, vt, f, g and o lines of `text`; normals, materials and unknown keywords are skipped,
/// `l` and `p` elements too (with a note). Numbers keep double precision, vertices and faces their
/// order. A vertex may have a weight and a colour after its coordinates (ignored).
/// \param file  opens the messages: "<file>:<line>: <problem>; <remedy>".
/// \throws InputError for anything that is not a number where one belongs, non-finite numbers,
///         faces with fewer than 3 corners, indices of 0 or out of range, no faces at all, more
///         than `max_triangles` triangles.
RawMesh read_obj(const std::string& file, std::string_view text, std::size_t max_triangles);

}  // namespace piecework::mesh
