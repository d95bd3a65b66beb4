#pragma once

// Meshes from files: OBJ by our own strict reader (it keeps the user's vertex order, quads, groups
// and double precision, all of which assimp drops), PLY, STL, glTF through assimp in a child
// process with limits, since hostile files crash its readers.

#include <cstddef>
#include <filesystem>

#include <piecework/mesh/triangle_mesh.hpp>

namespace piecework::mesh {

enum class UpAxis { X, Y, Z };

/// More triangles than this are refused by every importer and generator.
inline constexpr std::size_t kMaxTriangles = 20'000'000;

struct ImportOptions {
  double unit_in_metres = 1.0;  ///< what one unit of the file measures, m
  UpAxis up_axis = UpAxis::Y;   ///< axis that points up in the file; turned to y
  /// Mend what can be mended safely: drop zero-area, duplicate and out-of-manifold triangles and
  /// isolated vertices, split bow-tie vertices (the new ones come after all others), turn triangles
  /// to one orientation. Each repair is noted.
  bool repair = false;
  /// Merge vertices of one group at exactly the same position where the surface is split along
  /// edges (UV and normal seams, STL). Inner vertices and mere contact points stay apart.
  bool weld = true;
  std::size_t max_triangles = kMaxTriangles;
};

/// Reads a mesh, welds it, checks it (and repairs it if asked). Groups are the OBJ's g and o lines
/// or the nodes of a glTF. Texture coordinates are taken as metres, whatever the unit.
/// \throws InputError that names file, item and remedy: file missing, empty, truncated or of an
///         unknown kind; NaN or infinite coordinates; index out of range; zero-area triangles;
///         duplicate faces; edges with more than two triangles; vertices whose triangles do not
///         form one fan; inconsistent orientation; isolated vertices; more than max_triangles.
MeshDocument import_mesh(const std::filesystem::path& path, const ImportOptions& options);

/// Where the vertices of `mesh` are in `other`, a file with the same vertices and faces in another
/// shape (the rest shape of a draped garment): one row per simulation vertex of `mesh`, m. Vertices
/// are matched by their number in the files, so it does not matter that the two shapes may have cut
/// their quads along different diagonals; use the triangles of `mesh` with the result.
/// \param other_name  opens the messages
/// \throws InputError if the files differ in the number of vertices or in their faces, or if
///         vertices that were welded in `mesh` are apart in `other`.
Positions corresponding_positions(const MeshDocument& mesh, const MeshDocument& other,
                                  const std::string& other_name);

/// The checks of import_mesh() on any mesh. `name` opens the message.
/// \throws InputError as above.
void validate(const TriangleMesh& mesh, const std::string& name);

}  // namespace piecework::mesh
