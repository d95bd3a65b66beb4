#pragma once

// Scenes at the edge of what the numbers allow, and what must be true of each of their steps. For
// extremes_test.cpp, which runs them all, and for benchmarks/bench_extremes.cpp, which tabulates
// them.

#include <functional>
#include <string>
#include <vector>

#include <piecework/runner/world.hpp>

namespace piecework::runner {

/// A scene, and by how much a run of it may miss what exact arithmetic would give.
struct Extreme {
  std::string name;
  scene::Scene scene;
  /// What no scene file can say, done to the world before it is simulated; empty: nothing.
  std::function<void(World&)> alter;

  /// Without wind, loads and moving pins the energy never exceeds that of the start by more than
  /// this part of the largest kinetic plus elastic energy so far, or of a fall by a mean edge.
  double drift = 0.05;
  /// The momentum of a free cloth is off by at most this part of sum m (|v| + |g| t): only steps
  /// solved to the end conserve it.
  double momentum = 5e-3;
  /// Of a step that ended without its stop rule: the largest ratio of the gradient at its end to
  /// that at its prediction. Gradients within rounding of positions are zero.
  double unsolved = 0.1;
  /// A step that says "converged" is at most this far from its minimum, in mean edges. The rule
  /// asks for 0.01 by an estimate that is known to be off by ten at times.
  double error = 0.2;
};

/// What a run of it showed; the worst step of each number.
struct ExtremeResult {
  int steps = 0;
  int converged = 0;
  int stalled = 0;
  int iterations = 0;
  int degenerate = 0;
  double gradient = 0;  ///< rms nodal force residual / mean nodal weight
  double unsolved = 0;  ///< of steps that did not converge: gradient / gradient at the prediction
  double error = 0;     ///< of steps that did: distance to Newton's minimum, mean edges
  double drift = 0;
  double momentum = 0;
  double ms = 0;  ///< of all steps
  bool finite = true;
  std::string refusal;  ///< what the engine or the scene's checks said; empty: nothing
};

/// \param verify  compare steps that say "converged" with Newton's method
ExtremeResult run_extreme(const Extreme& extreme, bool verify = true);

/// What is wrong; empty: the run keeps every promise, or was refused for a reason.
std::string fault_of(const Extreme& extreme, const ExtremeResult& result);

/// One way to go to an extreme. They combine.
struct Change {
  std::string name;
  std::function<void(Extreme&)> apply;
};

/// A sheet of cotton of 20 x 20 vertices that hangs from two corners, four steps of it.
Extreme ordinary_cloth();
std::vector<Change> changes();

/// The ordinary cloth with the changes of these names. \throws InputError if one is not known.
Extreme changed_by(const std::vector<std::string>& names);

/// Each change alone, and the combinations that once went wrong or might.
std::vector<Extreme> extremes();

}  // namespace piecework::runner
