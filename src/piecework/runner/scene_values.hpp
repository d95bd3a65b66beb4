#pragma once

// Plain values of scenes as those of the library. Internal to runner/.

#include <array>
#include <filesystem>
#include <numbers>
#include <string>

#include <fmt/format.h>

#include <piecework/core/error.hpp>
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

/// Scenes may leave their files to the user: the message names the key to set.
/// \param pointer  of the key, "/cloths/0/mesh/file"
/// \throws InputError if there is no such file
inline void require_file(const std::string& file, const std::string& source,
                         const std::string& pointer) {
  if (std::filesystem::exists(file)) return;
  throw InputError(
      fmt::format("{}: {}: {}: file not found; correct the path, or name another: "
                  "--set {}=...",
                  source, pointer, file, pointer));
}

}  // namespace piecework::runner
