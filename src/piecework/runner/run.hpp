#pragma once

// A run: a scene simulated into a directory, frame by frame, resumable at any moment.

#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <piecework/mesh/export.hpp>
#include <piecework/runner/record.hpp>
#include <piecework/runner/world.hpp>

namespace piecework::runner {

struct RunOptions {
  std::filesystem::path directory;
  int frames = -1;              ///< frames to simulate; -1: as the scene says
  int threads = 0;              ///< 0: as the scene says, else what the machine allows
  int checkpoint_every = 0;     ///< frames between checkpoints; 0: at the end only
  bool resume = false;          ///< insist on a checkpoint's existence being looked for and said
  bool overwrite = false;       ///< drop what an earlier run left in the directory
  bool log_iterations = false;  ///< iterations.csv, see IterationLog
  bool save_states = true;      ///< state/frame_*.bin, which `piecework render` reads
  std::vector<mesh::ExportFormat> exports;
  std::vector<std::pair<std::string, std::string>> overrides;  ///< recorded
};

/// Watches a run. All calls come from the thread that called run(), outside timed regions.
class RunObserver {
 public:
  virtual ~RunObserver() = default;
  /// The scene is built; simulation starts after frame `first_frame` of `frames`. May throw.
  virtual void started(const World& world, int first_frame, int frames) = 0;
  /// A frame is complete (frame 0: the start state; record is null then).
  virtual void frame_done(const World& world, const model::State& state, int frame,
                          const FrameRecord* record) = 0;
  /// True: stop after this frame, with a checkpoint.
  virtual bool should_stop() = 0;
};

struct RunOutcome {
  int frames_done = 0;     ///< in the directory now, frame 0 not counted
  bool stopped = false;    ///< the observer asked for it before the last frame
  bool simulated = false;  ///< at least one frame was simulated now
  RunRecord record;
  std::unique_ptr<const World> world;  ///< never null
  [[nodiscard]] bool expectations_hold() const;
};

/// Number of frames of a scene.
int frame_count(const scene::Scene& scene);

/// "frame_0007".
std::string frame_name(int frame);

/// Where a run directory keeps the state of a frame: DIR/state/frame_0007.bin.
std::filesystem::path state_file(const std::filesystem::path& directory, int frame);

/// Simulates. An interrupted run of the same scene in the directory is continued with the same
/// bits; a complete one is left as it is.
/// \throws InputError if the directory holds a run of another scene, or as build_world();
///         OutputError; SimulationError, after everything up to the failed step was written.
RunOutcome run(const scene::Scene& scene, const RunOptions& options, RunObserver& observer);

}  // namespace piecework::runner
