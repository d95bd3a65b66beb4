#pragma once

// The scene's `seams` made real.

#include <piecework/runner/world.hpp>

namespace piecework::runner {

/// Turns the scene's seams into model.sewing and world.seam_neighbors. Without seams nothing is
/// done. \pre documents and model are there. \throws InputError that names scene, pointer, vertex
/// and remedy: unknown vertices or sets, chains
///         that are no path along a border, contradictions (mesh::resolve_seams), a seam that sews
///         nothing, an open seam without close_time.
void sew(World& world);

/// Moves pins from sewn vertices to what carries them (model::pins_on_carriers).
/// \throws InputError if pins contradict each other through a seam.
void hold_seams(World& world);

}  // namespace piecework::runner
