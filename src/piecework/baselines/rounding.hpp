#pragma once

// How far an energy may be off by rounding: below that, comparing energies says nothing.

#include <cmath>
#include <limits>

#include <piecework/core/types.hpp>
#include <piecework/model/constraints.hpp>

namespace piecework::baselines {

/// Of E(x) [local::JacobiStep], J.
class EnergyRounding {
 public:
  explicit EnergyRounding(const model::ClothModel& model) {
    for (const model::StretchConstraint& c : model.stretch) total_weight_ += c.weight;
  }

  /// \param K  the system matrix on the unknowns, N/m
  void set_system(const SparseMatrix& K) { trace_ = K.diagonal().sum(); }

  /// Strains are off by the rounding of F, sums by that of E, coordinates by their own.
  [[nodiscard]] double at(double energy, const Positions& x) const {
    constexpr double unit = std::numeric_limits<double>::epsilon();
    const double position = x.rows() > 0 ? unit * x.cwiseAbs().maxCoeff() : 0;
    const double strain = std::sqrt(2.0 * energy * total_weight_);
    return 8.0 * unit * (energy + strain) + 3.0 * trace_ * position * position;
  }

 private:
  double total_weight_ = 0;  ///< sum of w over the triangles, J
  double trace_ = 0;         ///< of K, N/m
};

}  // namespace piecework::baselines
