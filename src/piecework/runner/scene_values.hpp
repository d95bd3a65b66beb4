#pragma once

// Plain values of scenes as those of the library. Internal to runner/.

#include <array>
#include <numbers>
#include <string>

#include <piecework/core/types.hpp>
#include <piecework/mesh/import.hpp>

namespace piecework::runner {

inline Vec3 vec(const std::array<double, 3>& a) { return {a[0], a[1], a[2]}; }

/// About x, then y, then z.
inline Mat3 rotation(const std::array<double, 3>& degrees) {
  const auto turn = [&](std::size_t k, const Vec3& axis) {
    return Eigen::AngleAxisd(degrees[k] * std::numbers::pi / 180.0, axis);
  };
  return (turn(2, Vec3::UnitZ()) * turn(1, Vec3::UnitY()) * turn(0, Vec3::UnitX()))
      .toRotationMatrix();
}

inline mesh::UpAxis up_axis(const std::string& name) {
  return name == "x" ? mesh::UpAxis::X : name == "z" ? mesh::UpAxis::Z : mesh::UpAxis::Y;
}

}  // namespace piecework::runner
