#pragma once

// A plan of a sweep: one scene, and the settings under which it is run. docs/sweep.md has the keys.

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <piecework/scene/scene_io.hpp>

namespace piecework::scene {

/// More cases than this are taken for a mistake.
inline constexpr std::size_t kMaxCases = 10'000;

/// The settings of one run, without those that all runs share.
using Case = std::vector<Setting>;

struct Plan {
  std::string name;         ///< absent: the file's name without .json
  std::string description;  ///< one sentence for people
  std::filesystem::path scene;
  std::vector<Setting> common;    ///< of every run, the reference included: `set` and `steps`
  std::vector<std::string> keys;  ///< that differ between cases, in the order of the plan
  std::vector<Case> cases;        ///< products first, the first key slowest; then `cases`
  std::optional<Case> reference;  ///< the run that errors are measured against
  std::filesystem::path source;   ///< file it was read from
};

/// Parses `text` (JSON with comments) and expands its products. Keys and values of the scene are
/// not looked at: load_scene_with() judges them, and names their place in the plan.
/// \throws InputError "<source>:<line>:<column>: <pointer>: <problem>; <remedy>"; unknown keys are
///         answered with the nearest known name.
Plan parse_plan(std::string_view text, const std::string& source);

/// Reads a plan from a file. Its scene's name starts at the plan's folder; if there is no such
/// file, a built-in scene of that name is taken. \throws InputError as above.
Plan load_plan(const std::filesystem::path& path);

}  // namespace piecework::scene
