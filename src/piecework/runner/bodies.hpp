#pragma once

// Colliders of a scene made real. Internal to runner/.

#include <piecework/runner/world.hpp>

namespace piecework::runner {

/// Builds the colliders of the scene and audits them against the start shape of the model, with a
/// note per finding. \pre world.model is built
/// \throws InputError that names scene, JSON pointer or file, and remedy
void add_colliders(World& world);

/// Notes what passes through what at the start, if the scene lets anything touch: no step will pull
/// it apart. \pre colliders are added
void note_start_intersections(World& world);

}  // namespace piecework::runner
