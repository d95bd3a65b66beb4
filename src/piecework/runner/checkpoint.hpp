#pragma once

// The state of a run on disk: all that is needed to go on with the same bits.

#include <filesystem>
#include <optional>
#include <string>

#include <piecework/model/stepper.hpp>
#include <piecework/runner/world.hpp>

namespace piecework::runner {

/// Hash of what the scene's text says about the motion: the resolved scene without threads, length,
/// pictures, expectations, the name of the quality preset (its numbers count) and the places of its
/// mesh files. A run may be continued under another number of threads or steps.
std::string scene_hash(const scene::Scene& scene);

/// Hash of what determines the motion: scene_hash() and the meshes themselves (start and rest
/// shapes, triangles, held vertices).
std::string motion_hash(const World& world);

/// Writes the state (double, bit for bit) with the scene's motion hash and a checksum.
/// \throws OutputError.
void write_state(const std::filesystem::path& path, const model::State& state,
                 const std::string& hash);

/// Reads what write_state() wrote.
/// \param num_vertices  the file must have as many.
/// \throws InputError if the file is missing, damaged, or belongs to another scene.
model::State read_state(const std::filesystem::path& path, const std::string& hash,
                        int num_vertices);

}  // namespace piecework::runner
