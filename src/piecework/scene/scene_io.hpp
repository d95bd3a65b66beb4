#pragma once

// Scene text <-> Scene, and everything else that the table of keys gives: schema and reference.

#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <piecework/scene/scene.hpp>

namespace piecework::scene {

/// "solver.domains" = "16": overrides any key before the scene is checked; the path is dotted or a
/// JSON pointer, list items by number; the value is JSON, or a plain string if it is not JSON.
using Override = std::pair<std::string, std::string>;

/// Parses `text` (JSON with // and /* */ comments), applies overrides, fills in defaults, checks
/// types, ranges and references between keys.
/// \throws InputError "<source>:<line>:<column>: <pointer>: <problem>; <remedy>"; unknown keys are
///         answered with the nearest known name.
Scene parse_scene(std::string_view text, const std::string& source,
                  const std::vector<Override>& overrides = {});

/// Reads a scene from a file, or a built-in scene by name if no such file exists.
/// \throws InputError as above; an unknown name is answered with the nearest built-in scenes.
Scene load_scene(const std::filesystem::path& path, const std::vector<Override>& overrides = {});

/// An override that stands in another file; `source` begins the messages about it:
/// "plan.json:3:12: /vary/solver.domains/0".
struct Setting {
  std::string key;
  std::string value;
  std::string source;
};

/// load_scene() with settings, the later ones over the earlier ones.
Scene load_scene_with(const std::filesystem::path& path, const std::vector<Setting>& settings);

/// The scene with every default filled in, as JSON that parse_scene() reads back to the same data.
std::string resolved_json(const Scene& scene);

/// JSON Schema (draft-07) of the scene file.
std::string json_schema();

/// Reference of every key in Markdown (docs/scene.md is this text; a test holds them together).
std::string reference_markdown();

struct BuiltinScene {
  std::string name;
  std::string description;
  std::filesystem::path path;
};

/// Scenes shipped in scenes/, by name. Looked for beside the program, then in the source tree, or
/// where PIECEWORK_SCENES points.
std::vector<BuiltinScene> builtin_scenes();

}  // namespace piecework::scene
