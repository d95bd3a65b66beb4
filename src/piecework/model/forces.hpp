#pragma once

// External forces of a step, evaluated at its start and constant during it.

#include <optional>
#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/mesh/topology.hpp>
#include <piecework/model/constraints.hpp>

namespace piecework::model {

/// Drag of moving air on each triangle:
///     f = 1/2 rho_air A |u| (C_n (u.n) n + C_t (u - (u.n) n)),  u = wind - cloth velocity.
/// The impulse is limited so that air can bring cloth to its own speed but never push it beyond:
/// f is divided by 1 + h |f| / (m |u|), m the triangle's mass. (Standard panel model; limiter
/// ours.)
struct Wind {
  Vec3 velocity = Vec3::Zero();   ///< m/s
  double air_density = 1.2;       ///< kg/m^3
  double normal_drag = 1.0;       ///< C_n
  double tangential_drag = 0.05;  ///< C_t
  double gust_amplitude = 0;      ///< fraction of velocity
  double gust_period = 1;         ///< s

  /// Wind at a time: velocity (1 + amplitude sin(2 pi t / period)).
  [[nodiscard]] Vec3 at(double time) const;
};

/// A total force shared by some vertices in proportion to their mass.
struct Load {
  std::vector<int> vertices;
  Vec3 force = Vec3::Zero();   ///< N
  double start = 0;            ///< s
  std::optional<double> stop;  ///< s
};

/// What acts on the cloth. What is absent costs nothing.
struct ExternalForces {
  std::optional<Vec3> gravity;  ///< m/s^2
  std::optional<Wind> wind;
  std::vector<Load> loads;
};

/// Accelerations M^-1 f_ext at a state, m/s^2.
class ForceField {
 public:
  /// \param model  must outlive the field.
  ForceField(const ClothModel& model, ExternalForces forces);

  /// \param x, v           |V| x 3, m and m/s
  /// \param h              step, s (used by the wind's limiter)
  /// \param[out] a         |V| x 3, m/s^2
  void evaluate(const Positions& x, const Positions& v, double time, double h, Positions& a);

  [[nodiscard]] const ExternalForces& forces() const { return forces_; }

 private:
  void add_wind(const Positions& x, const Positions& v, double time, double h, Positions& a);

  const ClothModel& model_;
  ExternalForces forces_;
  mesh::Adjacency vertex_triangles_;  ///< only with wind
  Positions triangle_force_;          ///< only with wind
};

}  // namespace piecework::model
