#pragma once

// A small scene for this folder's tests.

#include <filesystem>
#include <string>

#include <unistd.h>

#include <fmt/format.h>

#include <piecework/core/error.hpp>
#include <piecework/runner/world.hpp>
#include <piecework/scene/scene_io.hpp>

namespace piecework::runner {

/// A hanging sheet of 8 x 7 vertices in two materials' worth of detail: fast, and everything is on.
inline scene::Scene small_scene(const std::vector<scene::Override>& overrides = {}) {
  return scene::parse_scene(R"({
    "name": "small", "step": {"h": 0.01, "steps": 8},
    "wind": {"velocity": [1, 0, 2]}, "damping": 0.5,
    "solver": {"domains": 4},
    "quality": {"stop": "iterations", "max_iterations": 6},
    "materials": {"cotton": {"density": 0.5, "stretching": 261, "bending": 1e-5}},
    "cloths": [{"name": "sheet", "material": "cotton",
      "mesh": {"generator": "sheet", "columns": 8, "rows": 7},
      "pins": [{"region": {"vertices": [0, 7]}}]}],
    "expect": [{"quantity": "lowest_y", "at": 0.03, "max": 0}, {"quantity": "center_y", "max": -0.001}]
  })",
                            "small.json", overrides);
}

/// A folder that is removed at the end.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    static int count = 0;
    path_ = std::filesystem::temp_directory_path() /
            fmt::format("piecework_runner_{}_{}", ::getpid(), count++);
    std::filesystem::create_directories(path_);
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// What build_world() says against a scene; empty if nothing.
inline std::string refusal(const scene::Scene& scene) {
  try {
    (void)build_world(scene);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

}  // namespace piecework::runner
