#pragma once

// A run as it lies in its directory, read back without building its scene.

#include <filesystem>
#include <string>
#include <vector>

#include <piecework/model/stepper.hpp>
#include <piecework/runner/record.hpp>

namespace piecework::runner {

struct SavedRun {
  std::filesystem::path directory;
  std::string scene_name;
  std::string motion_hash;
  std::string triangles_hash;  ///< empty: written by a version that did not record it
  int vertices = 0;
  int triangles = 0;
  double h = 0;            ///< s
  double mean_edge = 0;    ///< m
  bool disturbed = false;  ///< other work took processors from it
  std::string environment_json;
  std::vector<FrameRecord> frames;  ///< without frame 0
};

/// Reads DIR/run.json. \throws InputError if there is no such folder or file, or it is not ours.
SavedRun read_saved_run(const std::filesystem::path& directory);

/// Reads the state of a frame. \throws InputError if it was not kept (--no-state) or is damaged.
model::State read_saved_state(const SavedRun& run, int frame);

}  // namespace piecework::runner
