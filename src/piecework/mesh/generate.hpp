#pragma once

// Built-in meshes: sheets, strips, tubes, discs, quilts; and closed bodies. Deterministic in their
// parameters.

#include <cstdint>
#include <string>

#include <piecework/mesh/triangle_mesh.hpp>

namespace piecework::mesh {

/// Triangulation of a rectangular sheet.
enum class SheetPattern {
  Alternating,  ///< diagonals alternate cell to cell (scene A of the benchmarks)
  OneDiagonal,  ///< all diagonals one way; anisotropic in bending
  Delaunay,     ///< jittered grid, edges flipped until Delaunay: irregular, no preferred direction
};

/// Parameters of every generator; each uses the ones named in its line of GeneratorKind.
struct GeneratorOptions {
  double width = 1.0;   ///< m, along x
  double height = 1.0;  ///< m, along z (sheets), y (tube, bodies)
  double depth = 1.0;   ///< m, along z (box, stairs)
  int columns = 50;     ///< vertices along the width (tube: around)
  int rows = 50;        ///< vertices along the height (disc: rings)
  double radius = 0.5;  ///< m; tube, disc, icosphere, funnel, pot
  SheetPattern pattern = SheetPattern::Alternating;
  double jitter = 0.3;  ///< fraction of the cell by which inner vertices of Delaunay sheets move
  std::uint64_t seed = 1;
  int patches_x = 2;  ///< quilt: patches along the width
  int patches_y = 2;  ///< quilt: patches along the height
};

enum class GeneratorKind {
  Sheet,  ///< width x height in the xz plane, columns x rows vertices, corner (0,0,0) first,
          ///< x fastest; sets: corners, left (x=0), right, bottom (z=0), top, border
  Strip,  ///< a Sheet meant to be long; same parameters and sets
  Tube,   ///< open cylinder around y; radius, height, columns x rows; sets: bottom, top, border
  Disc,   ///< flat disc in the xz plane; radius, rows rings, columns around the rim; sets: border,
          ///< center
  Quilt,  ///< patches_x x patches_y sheets of width x height in all, each meshed with its own
          ///< density and pattern, conforming along shared borders, one group per patch
  // Bodies (solids.hpp): closed, so that their set "border" is empty.
  Icosphere,  ///< ball about the origin; radius, rows parts of each edge of the icosahedron
  Box,        ///< width x height x depth on y = 0, its middle above the origin
  Stairs,     ///< width x height x depth, rows steps that climb along +z from the origin
  Funnel,     ///< radius, height, columns around; on y = 0
  Pot,        ///< radius, columns around; on y = 0
};

/// \throws InputError with the parameter and its allowed range (fewer than 2 rows, non-positive or
///         non-finite sizes, more than kMaxTriangles triangles).
MeshDocument generate(GeneratorKind kind, const GeneratorOptions& options);

/// Names for the scene file: "sheet", "strip", ...; "alternating", ...
const char* to_string(GeneratorKind kind);
const char* to_string(SheetPattern pattern);

}  // namespace piecework::mesh
