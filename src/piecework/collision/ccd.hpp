#pragma once

// Continuous collision detection of one pair whose four vertices move along straight lines.

#include <cstdint>

#include <piecework/collision/distance.hpp>

namespace piecework::collision {

/// Root finder on the coplanarity cubic. Both are bracketed and conservative.
enum class CcdMethod : std::uint8_t {
  Halley,  ///< third order [Lu25, Eq. 25]
  Newton,  ///< second order; for the comparison of [Lu25, Sec. 7.3]
};

struct CcdOptions {
  CcdMethod method = CcdMethod::Halley;
  double tolerance = 1e-9;    ///< of the time, fraction of the motion
  double min_separation = 0;  ///< m; a pair that comes as close as this has met
};

struct CcdResult {
  bool hit = false;
  double time = 1;        ///< fraction of the motion that is safe, in [0, 1]: never late
  int evaluations = 0;    ///< of the cubic or of the distance
  bool additive = false;  ///< needed the additive fallback (degenerate motion)
};

/// Whether the pair meets on the way from `start` to `end` (t = 0 and 1), and when: the first t at
/// which its distance is at most `min_separation`, or slightly earlier. Conservative: no meeting is
/// missed and no time is late, rounding included; a pair that nearly meets may be called a hit.
/// Two elements that share a vertex must not be asked.
CcdResult first_contact(PairKind kind, const PairPoints& start, const PairPoints& end,
                        const CcdOptions& options);

}  // namespace piecework::collision
