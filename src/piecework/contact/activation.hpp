#pragma once

// How contact pushes: an energy of the distance d between two elements, zero from the contact
// distance d^ on.

#include <string>

namespace piecework::contact {

enum class Barrier {
  /// kappa/2 (d^ - d)^2: the penalty form of [Lu25, Sec. 6]. Finite at d = 0.
  None,
  /// The same down to d^/2, then a logarithm that continues it with two derivatives
  /// [Chen et al. 2025, Offset Geometric Contact]: constant stiffness at rest, a barrier in need.
  TwoStage,
  /// -c (d - d^)^2 ln(d / d^) [Li et al. 2020, Eq. 6], with the stiffness kappa at d^/2.
  Ipc,
  /// c (e^u - 1 - u), u = 4 (d^ - d) / d^, with the stiffness kappa at d^/2. Finite at d = 0.
  Exponential,
};

struct ActivationValue {
  double energy;     ///< b(d), J
  double slope;      ///< b'(d) <= 0, N
  double curvature;  ///< b''(d) >= 0, N/m
};

struct Activation {
  Barrier barrier = Barrier::TwoStage;
  double distance = 1e-3;  ///< d^, m
  double stiffness = 1;    ///< kappa, N/m

  /// \pre 0 < d < distance (any d < distance where the barrier is finite)
  [[nodiscard]] ActivationValue operator()(double d) const;
  /// E is infinite at d = 0.
  [[nodiscard]] bool is_barrier() const {
    return barrier == Barrier::TwoStage || barrier == Barrier::Ipc;
  }
};

/// Friction as a potential of the slip y >= 0, m, smoothed below `slip` [Li et al. 2020, Eq. 15]:
/// f0' = f1 rises from 0 to 1 at y = slip; then, since what slides holds less than what sticks
/// [Ly et al. 2020], it falls to `sliding` at 2 slip. Multiplied by mu_s times the pressure.
struct FrictionValue {
  double energy;       ///< f0(y), m
  double force_ratio;  ///< f1(y) / y, 1/m; finite at y = 0, and never grows with y
};
/// \param sliding  mu_k / mu_s, 0 to 1
FrictionValue smoothed_friction(double y, double slip, double sliding);

}  // namespace piecework::contact
