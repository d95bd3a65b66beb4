#pragma once

// Times the scene's first global solve with several divisions into domains.

#include <string>
#include <vector>

#include <piecework/runner/proposal.hpp>
#include <piecework/runner/world.hpp>

namespace piecework::runner {

/// Pairs of samples per candidate and solver; each sample is the mean of kTuneSolves solves. Counts
/// decide, not a clock.
inline constexpr int kTunePairs = 15;
inline constexpr int kTuneSolves = 4;

struct Measurements {
  std::vector<std::string> solvers;  ///< `global` of each column, the one that decides last
  std::vector<CandidateRow> rows;    ///< the present setting first
};

/// Solves K dx = -grad E of the scene's first iteration, with `tree` and, where it knows domains,
/// the scene's own `global`. A candidate and the present setting take turns, so that both see the
/// same disturbance; two factors are in memory at a time. Works in the arena of the calling thread.
/// \param world  its domains and solver settings are changed in between, and are as before at the
///               end, also after an exception
/// \throws InputError if the present setting cannot be solved or no vertex is free;
///         SimulationError as Minimizer::prepare().
Measurements measure_settings(World& world, const std::vector<DomainSetting>& candidates);

}  // namespace piecework::runner
