#pragma once

// Hand-made run directories, for tests of what reads them.

#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include <piecework/core/atomic_file.hpp>
#include <piecework/runner/checkpoint.hpp>
#include <piecework/runner/run.hpp>

namespace piecework::runner {

/// What a hand-made run looks like: two triangles, four vertices that fall by `speed` m/s along y,
/// vertex 0 shifted by `offset` m along x from frame 1 on.
struct MadeRun {
  double h = 0.1;
  int output_every = 1;
  int frames = 3;
  double speed = 1;
  double offset = 0;
  double step_ms = 2;
  double energy = 10;
  int iterations = 5;                    ///< per step
  double gradient = 1e-3, error = 1e-2;  ///< of the last frame; half of it in those before
  std::string triangles_hash = "t";
  int vertices = 4, triangles = 2;
  bool states = true;
  double start_shift = 0;  ///< of the whole cloth, m
};

inline Positions made_positions(const MadeRun& made, double time, bool moved) {
  Positions x = Positions::Zero(made.vertices, 3);
  for (int i = 0; i < made.vertices; ++i)
    x.row(i) << i % 2 + made.start_shift, -made.speed * time, i / 2;
  if (moved) x(0, 0) += made.offset;
  return x;
}

/// Writes run.json and the states.
inline void make_run(const std::filesystem::path& directory, const MadeRun& made) {
  const std::string hash = "0123456789abcdef";
  ensure_directory(directory / "state");
  nlohmann::ordered_json frames = nlohmann::ordered_json::array();
  for (int frame = 0; frame <= made.frames; ++frame) {
    const int step = frame * made.output_every;
    const model::State state{made_positions(made, step * made.h, frame > 0),
                             Positions::Zero(made.vertices, 3), step * made.h, step};
    if (made.states) write_state(state_file(directory, frame), state, hash);
    if (frame == 0) continue;
    const double share = frame == made.frames ? 1 : 0.5;
    frames.push_back({{"frame", frame},
                      {"step", step},
                      {"time_s", state.time},
                      {"steps", made.output_every},
                      {"step_ms", made.step_ms},
                      {"step_ms_min", made.step_ms},
                      {"step_ms_max", made.step_ms},
                      {"phases_ms", nlohmann::ordered_json::object()},
                      {"counters",
                       {{"iterations", made.iterations * made.output_every},
                        {"global_solves", 0},
                        {"converged_steps", frame == 1 ? 0 : made.output_every},
                        {"degenerate_projections", 0}}},
                      {"gradient", share * made.gradient},
                      {"error_mean_edges", share * made.error},
                      {"energy_j", made.energy},
                      {"dx_unit_box", {{"norm_2", 0}, {"rms", 0}, {"inf", 0}}}});
  }
  const nlohmann::ordered_json record = {
      {"schema", "piecework.run/1"},
      {"environment", {{"cpu", "hand-made"}, {"load_before", 1}}},
      {"scene",
       {{"name", "made"},
        {"motion_hash", hash},
        {"vertices", made.vertices},
        {"triangles", made.triangles},
        {"triangles_hash", made.triangles_hash},
        {"h_s", made.h},
        {"mean_edge_m", 1}}},
      {"frames", frames},
      {"expectations", nlohmann::ordered_json::array()}};
  write_file_atomically(directory / "run.json", record.dump());
}

}  // namespace piecework::runner
