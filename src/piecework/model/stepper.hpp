#pragma once

// What every time stepper shares: the state, the step's data and its report.

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/model/contact_terms.hpp>

namespace piecework::model {

/// The whole dynamic state; with the scene it determines everything that follows.
struct State {
  Positions x;      ///< |V| x 3, m
  Positions v;      ///< |V| x 3, m/s
  double time = 0;  ///< s
  int step = 0;     ///< steps done
  /// Velocities of the step before, m/s, for minimisers that extrapolate; else empty.
  Positions previous_v;
  /// Where obstacles are, |O| x 3, m, if cloth has kept them from where they belong; else empty.
  Positions obstacles;
  /// What the minimiser remembers between steps, in its own terms; often empty.
  std::vector<double> memory;
};

/// When the iteration of a step stops. Units of the tolerance in scene::Quality and docs/scene.md.
enum class StopRule { Error, Gradient, Dx2, DxRms, DxInf, Iterations };

struct StopOptions {
  StopRule rule = StopRule::Error;
  double tolerance = 1e-2;
  int max_iterations = 200;
  int min_iterations = 1;
};

/// Milliseconds per phase of a step, columns of the paper's Table 1 as far as they apply.
/// A phase that did not run is negative and printed as "-".
struct PhaseTimes {
  double cull = -1;      ///< Cull: broad phase of contact
  double narrow = -1;    ///< Nrw.: distances, contact forces, continuous detection
  double local = -1;     ///< L: projections, gradient, energy
  double global = -1;    ///< G: the global solve
  double refactor = -1;  ///< Ref.: factorisation, in steps where pins were released
  double misc = -1;      ///< Misc.: external forces, prediction, pins, velocities
  double check = -1;     ///< the independent check for interpenetrations
};

/// What a step did, and how well.
struct StepReport {
  int iterations = 0;
  bool converged = false;
  double gradient = 0;  ///< rms nodal force residual over free vertices / mean nodal weight
  double error = 0;     ///< estimated position error, in mean edge lengths
  double energy = 0;    ///< incremental potential E(x), J
  double dx_2 = 0, dx_rms = 0, dx_inf = 0;  ///< last increment in the unit box (the paper's rule)
  int global_solves = 0;
  int evaluations = 0;     ///< of energy and gradient: local passes
  int normal_factors = 0;  ///< factorisations of the metric's normal part
  int pcg_iterations = 0;  ///< inner iterations of inexact Newton steps
  bool stalled = false;    ///< ended before the stop rule held: rounding allows no more progress
  int degenerate_projections = 0;        ///< triangles that needed the rank-deficient rule
  std::optional<ContactReport> contact;  ///< absent: nothing can touch
  PhaseTimes phases;
  double step_ms = 0;
};

/// What a solver's set-up took. 0: it has no factor.
struct SetupReport {
  double ms = 0;
  double factor_nonzeros = 0;  ///< nnz(L)
  double factor_bytes = 0;
};

/// Called with the start (0 iterations) and after every iteration, before the stop rule is asked;
/// false ends the step. For studies of convergence.
using IterationObserver = std::function<bool(const StepReport&, const Positions& x)>;

/// The minimisation problem of one implicit Euler step [Lu25, Eq. 1].
struct StepProblem {
  const Positions* predicted;      ///< z = x_n + h v_n + h^2 M^-1 f_ext, |V| x 3, m
  const std::vector<char>* fixed;  ///< per vertex: held; x already holds the prescribed position
  const Positions* previous;       ///< x_n; orients degenerate triangles
  /// x_n + h v_n + h (v_n - v_{n-1}), on pins and seams: another start, or null. |V| x 3, m
  const Positions* extrapolated = nullptr;
  /// State::memory, to be read and renewed; null: none is kept.
  std::vector<double>* memory = nullptr;
  IterationObserver observer;       ///< usually empty
  ContactTerms* contact = nullptr;  ///< null: nothing can touch

  /// False: the observer has seen enough.
  [[nodiscard]] bool observe(const StepReport& report, const Positions& x) const {
    return !observer || observer(report, x);
  }
};

/// Minimises the incremental potential; one implementation per method.
class Minimizer {
 public:
  virtual ~Minimizer() = default;

  /// Set-up for a set of held vertices, so that the first step is like the others. Optional.
  /// \throws SimulationError if K is not positive definite or its factor does not fit into memory.
  virtual void prepare(const std::vector<char>& fixed) = 0;

  /// Of the last prepare().
  [[nodiscard]] virtual SetupReport setup_report() const = 0;

  /// Improves x (in: start of the iteration, out: the step's end state).
  /// \throws SimulationError if x becomes non-finite or K is not positive definite; x is then void.
  virtual StepReport minimize(const StepProblem& problem, Positions& x) = 0;

  /// StepProblem::extrapolated is of use.
  [[nodiscard]] virtual bool wants_extrapolation() const { return false; }

  /// One line for reports: libraries and orderings used.
  [[nodiscard]] virtual std::string description() const = 0;
};

}  // namespace piecework::model
