#pragma once

// What pictures show besides the cloth: the colliders of a scene.

#include <limits>
#include <optional>
#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/mesh/triangle_mesh.hpp>
#include <piecework/runner/world.hpp>

namespace piecework::cli {

/// An axis-parallel box, m; empty at first.
struct Bounds {
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity());
  Vec3 high = -low;

  [[nodiscard]] bool empty() const { return !(high.array() >= low.array()).all(); }
  /// Of the longest side.
  [[nodiscard]] double size() const { return empty() ? 0.0 : (high - low).maxCoeff(); }
  void include(const Bounds& other) {
    low = low.cwiseMin(other.low);
    high = high.cwiseMax(other.high);
  }
  void include(const Positions& points) {
    low = low.cwiseMin(points.colwise().minCoeff().transpose());
    high = high.cwiseMax(points.colwise().maxCoeff().transpose());
  }
};

/// The surfaces of the colliders at `time` (s) as an eye (m) sees them. Level planes are left out:
/// they are the ground. So are solids that the eye is in: walls and ceilings seen from behind.
/// \param cloth  what is unbounded is cut off well outside of it
std::vector<mesh::TriangleMesh> bodies_at(const runner::World& world, double time, const Vec3& eye,
                                          const Bounds& cloth);

/// Of the bounded colliders at a time (s); empty without any.
Bounds bounds_of_bodies(const runner::World& world, double time);

/// Height (m) of the highest level plane that cloth can lie on, at a time (s).
std::optional<double> level_ground(const runner::World& world, double time);

/// What the camera frames: the cloth and the bodies, but these only as far as the cloth remains
/// large in the picture.
Bounds framed(const Bounds& cloth, const Bounds& bodies);

}  // namespace piecework::cli
