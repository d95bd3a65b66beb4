#pragma once

// Prescribed rigid motion of a body.

#include <optional>

#include <piecework/core/types.hpp>

namespace piecework::colliders {

/// Rotation about an axis, then translation, like that of a pin: it begins at `start` and ends at
/// `stop`; before and after the body stands still.
struct RigidMotion {
  Vec3 velocity = Vec3::Zero();  ///< m/s
  Vec3 axis = Vec3::UnitY();     ///< direction, of any length but 0
  Vec3 center = Vec3::Zero();    ///< a point on the axis, m
  double rate = 0;               ///< rad/s
  double start = 0;              ///< s
  std::optional<double> stop;    ///< s; absent: never

  /// From places at time 0 or before `start` to places at `time` (s). The identity, to the last
  /// bit, while the body has not moved; a motion without rotation moves without rounding it in.
  [[nodiscard]] Eigen::Isometry3d at(double time) const;
  /// True if it never moves.
  [[nodiscard]] bool is_static() const { return velocity.isZero(0) && rate == 0; }
};

}  // namespace piecework::colliders
