#pragma once

// Continuous collision detection of one pair whose four vertices move along straight lines.

#include <cstdint>
#include <span>

#include <piecework/collision/distance.hpp>

namespace piecework::collision {

/// Halley and Newton find the times at which the four vertices are coplanar, and are bracketed and
/// conservative. Additive does without, as every method does for a minimum separation.
enum class CcdMethod : std::uint8_t {
  Halley,    ///< third order [Lu25, Eq. 25]
  Newton,    ///< second order; for the comparison of [Lu25, Sec. 7.3]
  Additive,  ///< conservative advancement [Mirtich 1996; Li et al. 2021], along separating axes
};

struct CcdOptions {
  CcdMethod method = CcdMethod::Halley;
  double tolerance = 1e-9;    ///< of the time, fraction of the motion; at least 1e-14 is used
  double min_separation = 0;  ///< m; below 0 is 0. A pair that comes as close as this has met
};

struct CcdResult {
  bool hit = false;
  double time = 1;        ///< fraction of the motion that is safe, in [0, 1]: never late
  int evaluations = 0;    ///< of the cubic and of the distance
  bool additive = false;  ///< needed more than one axis on the way (degenerate motion)
};

/// Whether the pair meets on the way from `start` to `end` (t = 0 and 1), and when: the first t at
/// which its distance is at most `min_separation`, or slightly earlier. Conservative: no meeting is
/// missed and no time is late, rounding included, for the straight motion of the given numbers in
/// exact arithmetic; a pair that nearly meets may be called a hit. Coordinates may be as far from
/// the origin, and their common motion as long, as one likes: only differences between the two
/// elements count. Where the largest of these is beyond 1e-45 ... 1e45 m or not finite, the answer
/// is a hit at 0. Two elements that share a vertex must not be asked.
CcdResult first_contact(PairKind kind, const PairPoints& start, const PairPoints& end,
                        const CcdOptions& options);

struct CcdQuery {
  PairKind kind;
  PairPoints start, end;  ///< m
};

/// first_contact() of every query, in parallel. `results` is as long as `queries`.
void first_contacts(std::span<const CcdQuery> queries, const CcdOptions& options,
                    std::span<CcdResult> results);

}  // namespace piecework::collision
