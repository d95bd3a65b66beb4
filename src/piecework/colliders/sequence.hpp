#pragma once

// Bodies that change their shape from file to file.

#include <string>
#include <vector>

#include <piecework/colliders/collider.hpp>
#include <piecework/mesh/import.hpp>

namespace piecework::colliders {

struct SequenceFiles {
  /// Path with one "{}" or "{:0N}" where the frame's number stands, with N digits or more.
  std::string pattern;
  int first = 0, last = 0;  ///< numbers of the frames, last included
  double fps = 30;          ///< frames per second
  double start = 0;         ///< time of the first frame, s
  mesh::ImportOptions import;
};

struct MeshSequence {
  mesh::TriangleMesh mesh;  ///< first frame, m
  /// Linear between frames; before the first and after the last the body stands still.
  Deformation deformation;
  std::vector<std::string> notes;  ///< of the first frame
};

/// Name of the file of one frame. \throws InputError if the pattern has no place for the number, or
/// more than one
std::string frame_file(const std::string& pattern, int frame);

/// Reads all frames. They must have the vertices and faces of the first one.
/// \throws InputError as import_mesh() and corresponding_positions(), with the file of the frame;
///         if `last` is below `first`; if all frames together have more than 1e9 coordinates
MeshSequence load_sequence(const SequenceFiles& files);

}  // namespace piecework::colliders
