#pragma once

// From boxes in metres to those in steps. Private to `collision`.

#include <cmath>

#include <piecework/collision/broad_phase.hpp>

#include "box_lanes.hpp"

namespace piecework::collision {

/// Smallest box around both. Written for the compiler's vectors.
inline BoxRow united(const BoxRow& a, const BoxRow& b) {
  BoxRow r;
  for (int k = 0; k < 8; ++k) r.number[k] = a.number[k] < b.number[k] ? a.number[k] : b.number[k];
  return r;
}

/// A grid that ends somewhat more than the gap around the cloth. Obstacles may lie anywhere: what
/// is outside is moved to the border, which is out of reach of all cloth.
class UnitFrame {
 public:
  /// \param cloth  around all boxes of cloth
  /// \param gap    m
  UnitFrame(const VertexBox& cloth, double gap) {
    // Sizes and corners are rounded, so that the frame, and with it the rows of obstacles at rest,
    // stay the same while little moves.
    int exponent = 0;
    const double mantissa = std::frexp((cloth.high - cloth.low).maxCoeff() + 2 * gap, &exponent);
    const double size = std::ldexp(mantissa > 0 ? std::ceil(8 * mantissa) / 8 : 1,
                                   exponent < -900 ? -900 : exponent);
    steps_per_metre_ = kSteps / (1.125 * size);
    gap_ = gap * steps_per_metre_;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const double low = cloth.low[axis] - gap, corners = low / (size / 8);
      // Very far from the origin rounding would move the corner.
      origin_[axis] = std::abs(corners) < 0x1.0p40 ? std::floor(corners) * (size / 8) : low;
    }
  }

  [[nodiscard]] BoxRow row(const VertexBox& box) const {
    BoxRow r{};
    for (int axis = 0; axis < 3; ++axis) {
      r.number[axis] = down(step(box.low[axis], axis));
      r.number[3 + axis] = down(-step(box.high[axis], axis));
    }
    return r;
  }

  /// Rounding down takes up to one step from each of the two numbers that a comparison adds. The
  /// slack is for the rounding of doubles.
  [[nodiscard]] Reach reach() const {
    constexpr double slack = 1e-6;
    return {static_cast<int>(std::floor(gap_ + slack)),
            static_cast<int>(std::floor(gap_ - 2 - slack))};
  }

 private:
  static constexpr double kSteps = 65400;  // a little less than 2 kMostNumber

  [[nodiscard]] double step(double x, int axis) const {
    return (x - origin_[axis]) * steps_per_metre_ - kSteps / 2;
  }
  static short down(double steps) {
    const double inside = steps < -kMostNumber  ? -kMostNumber
                          : steps > kMostNumber ? kMostNumber
                                                : steps;
    // Truncation towards zero of a positive number, then back: std::floor is a call without SSE4.
    return static_cast<short>(static_cast<int>(inside + 65536) - 65536);
  }

  Vec3 origin_ = Vec3::Zero();  // m
  double steps_per_metre_ = 1;
  double gap_ = 0;  // steps
};

}  // namespace piecework::collision
