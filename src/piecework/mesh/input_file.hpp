#pragma once

// Names of mesh files, looked at before any reader is. Internal to mesh/.

#include <filesystem>
#include <string>

namespace piecework::mesh {

/// Lower case with its dot, ".glb"; empty if there is none.
std::string lower_extension(const std::filesystem::path& path);

/// \throws InputError if there is no such file, or it is empty or no regular file
void check_file(const std::filesystem::path& path);

}  // namespace piecework::mesh
