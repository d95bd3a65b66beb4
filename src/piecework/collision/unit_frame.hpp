#pragma once

// From boxes in metres to those of single precision. Private to `collision`.

#include <piecework/collision/broad_phase.hpp>

#include "box_lanes.hpp"

namespace piecework::collision {

/// Smallest box around both. Written for the compiler's vectors.
inline BoxRow united(const BoxRow& a, const BoxRow& b) {
  BoxRow r;
  for (int k = 0; k < 8; ++k) r.number[k] = a.number[k] < b.number[k] ? a.number[k] : b.number[k];
  return r;
}

/// The coordinates of single precision: (x - origin) * scale, clamped to +-kClamp.
///
/// The cloth lies in [0, 2]^3. Obstacles may lie anywhere, but only what comes within the gap of
/// the cloth matters, so that the rounding of coordinates is a fixed fraction of the cloth's size.
struct UnitFrame {
  static constexpr double kClamp = 16;

  Vec3 origin = Vec3::Zero();  ///< m
  double scale = 1;            ///< 1/m, a power of two

  [[nodiscard]] BoxRow row(const VertexBox& box) const {
    BoxRow r{};
    for (int axis = 0; axis < 3; ++axis) {
      r.number[axis] = coordinate(box.low[axis], axis);
      r.number[3 + axis] = -coordinate(box.high[axis], axis);
    }
    return r;
  }

 private:
  [[nodiscard]] float coordinate(double x, int axis) const {
    const double unit = (x - origin[axis]) * scale;
    return static_cast<float>(unit < -kClamp ? -kClamp : unit > kClamp ? kClamp : unit);
  }
};

/// \param gap  m; where it exceeds what clamping leaves, all pairs are in doubt
inline Reach reach_of(double gap, const UnitFrame& frame) {
  const double g = gap * frame.scale;
  if (g > UnitFrame::kClamp / 2) return {1e30F, -1e30F};
  const double doubt = 0x1.0p-21 * (2 + 2 * g);
  return {static_cast<float>(g + doubt), static_cast<float>(g - doubt)};
}

}  // namespace piecework::collision
