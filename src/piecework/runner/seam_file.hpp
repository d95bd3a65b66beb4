#pragma once

// Sewing patterns in files: *.seams.json. Private to the module.

#include <array>
#include <string>
#include <vector>

namespace piecework::runner {

/// One seam of a file, as chains or as stitches; vertices in the order of the mesh's file.
struct FileSeam {
  std::string name;                             ///< "left_ftorso to left_hood", "seam 3"
  std::vector<int> chain, to_chain;             ///< both or none
  std::vector<std::array<double, 4>> stitches;  ///< vertex, a, b, ratio
};

/// Reads {"seams": [{"a": {"panel", "verts"}, "b": ...}], "seam_stitches": [[[v, a, b, r], ...]]}:
/// one of the two or both; other keys are ignored.
/// \throws InputError that names the file and what it lacks.
std::vector<FileSeam> read_seam_file(const std::string& path);

}  // namespace piecework::runner
