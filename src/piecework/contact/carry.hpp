#pragma once

// A way on which what is held and moves does not run into cloth: it takes along what is near.

#include <vector>

#include <piecework/contact/held.hpp>
#include <piecework/contact/near_pairs.hpp>

namespace piecework::contact {

/// Takes free vertices in x along with the nearest held element that would else run into them on
/// its way from `from` to {x, obstacles}. \param pairs  all that can come near each other on the
/// way
void carry(const std::vector<NearPair>& pairs, const Held& held, const Points& from, Positions& x,
           const Positions& obstacles);

}  // namespace piecework::contact
