#pragma once

// Animated figures: linear blend skinning and rigid parts on a tree of nodes.

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <piecework/mesh/import.hpp>
#include <piecework/mesh/triangle_mesh.hpp>

namespace piecework::mesh {

enum class AvatarLead {
  BindPose,   ///< moves from the bind pose to the first pose
  FirstPose,  ///< holds the first pose
};

struct AvatarOptions {
  double unit_in_metres = 1.0;  ///< what one unit of the file measures, m
  UpAxis up_axis = UpAxis::Y;   ///< axis that points up in the file; turned to y
  std::string clip;             ///< name; empty: the only one, if any
  double start_time = 0;        ///< of the clip, at the end of the lead-in, s
  double lead_in = 0;           ///< s
  AvatarLead lead = AvatarLead::BindPose;
  std::size_t max_triangles = kMaxTriangles;
};

/// A figure and one of its clips, ready to be asked where it is.
///
/// A vertex bound to joints j with weights w_j, sum 1, is at
///     x(t) = sum_j w_j G_j(t) B_j v
/// v its place in its mesh, B_j from the mesh to the joint as it was bound, G_j the product of the
/// transforms of the nodes from the root to the joint. A part without joints is bound to its node
/// with B = 1. Nodes move by keys: positions and scales linearly, rotations by slerp in between;
/// before the first and after the last key they stand. Step and cubic interpolation of glTF are
/// read as linear, and morph targets are left out. All in double from the float numbers of the
/// file.
///
/// Bind pose: that of the nodes as the file places them without a clip.
/// Time 0 ... lead_in: see AvatarLead; then the clip from start_time to its end, then its last
/// pose.
class Avatar {
 public:
  Avatar(Avatar&&) noexcept;
  Avatar& operator=(Avatar&&) noexcept;
  ~Avatar();

  /// Triangles of the welded figure: vertices of the file at the same place that move alike (where
  /// texture or material changes) are one. Triangles that lose a corner thereby are dropped.
  [[nodiscard]] const Triangles& triangles() const;
  [[nodiscard]] int num_vertices() const;
  /// Vertex of the file (mesh after mesh, as nodes list them) -> vertex; -1 if no triangle uses it.
  [[nodiscard]] const std::vector<int>& vertex_map() const;

  /// \param[out] x  num_vertices() x 3, m, y up; the same bits for every number of threads
  void positions_at(double time, Positions& x) const;
  void bind_pose(Positions& x) const;

  [[nodiscard]] bool moves() const;       ///< there is a clip
  [[nodiscard]] double duration() const;  ///< of the clip, s; 0 without one
  [[nodiscard]] const std::string& clip() const;
  [[nodiscard]] const std::vector<std::string>& notes() const;

 private:
  friend Avatar import_avatar(const std::filesystem::path& path, const AvatarOptions& options);
  struct Figure;
  explicit Avatar(std::unique_ptr<const Figure> figure);
  std::unique_ptr<const Figure> figure_;
};

/// Reads a figure from .gltf, .glb or .fbx, in a child process with limits as import_mesh().
/// Weights are scaled to a sum of 1; a vertex without any follows the joint of its mesh that is
/// nearest in the bind pose. Both are noted.
/// \throws InputError that names file, item and remedy: as import_mesh() for the file itself; no
///         triangles (a file with motion only); an unknown clip, or several and none is named (the
///         text lists them); start_time after its end; key times that do not increase; rotations
///         that are no quaternion; bind matrices that are singular; numbers that are not finite;
///         joints of which two have one name
Avatar import_avatar(const std::filesystem::path& path, const AvatarOptions& options);

}  // namespace piecework::mesh
