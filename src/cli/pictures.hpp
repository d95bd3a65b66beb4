#pragma once

// From states to PNG files: colours, one camera for all frames, drawing; encoding on a worker.

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <piecework/runner/world.hpp>
#include <renderer/renderer.hpp>

#include "progress.hpp"

namespace piecework::cli {

struct PictureOptions {
  int width = 1280;
  int height = 720;
  std::string color = "domain";
  std::string gl = "auto";
  bool borders = true;
  bool mesh_lines = false;
  bool fast = false;  ///< no shadows, no ambient occlusion
};

/// What the scene's `render` says.
PictureOptions picture_options(const scene::Scene& scene);

/// Opens and closes an OpenGL context as take_pictures() will. \throws BackendError; InputError,
/// also if the colours show contact and nothing in the scene can touch.
void check_pictures(const scene::Scene& scene, const PictureOptions& options);

/// One picture to take.
struct Shot {
  std::function<Positions()> positions;  ///< |V| x 3, m; called when the picture is drawn
  double time = 0;                       ///< s; shown in the corner unless `caption` is given
  std::string caption;
  std::filesystem::path path;
};

/// Draws all shots with one camera and one colour scale that fit all of them, and writes them.
/// \throws BackendError without any OpenGL; InputError as check_pictures(); OutputError.
void take_pictures(const runner::World& world, const std::vector<Shot>& shots,
                   const PictureOptions& options, Progress& progress);

/// Up to `count` of the pictures, evenly chosen, on one sheet.
void write_contact_sheet(const std::vector<Shot>& shots, const std::filesystem::path& path,
                         int count = 12);

/// Shots of the frames first ... last of a run directory, from its saved states.
/// \param pattern  file name with {frame} or {frame:04}, relative to the directory
/// \throws InputError if a state is missing.
std::vector<Shot> shots_of_run(const runner::World& world, const std::filesystem::path& directory,
                               int first, int last, const std::string& pattern);

}  // namespace piecework::cli
