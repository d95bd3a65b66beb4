#pragma once

// What keeps assimp on a short lead. Internal to mesh/, and to be called in a child process only.

#include <filesystem>
#include <string>

#include <piecework/mesh/child_process.hpp>

struct aiScene;
namespace Assimp {
class Importer;
}

namespace piecework::mesh {

inline constexpr const char* kExportAgain =
    "the file is probably corrupt: export it again or convert it to OBJ";

/// Reads a file with the importers for its extension alone and without post-processing; other files
/// are opened only in the same folder or below it. The scene belongs to the importer.
/// \param extension  lower case with its dot \throws InputError if assimp cannot read it
const aiScene& read_guarded(Assimp::Importer& importer, const std::filesystem::path& path,
                            const std::string& extension);

/// Limits by the size of the file, so that a small hostile one cannot take minutes and gigabytes.
/// Chosen generously: assimp needs up to about 40 bytes of memory per byte of file. A file that
/// `refers_to_others` (.gltf) stands for data of unknown size and gets the defaults.
ChildLimits limits_for(const std::filesystem::path& path, bool refers_to_others);

}  // namespace piecework::mesh
