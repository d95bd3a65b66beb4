#pragma once

// Vertices held or moved by a script. They are eliminated from the system while they are held.

#include <optional>
#include <vector>

#include <piecework/core/types.hpp>

namespace piecework::model {

/// A group of vertices that moves rigidly: rotation about an axis, then translation.
struct Pin {
  std::vector<int> vertices;
  Vec3 velocity = Vec3::Zero();   ///< m/s
  Vec3 axis = Vec3::UnitY();      ///< direction; need not be of unit length
  Vec3 center = Vec3::Zero();     ///< a point on the axis, m
  double rate = 0;                ///< rad/s
  double start = 0;               ///< motion begins, s
  std::optional<double> stop;     ///< motion ends, s
  std::optional<double> release;  ///< from this time on the vertices are free, s
};

/// Evaluates pins; positions are functions of time and the start shape only.
class PinScript {
 public:
  /// \param start  start shape, |V| x 3, m.
  PinScript(std::vector<Pin> pins, const Positions& start);

  /// Which vertices are held at `time` (s). A later pin wins over an earlier one.
  [[nodiscard]] std::vector<char> fixed_at(double time) const;

  /// Writes the prescribed position of every vertex held at `time` into x.
  void place(double time, Positions& x) const;

 private:
  [[nodiscard]] static bool holds(const Pin& pin, double time);

  std::vector<Pin> pins_;
  Positions start_;
};

}  // namespace piecework::model
