#pragma once

// Implicit Euler around any minimiser: prediction, pins, minimisation, velocities.

#include <functional>
#include <memory>
#include <optional>
#include <utility>

#include <piecework/model/constraints.hpp>
#include <piecework/model/forces.hpp>
#include <piecework/model/pins.hpp>
#include <piecework/model/stepper.hpp>

namespace piecework::model {

struct IntegratorOptions {
  double h = 1.0 / 120.0;         ///< s
  std::optional<double> damping;  ///< 1/s: velocities fall by exp(-damping h) per step; absent: off
};

/// Advances a State step by step:
///     z = x_n + h v_n + h^2 M^-1 f_ext(x_n, v_n);  x_{n+1} = argmin E(x; z);
///     v_{n+1} = (x_{n+1} - x_n) / h                                         [Lu25, Eq. 1]
/// With seams every vertex, slaves included, has its own z and mass, and every state satisfies
/// x = T x_free + o(t) exactly.
class Integrator {
 public:
  /// \param model  must outlive the integrator.
  Integrator(const ClothModel& model, ExternalForces forces, std::vector<Pin> pins,
             IntegratorOptions options, std::unique_ptr<Minimizer> minimizer,
             std::unique_ptr<ContactTerms> contact = nullptr);

  /// Set-up for the step after `state`, so that it is like the others. Optional.
  /// \throws SimulationError as Minimizer::prepare().
  void prepare(const State& state);

  /// One step. On an exception the state is as it was before.
  /// \throws SimulationError if the new state is not finite (the text says what to change).
  StepReport step(State& state);

  /// The start of a simulation: start shape, pins placed, seams without close time closed, the
  /// velocity of each part.
  [[nodiscard]] State initial_state(const std::vector<Vec3>& part_velocity) const;

  /// Called with the number of the step (from 1) and as StepProblem::observer.
  void observe_iterations(std::function<bool(int, const StepReport&, const Positions&)> observer) {
    iteration_observer_ = std::move(observer);
  }

  /// Called with the problem of each step before it is solved: for studies.
  void observe(std::function<void(const StepProblem&)> observer) {
    observer_ = std::move(observer);
  }

  [[nodiscard]] const Minimizer& minimizer() const { return *minimizer_; }

 private:
  /// Vertices that are held, slaves of held carriers included.
  [[nodiscard]] std::vector<char> held_at(double time) const;

  /// Counts what passes through what in x_.
  void finish_contact(StepReport& report);

  /// Fills extrapolated_; false if it is of no use, or the step before is not known.
  bool extrapolate_to(double end, const State& state);

  const ClothModel& model_;
  ForceField forces_;
  PinScript pins_;
  IntegratorOptions options_;
  std::unique_ptr<Minimizer> minimizer_;
  std::unique_ptr<ContactTerms> contact_;  ///< null: nothing can touch
  std::function<void(const StepProblem&)> observer_;
  std::function<bool(int, const StepReport&, const Positions&)> iteration_observer_;
  Positions acceleration_, predicted_, extrapolated_, x_;
};

}  // namespace piecework::model
