// Scenes from files, and the ones that come with the program.

#include <algorithm>
#include <cstdlib>

#include <fmt/format.h>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/error.hpp>
#include <piecework/scene/document.hpp>
#include <piecework/scene/nearest.hpp>
#include <piecework/scene/scene_io.hpp>
#include <piecework/scene/scene_rules.hpp>

namespace piecework::scene {
namespace {

namespace fs = std::filesystem;

bool is_folder(const fs::path& path) {
  std::error_code ignored;
  return fs::is_directory(path, ignored);
}

/// \throws InputError if PIECEWORK_SCENES is set to something that is no folder.
fs::path scenes_folder() {
  if (const char* named = std::getenv("PIECEWORK_SCENES"); named && *named) {
    if (!is_folder(named))
      throw InputError(fmt::format(
          "PIECEWORK_SCENES: {} is not a folder; correct or unset the variable", named));
    return named;
  }
  std::error_code ignored;
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored);
  const fs::path installed = program.parent_path().parent_path() / "share/piecework/scenes";
  return is_folder(installed) ? installed : fs::path(PIECEWORK_SCENE_DIR);
}

/// What the file says about itself, or why it cannot be read.
std::string description_of(const fs::path& path) {
  try {
    const Document document = parse_document(read_file(path, kMaxTextBytes), path.string());
    const Node* node = document.root.find("description");
    const std::string* text = node ? std::get_if<std::string>(&node->data) : nullptr;
    return text ? *text : "";
  } catch (const InputError& error) {
    return fmt::format("(unusable: {})", error.what());
  }
}

/// The file that `name` means.
/// \throws InputError with the nearest built-in names.
fs::path find_scene(const fs::path& name) {
  std::error_code ignored;
  if (fs::exists(name, ignored) && !is_folder(name)) return name;
  std::vector<std::string> known;
  for (const BuiltinScene& builtin : builtin_scenes()) {
    if (name == builtin.name || name == builtin.name + ".json") return builtin.path;
    known.push_back(builtin.name);
  }
  throw InputError(fmt::format(
      "{}: {}; {}", name.string(),
      is_folder(name) ? "is a folder, not a scene" : "no such file, nor a built-in scene",
      known.empty() ? "check the path"
                    : suggestion(name.stem().string(), known, "built-in scenes")));
}

/// A relative name counts from the scene's folder, wherever the program runs.
void resolve(std::string& file, const fs::path& folder) {
  if (!file.empty()) file = (folder / file).lexically_normal().string();
}

Scene with_resolved_files(Scene scene, const fs::path& file) {
  const fs::path folder = fs::absolute(file).parent_path();
  for (Cloth& cloth : scene.cloths) {
    resolve(cloth.mesh.file, folder);
    resolve(cloth.rest_file, folder);
  }
  for (Seam& seam : scene.seams) resolve(seam.file, folder);
  for (Collider& collider : scene.colliders) {
    if (collider.mesh) resolve(collider.mesh->file, folder);
    if (collider.sequence) resolve(collider.sequence->pattern, folder);
    if (collider.avatar) resolve(collider.avatar->file, folder);
  }
  return scene;
}

}  // namespace

Scene load_scene(const fs::path& path, const std::vector<Override>& overrides) {
  const fs::path file = find_scene(path);
  return with_resolved_files(parse_scene(read_file(file, kMaxTextBytes), file.string(), overrides),
                             file);
}

Scene load_scene_with(const fs::path& path, const std::vector<Setting>& settings) {
  const fs::path file = find_scene(path);
  Document document = parse_document(read_file(file, kMaxTextBytes), file.string());
  for (const Setting& s : settings) apply_override(document, s.key, s.value, s.source);
  return with_resolved_files(read_scene(document), file);
}

std::vector<BuiltinScene> builtin_scenes() {
  std::vector<BuiltinScene> scenes;
  std::error_code failed;
  for (const auto& entry : fs::directory_iterator(scenes_folder(), failed))
    if (entry.path().extension() == ".json" && !is_folder(entry.path()))
      scenes.push_back({entry.path().stem().string(), description_of(entry.path()), entry.path()});
  std::sort(scenes.begin(), scenes.end(),
            [](const BuiltinScene& a, const BuiltinScene& b) { return a.name < b.name; });
  return scenes;
}

}  // namespace piecework::scene
