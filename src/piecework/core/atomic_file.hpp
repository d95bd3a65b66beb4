#pragma once

// Files that are whole or absent: temporary name in the same folder, fsync, rename, fsync of the
// folder. A program killed at any moment leaves either the old file or the new one.

#include <filesystem>
#include <string_view>

namespace piecework {

/// Writes `content` to `path`, replacing what was there in one step. Links are followed; a device,
/// pipe or folder is refused.
/// \throws OutputError with path and reason; then `path` is as it was before and no temporary
///         file is left.
void write_file_atomically(const std::filesystem::path& path, std::string_view content);

/// Reads a whole file.
/// \throws InputError if it is missing, a folder, unreadable, or larger than `max_bytes`.
std::string read_file(const std::filesystem::path& path,
                      std::size_t max_bytes = std::size_t{1} << 33);

/// Creates a folder and its parents. \throws OutputError with path and reason.
void ensure_directory(const std::filesystem::path& path);

}  // namespace piecework
