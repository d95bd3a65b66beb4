#pragma once

// Colliders of a scene made real. Internal to runner/.

#include <piecework/runner/world.hpp>

namespace piecework::runner {

/// Builds the colliders of the scene and audits them against the start shape of the model, with a
/// note per finding. \pre world.model is built
/// \returns how many vertices of cloth start inside of solids with a closed form
/// \throws InputError that names scene, JSON pointer or file, and remedy
int add_colliders(World& world);

}  // namespace piecework::runner
