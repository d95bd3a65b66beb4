#pragma once

// Vertices held or moved by a script. They are eliminated from the system while they are held.

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/mesh/seams.hpp>

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

/// How messages call pins and vertices.
struct PinNames {
  std::function<std::string(std::size_t)> pin;
  std::function<std::string(int)> vertex;
};

/// Pins on sewn vertices hold what carries them, each carrier at its own place, moved like the pin:
/// the slave follows. Slaves leave the lists of vertices, their carriers join them.
/// 	hrows InputError that names both pins if a carrier would thereby be held by two pins that
/// move
///         or end differently.
std::vector<Pin> pins_on_carriers(std::vector<Pin> pins, const mesh::SeamMap& seams,
                                  const PinNames& names);

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
