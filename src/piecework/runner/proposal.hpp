#pragma once

// Which domains `piecework tune` proposes: pure functions of the scene's size, the processor and
// measured times.

#include <string>
#include <vector>

#include <piecework/core/statistics.hpp>
#include <piecework/runner/topology.hpp>
#include <piecework/scene/scene.hpp>

namespace piecework::runner {

/// Fewest vertices of the smallest domain that is proposed. Chosen.
inline constexpr int kMinVerticesPerDomain = 1000;

/// How to divide a scene; the two keys of scene::Solver.
struct DomainSetting {
  int domains = 1;
  std::vector<double> weights;  ///< per domain; empty: equal
  bool operator==(const DomainSetting&) const = default;
};

/// What the scene says now.
DomainSetting present_setting(const scene::Scene& scene);

/// Kinds get domains in proportion to their cores (largest remainders, faster kinds first), and
/// every domain the speed of its kind, the fastest first. Empty if all speeds are the same.
std::vector<double> weights_for(const Topology& topology, int domains);

/// 1 domain, and 1, 2 and 4 per worker, or as many as leave every domain kMinVerticesPerDomain;
/// ascending, each once.
/// \param workers   threads that will work, at least 1
/// \param vertices  of the scene
std::vector<DomainSetting> candidate_settings(const Topology& topology, int workers, int vertices);

/// Times of global solves with one setting, by one solver.
struct Timing {
  MedianInterval ms;     ///< of one solve; NaN: not measured
  MedianInterval ratio;  ///< to the present setting, of solves one after the other
  /// The interval of the ratio does not hold 1.
  [[nodiscard]] bool significant() const { return ratio.low > 1 || ratio.high < 1; }
};

struct CandidateRow {
  DomainSetting setting;
  std::vector<Timing> timings;  ///< per solver, the one that decides last; empty: not measured
  std::string refusal;          ///< why a solver cannot be had with this setting
};

struct Proposal {
  DomainSetting chosen;
  std::string reason;
};

/// The measured setting with the smallest median ratio among those that are significantly faster
/// than the present one; without any, the present one. Significant is what the solver that decides
/// says at 95 % per candidate.
/// \param rows  the present setting first, measured
Proposal propose_measured(const std::vector<CandidateRow>& rows);

/// One domain per worker as far as the vertices allow, if nothing was measured.
Proposal propose_unmeasured(const Topology& topology, int workers, int vertices);

/// The scene with the proposal's keys.
scene::Scene with_setting(scene::Scene scene, const DomainSetting& setting);

/// "8 x 1, 8 x 0.55", or "equal".
std::string weights_text(const std::vector<double>& weights);

}  // namespace piecework::runner
