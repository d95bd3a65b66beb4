#include <piecework/runner/saved_run.hpp>

#include <limits>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/error.hpp>
#include <piecework/runner/checkpoint.hpp>
#include <piecework/runner/run.hpp>

namespace piecework::runner {
namespace {

namespace fs = std::filesystem;

std::string read_record(const fs::path& directory) {
  std::error_code ignored;
  if (!fs::is_directory(directory, ignored))
    throw InputError(
        fmt::format("{}: no such folder; name one that `piecework run` wrote", directory.string()));
  if (!fs::exists(directory / "run.json", ignored))
    throw InputError(fmt::format(
        "{}: has no run.json, so no run has finished or stopped here; name a folder that "
        "`piecework run` wrote",
        directory.string()));
  return read_file(directory / "run.json");
}

}  // namespace

SavedRun read_saved_run(const fs::path& directory) {
  const std::string text = read_record(directory);
  const std::string source = (directory / "run.json").string();
  SavedRun run;
  run.directory = directory;
  run.frames = recorded_part(text, source, std::numeric_limits<int>::max()).frames;
  try {
    const auto json = nlohmann::ordered_json::parse(text);
    const auto& scene = json.at("scene");
    run.scene_name = scene.at("name");
    run.motion_hash = scene.at("motion_hash");
    run.triangles_hash = scene.value("triangles_hash", "");
    run.vertices = scene.at("vertices");
    run.triangles = scene.at("triangles");
    run.h = scene.at("h_s");
    run.mean_edge = scene.at("mean_edge_m");
    run.disturbed = json.at("environment").value("disturbed", false);
    run.environment_json = json.at("environment").dump();
  } catch (const nlohmann::json::exception& error) {
    throw InputError(fmt::format("{}: not a run record of this version ({}); run the scene again",
                                 source, error.what()));
  }
  return run;
}

model::State read_saved_state(const SavedRun& run, int frame) {
  const fs::path path = state_file(run.directory, frame);
  std::error_code ignored;
  if (!fs::exists(path, ignored))
    throw InputError(fmt::format(
        "{}: the state of frame {} was not kept ({} is missing); run it again without --no-state",
        run.directory.string(), frame, path.string()));
  return read_state(path, run.motion_hash, run.vertices);
}

}  // namespace piecework::runner
