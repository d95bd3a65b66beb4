#pragma once

// How hard cloth is pressed where it touches something, for pictures.

#include <vector>

#include <piecework/runner/world.hpp>

namespace piecework::runner {

/// Force of contact, without friction, on the vertices of each triangle per area of cloth, Pa, in a
/// state x at `time` (s): positive where a triangle has a vertex within the contact distance of
/// something. Infinite where it passes through something.
/// \pre the scene has colliders or self_collision
std::vector<float> contact_pressure(const World& world, const Positions& x, double time);

}  // namespace piecework::runner
