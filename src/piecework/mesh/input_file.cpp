#include <piecework/mesh/input_file.hpp>

#include <algorithm>
#include <cctype>
#include <system_error>

#include <fmt/format.h>

#include <piecework/core/error.hpp>

namespace piecework::mesh {

namespace fs = std::filesystem;

std::string lower_extension(const fs::path& path) {
  std::string text = path.extension().string();
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

void check_file(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status))
    throw InputError(fmt::format("{}: file not found; correct the path", path.string()));
  if (!fs::is_regular_file(status))
    throw InputError(fmt::format("{}: not a regular file; name a mesh file", path.string()));
  if (fs::file_size(path, error) == 0)
    throw InputError(fmt::format("{}: file is empty; export the mesh again", path.string()));
}

}  // namespace piecework::mesh
