#include <piecework/colliders/motion.hpp>

#include <algorithm>
#include <limits>

namespace piecework::colliders {

Eigen::Isometry3d RigidMotion::at(double time) const {
  const double end = stop.value_or(std::numeric_limits<double>::infinity());
  const double moved = std::max(0.0, std::min(time, end) - start);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  if (moved == 0 || is_static()) return pose;
  pose.translation() = moved * velocity;
  if (rate != 0) {
    pose.linear() = Eigen::AngleAxisd(rate * moved, axis.normalized()).toRotationMatrix();
    pose.translation() += center - pose.linear() * center;
  }
  return pose;
}

}  // namespace piecework::colliders
