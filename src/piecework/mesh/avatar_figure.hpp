#pragma once

// An avatar as its evaluation needs it. Internal to mesh/.

#include <filesystem>
#include <string>
#include <vector>

#include <piecework/mesh/avatar.hpp>

namespace piecework::mesh {

using Affine = Eigen::Transform<double, 3, Eigen::AffineCompact>;

/// Scale first, then turn, then move.
struct Pose {
  Vec3 move;
  Eigen::Quaterniond turn;
  Vec3 scale;
};

template <class Value>
struct Track {
  std::vector<double> time;  ///< s, strictly ascending; empty: as bound
  std::vector<Value> value;
};

struct AnimatedNode {
  int node;
  Pose bind;
  Track<Vec3> move;
  Track<Eigen::Quaterniond> turn;
  Track<Vec3> scale;
};

/// From the coordinates of a mesh to those of a node, as bound.
struct Binding {
  int node;
  Affine offset;
};

struct Influence {
  int binding;
  double weight;
};

struct AvatarFigure {
  Affine world;               ///< from the file's coordinates to metres, y up
  std::vector<int> parent;    ///< per node, -1 for roots; parents come first
  std::vector<Affine> local;  ///< per node, to its parent, as bound
  std::vector<AnimatedNode> animated;
  std::vector<Binding> binding;

  std::vector<Vec3> place;           ///< per vertex, in its mesh
  std::vector<int> begin;            ///< offsets into influence, one more than vertices
  std::vector<Influence> influence;  ///< weights of a vertex sum to 1
  Triangles triangles;
  std::vector<int> vertex_map;

  std::string clip;
  double duration = 0, start_time = 0, lead_in = 0;  ///< s
  AvatarLead lead = AvatarLead::BindPose;
  std::vector<std::string> notes;
};

/// Per binding, from the coordinates of its mesh to the world.
std::vector<Affine> binding_transforms(const AvatarFigure& figure,
                                       const std::vector<Affine>& locals);

/// Reads, checks, welds. \throws InputError as import_avatar()
AvatarFigure make_figure(const std::filesystem::path& path, const AvatarOptions& options);

}  // namespace piecework::mesh
