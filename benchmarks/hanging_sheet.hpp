#pragma once

// The problem on which outer loops are compared: one step of the hanging sheet (scene A), on the
// sheet's own converged trajectory, with a converged reference.

#include <memory>
#include <string>

#include <piecework/model/stepper.hpp>
#include <piecework/runner/world.hpp>

namespace piecework::bench {

struct Cloth {
  const char* name;
  double stretching;  ///< k_s, N/m
  double bending;     ///< D, N m
};

/// Soft, cotton of scene A, and stiff with a bending stiffness that keeps its minimum unique.
inline constexpr Cloth kCloths[] = {
    {"soft", 20, 7.014e-6}, {"cotton", 261.08, 7.014e-6}, {"stiff", 2e4, 2e-2}};

/// Which step of the simulation.
struct Instant {
  double h = 1.0 / 120;  ///< time step, s
  int step = 20;
};

/// One step's minimisation problem and its solution.
class HangingSheet {
 public:
  /// Simulates to the step (dx 2e-7 m and below) and solves it until rounding ends progress.
  HangingSheet(const Cloth& cloth, int side, const Instant& instant = {});

  /// Its scene may be changed, to make other minimisers of the same problem.
  [[nodiscard]] runner::World& world() { return *world_; }
  /// Starts: the prediction z, and the extrapolation for methods that take it.
  [[nodiscard]] model::StepProblem problem() const;
  /// What the engine remembers from the step before (State::memory).
  [[nodiscard]] const std::vector<double>& memory() const { return memory_; }
  [[nodiscard]] const Positions& start() const { return predicted_; }
  [[nodiscard]] const std::vector<char>& fixed() const { return fixed_; }

  /// (E - E*) / (E(z) - E*).
  [[nodiscard]] double energy_error(double energy) const {
    return (energy - minimum_) / (start_energy_ - minimum_);
  }
  /// max |x - x*| over the step's largest motion max |x* - x_n|.
  [[nodiscard]] double position_error(const Positions& x) const;
  /// Of the reference: rms nodal residual / mean nodal weight.
  [[nodiscard]] double reference_gradient() const { return reference_gradient_; }

 private:
  void solve(Positions x);

  std::unique_ptr<runner::World> world_;
  std::vector<char> fixed_;
  std::vector<double> memory_;
  Positions predicted_, previous_, extrapolated_, solution_;
  double start_energy_ = 0, minimum_ = 0, motion_ = 0, reference_gradient_ = 0;
};

}  // namespace piecework::bench
