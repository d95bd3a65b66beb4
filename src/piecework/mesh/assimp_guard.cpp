#include <piecework/mesh/assimp_guard.hpp>

#include <algorithm>
#include <cstdint>
#include <string_view>
#include <vector>

#include <assimp/DefaultIOSystem.h>
#include <assimp/importerdesc.h>
#include <assimp/scene.h>
#include <fmt/format.h>
#include <assimp/Importer.hpp>

#include <piecework/core/error.hpp>

namespace piecework::mesh {
namespace {

namespace fs = std::filesystem;

/// Opens regular files in the mesh's folder and below only, whatever the file asks for.
class FolderIOSystem : public Assimp::DefaultIOSystem {
 public:
  explicit FolderIOSystem(const fs::path& folder) : folder_(fs::weakly_canonical(folder)) {}

  bool Exists(const char* file) const override {
    return is_allowed(file) && DefaultIOSystem::Exists(file);
  }
  Assimp::IOStream* Open(const char* file, const char* mode) override {
    return is_allowed(file) ? DefaultIOSystem::Open(file, mode) : nullptr;
  }

 private:
  [[nodiscard]] bool is_allowed(const char* file) const {
    std::error_code error;
    const fs::path real = fs::canonical(file, error);
    if (error || !fs::is_regular_file(real, error)) return false;
    const fs::path relative = real.lexically_relative(folder_);
    return !relative.empty() && *relative.begin() != "..";
  }

  fs::path folder_;
};

bool handles(const aiImporterDesc& description, std::string_view extension) {
  std::string_view list = description.mFileExtensions;
  while (!list.empty()) {
    const std::size_t end = list.find(' ');
    if (list.substr(0, end) == extension.substr(1)) return true;
    list.remove_prefix(end == std::string_view::npos ? list.size() : end + 1);
  }
  return false;
}

/// Leaves only the importers of one extension: assimp otherwise tries others on odd content.
void keep_importers(Assimp::Importer& importer, std::string_view extension) {
  std::vector<Assimp::BaseImporter*> others;
  for (std::size_t i = 0; i < importer.GetImporterCount(); ++i) {
    const aiImporterDesc* description = importer.GetImporterInfo(i);
    if (description == nullptr || !handles(*description, extension))
      others.push_back(importer.GetImporter(i));
  }
  for (Assimp::BaseImporter* other : others) importer.UnregisterLoader(other);
}

}  // namespace

const aiScene& read_guarded(Assimp::Importer& importer, const fs::path& path,
                            const std::string& extension) {
  keep_importers(importer, extension);
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  importer.SetIOHandler(new FolderIOSystem(folder));  // owned by the importer
  const aiScene* scene = importer.ReadFile(path.string(), 0);
  if (scene == nullptr)
    throw InputError(fmt::format("{}: cannot be read: {}; {}", path.string(),
                                 importer.GetErrorString(), kExportAgain));
  return *scene;
}

ChildLimits limits_for(const fs::path& path, bool refers_to_others) {
  ChildLimits limits;
  std::error_code error;
  const std::uintmax_t bytes = fs::file_size(path, error);
  if (error || refers_to_others) return limits;
  constexpr std::uintmax_t kMebibyte = std::uintmax_t{1} << 20;
  limits.memory_bytes =
      std::min<std::uintmax_t>(limits.memory_bytes, 512 * kMebibyte + 200 * bytes);
  limits.seconds = std::min(limits.seconds, static_cast<unsigned>(10 + bytes / kMebibyte));
  return limits;
}

}  // namespace piecework::mesh
