#pragma once

// PLY, STL and glTF through assimp. Internal to mesh/.

#include <cstddef>
#include <filesystem>
#include <string>

#include <piecework/mesh/raw_mesh.hpp>

namespace piecework::mesh {

/// Reads a file with assimp's importers for its extension, in a child process (run_in_child): some
/// broken files crash assimp or keep it busy for ever. Post-processing is off, so vertices and
/// polygons keep the order of the file, and nothing of assimp follows an index before it is checked
/// here. One group per node; node transforms are applied (skins are not). Other files are opened
/// only in the same folder or below it. Coordinates have float precision. \param extension  lower
/// case with its dot: ".ply", ".stl", ".gltf" or ".glb" \throws InputError as import_mesh()
RawMesh read_with_assimp(const std::filesystem::path& path, const std::string& extension,
                         std::size_t max_triangles);

}  // namespace piecework::mesh
