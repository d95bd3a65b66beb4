#pragma once

// Private to the module: document -> Scene, and what must hold between keys of different places.

#include <piecework/scene/document.hpp>
#include <piecework/scene/scene.hpp>

namespace piecework::scene {

/// The scene that a document with its overrides says, checked. \throws InputError.
Scene read_scene(const Document& document);

/// Checks references by name (materials, cloths) and orders (min <= max, start <= stop) of a scene
/// that was read from `document`.
/// \throws InputError at the place of the first fault.
void check_rules(const Scene& scene, const Document& document);

}  // namespace piecework::scene
