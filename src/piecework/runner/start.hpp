#pragma once

// The state at which a simulation starts.

#include <piecework/model/integrator.hpp>
#include <piecework/runner/world.hpp>

namespace piecework::runner {

/// Looks at what passes through what at the start, if the scene lets anything touch, and takes it
/// apart unless the scene says not to; notes both. Rest shapes stay as they are.
/// \pre colliders are added  \param inside_solids  what add_colliders() returned
void prepare_start(World& world, int inside_solids);

/// Integrator::initial_state() with the cloth where prepare_start() has put it.
model::State start_state(const World& world, const model::Integrator& integrator);

}  // namespace piecework::runner
