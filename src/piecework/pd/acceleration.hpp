#pragma once

// How the outer loop turns a gradient into a displacement. All of them use gradients through the
// metric P only: with P = K~^-1 and no acceleration this is projective dynamics itself.

#include <memory>
#include <string>

#include <piecework/core/types.hpp>
#include <piecework/pd/metric.hpp>

namespace piecework::pd {

enum class AccelerationKind {
  None,       ///< d = -P g: a global step
  Chebyshev,  ///< [Wang 2015]: semi-iteration on the sequence of iterates
  Anderson,   ///< [Peng et al. 2018]
  Lbfgs,      ///< [Liu et al. 2017] with P as initial inverse Hessian
};

struct AccelerationOptions {
  AccelerationKind kind = AccelerationKind::Lbfgs;
  int window = 5;     ///< remembered iterates m (Anderson, L-BFGS)
  double rho = 0.99;  ///< estimated spectral radius (Chebyshev)
};

/// "L-BFGS of 5 pairs".
std::string to_string(const AccelerationOptions& options);

/// Vectors are n_f x 3, row-major; g in N, displacements in m.
class Acceleration {
 public:
  virtual ~Acceleration() = default;

  /// Forgets everything: a new step, or a proposal misled.
  virtual void restart() = 0;

  /// P is another one from now on.
  virtual void metric_changed() { restart(); }

  /// The displacement to try from an iterate with gradient g.
  virtual void propose(const Positions& g, Metric& metric, Positions& d) = 0;

  /// The iterate has moved by step * d, and the gradient changed from `before` to `after`.
  virtual void accept(double step, const Positions& d, const Positions& before,
                      const Positions& after) = 0;

  /// Nothing is remembered: a proposal now is -P g.
  [[nodiscard]] virtual bool fresh() const = 0;

  /// A proposal may be shortened. Otherwise it is taken as it is or not at all.
  [[nodiscard]] virtual bool scalable() const { return false; }
};

std::unique_ptr<Acceleration> make_acceleration(const AccelerationOptions& options);

/// sum_i a_i b_i in a fixed order.
double dot(const Positions& a, const Positions& b);

/// Length of the longest row.
double longest(const Positions& d);

}  // namespace piecework::pd
