#pragma once

// What the reader takes from the file of an animated figure, before any check but that of indices.
// Internal to mesh/. Flat vectors, since it comes out of a child process as bytes.

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include <piecework/core/types.hpp>

namespace piecework::mesh {

/// Keys of one kind (positions, rotations or scales) of all tracks of a clip.
struct AvatarKeys {
  std::vector<int> begin;                          ///< offsets per track, one more than tracks
  std::vector<double> time;                        ///< s
  std::vector<Eigen::Matrix<double, 4, 1>> value;  ///< x, y, z, 0; rotations: w, x, y, z
};

struct AvatarFile {
  std::string file;  ///< opens every message

  std::string node_names;          ///< one a line
  std::vector<int> node_parent;    ///< -1 for roots; parents come before children
  std::vector<double> node_local;  ///< 16 per node, by rows: to the parent's coordinates

  std::vector<Vec3> positions;   ///< in coordinates of the mesh, file units
  std::vector<int> vertex_node;  ///< the node that carries the mesh of the vertex
  std::vector<int> vertex_mesh;  ///< its mesh, as it is placed: a mesh under two nodes counts twice
  std::vector<int> polygon_begin;  ///< offsets into polygon_vertex, one more than polygons
  std::vector<int> polygon_vertex;

  std::vector<int> joint_node;       ///< per joint of a mesh
  std::vector<int> joint_mesh;       ///< as vertex_mesh
  std::vector<double> joint_offset;  ///< 16 per joint, by rows: from the mesh to the node, bound
  std::vector<int> weight_vertex;
  std::vector<int> weight_joint;
  std::vector<double> weight;

  std::vector<double> duration;  ///< of the clip, s; empty: no clip
  std::string clip;              ///< its name
  std::vector<int> track_node;
  AvatarKeys moves, turns, scales;
  std::string notes;  ///< one a line
};

/// Reads a figure and one of its clips in a child process. \param clip  empty: the only one, if any
/// \throws InputError as import_mesh(); if there is no such clip, or several and none is named; if
///         there are no triangles, indices are out of range, or joints and tracks name no
///         node, or several
AvatarFile read_avatar_file(const std::filesystem::path& path, const std::string& extension,
                            const std::string& clip, std::size_t max_triangles);

}  // namespace piecework::mesh
