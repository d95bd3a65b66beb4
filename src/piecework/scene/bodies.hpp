#pragma once

// The part of a scene (scene.hpp) that has triangles or a shape: meshes and colliders.

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace piecework::scene {

struct Mesh {
  std::string generator;  ///< "sheet", "strip", "tube", "disc", "quilt", ...; or empty and `file`
  std::string file;       ///< relative to the scene's folder
  double width = 1, height = 1, depth = 1, radius = 0.5;  ///< m
  int columns = 50, rows = 50;
  std::string pattern = "alternating";
  double jitter = 0.3;
  int seed = 1;
  int patches_x = 2, patches_y = 2;
  double units = 1;  ///< metres per unit of the file
  std::string up_axis = "y";
  bool repair = false;
  bool weld = true;

  bool operator==(const Mesh&) const = default;
};

/// Rigid motion of a collider, as that of a Pin.
struct Motion {
  std::array<double, 3> velocity{0, 0, 0};  ///< m/s
  std::array<double, 3> axis{0, 1, 0};      ///< direction of the axis of rotation
  std::array<double, 3> center{0, 0, 0};    ///< point on the axis, m
  double rate = 0;                          ///< rad/s
  double start = 0;                         ///< motion begins, s
  std::optional<double> stop;               ///< motion ends, s

  bool operator==(const Motion&) const = default;
};

/// One shape after the other: files of the same topology.
struct Sequence {
  std::string pattern;  ///< "frame_{:04}.obj", relative to the scene's folder
  int first = 0, last = 0;
  double fps = 30;   ///< 1/s
  double start = 0;  ///< time of the first frame, s
  double units = 1;  ///< metres per unit of the files
  std::string up_axis = "y";

  bool operator==(const Sequence&) const = default;
};

/// An animated figure.
struct Avatar {
  std::string file;       ///< relative to the scene's folder
  std::string clip;       ///< empty: the only one, or none
  double start_time = 0;  ///< of the clip, s
  double lead_in = 0;     ///< s
  std::string lead = "bind_pose";
  double units = 1;  ///< metres per unit of the file
  std::string up_axis = "y";

  bool operator==(const Avatar&) const = default;
};

struct HalfSpace {
  std::array<double, 3> point{0, 0, 0};   ///< m
  std::array<double, 3> normal{0, 1, 0};  ///< outward

  bool operator==(const HalfSpace&) const = default;
};

/// A body that cloth collides with.
struct Collider {
  std::string name = "collider";
  std::string shape;  ///< "plane", "sphere", "capsule", "box", "cylinder", "half_spaces", "mesh"
  std::array<double, 3> point{0, 0, 0};              ///< plane, m
  std::array<double, 3> normal{0, 1, 0};             ///< plane
  std::array<double, 3> center{0, 0, 0};             ///< sphere, box, m
  double radius = 0.5;                               ///< sphere, capsule, cylinder, m
  std::array<double, 3> from{0, 0, 0}, to{0, 1, 0};  ///< capsule, cylinder, m
  std::array<double, 3> size{1, 1, 1};               ///< box, m
  double rounding = 0;                               ///< box, cylinder, half_spaces, m
  std::vector<HalfSpace> planes;                     ///< half_spaces
  std::string surface = "exact";                     ///< or "triangles"; all but plane and mesh
  int segments = 16;                                 ///< with surface "triangles"
  std::optional<Mesh> mesh;                          ///< one of the three for "mesh"
  std::optional<Sequence> sequence;
  std::optional<Avatar> avatar;
  std::array<double, 3> translate{0, 0, 0};  ///< m; after rotate and scale
  std::array<double, 3> rotate{0, 0, 0};     ///< degrees about x, then y, then z
  std::array<double, 3> scale{1, 1, 1};      ///< "mesh"
  std::optional<Motion> motion;
  std::optional<double> friction;          ///< absent: that of the scene
  std::optional<double> kinetic_friction;  ///< absent: `friction`
  std::optional<double> thickness;         ///< m

  bool operator==(const Collider&) const = default;
};

}  // namespace piecework::scene
