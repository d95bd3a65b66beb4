#pragma once

// Meshes to files, in the user's own vertex order, each file written atomically.

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include <piecework/mesh/triangle_mesh.hpp>

namespace piecework::mesh {

enum class ExportFormat { Ply, Obj, Vtp };

/// One mesh of a frame: `document` as loaded, `positions` (|V| x 3, m) of its simulation vertices
/// now.
struct ExportPart {
  const MeshDocument* document;
  Eigen::Ref<const Positions> positions;
  std::string name;
  std::vector<int> triangle_domain;  ///< per simulation triangle; may be empty
};

/// Writes the parts as one file, vertices in file order, part after part.
///   Ply  binary little-endian, double x y z; faces uchar count, int indices; "domain" per face
///        when all parts have domains and triangulated faces
///   Obj  %.17g, polygons, texture coordinates and groups as in the source file
///   Vtp  VTK XML PolyData, binary appended doubles, "domain" cell data
/// \throws OutputError; the old file is then untouched.
void export_meshes(const std::filesystem::path& path, ExportFormat format,
                   std::span<const ExportPart> parts);

/// "ply", "obj", "vtp".
const char* extension(ExportFormat format);

}  // namespace piecework::mesh
