#pragma once

// What a run did, as data, and its renderings: run.json, timings.csv, summary.md. One record, many
// renderings; nothing is measured twice.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <piecework/model/stepper.hpp>
#include <piecework/runner/world.hpp>

namespace piecework::runner {

/// One frame: output_every steps. Times are means per step, ms; counters are sums over its steps.
struct FrameRecord {
  int frame = 0;
  int step = 0;     ///< steps done at its end
  double time = 0;  ///< s
  int steps = 0;    ///< steps in this frame
  double step_ms = 0;
  double step_min_ms = 0, step_max_ms = 0;  ///< fastest and slowest of its steps
  model::PhaseTimes phases;
  int iterations = 0;
  int global_solves = 0;
  int converged_steps = 0;
  int degenerate_projections = 0;
  /// Largest of its steps, `shortened` their sum; absent: nothing can touch.
  std::optional<model::ContactReport> contact;
  double gradient = 0;                      ///< largest of its steps
  double error = 0;                         ///< largest of its steps, in mean edge lengths
  double energy = 0;                        ///< of the last step, J
  double dx_2 = 0, dx_rms = 0, dx_inf = 0;  ///< of the last step

  void add(const model::StepReport& report);
  /// Turns sums of times into means per step.
  void finish(int frame_number, const model::State& state);
  void add_contact(const model::ContactReport& report);
  /// step_ms minus the phases, ms.
  [[nodiscard]] double other_ms() const;
};

/// Sums over the steps of some frames.
struct Totals {
  int steps = 0;
  int converged_steps = 0;
  int iterations = 0;
  int interpenetrations = 0;  ///< largest of any step
};
Totals totals(const std::vector<FrameRecord>& frames);

/// One line of the scene's `expect` with what was found.
struct ExpectationResult {
  std::string text;      ///< "lowest_y at 0.5 s within [-2.5, -0.7]"
  bool reached = false;  ///< false: the run ended before its time, and it does not hold
  double value = 0;
  bool holds = false;
};

struct RunRecord {
  std::string environment_json;  ///< from environment.hpp
  std::string motion_hash;
  std::vector<std::pair<std::string, std::string>> overrides;
  std::string method;  ///< Minimizer::description()
  int threads = 1;
  model::SetupReport setup;  ///< of the solver, before the first step
  std::vector<FrameRecord> frames;
  std::vector<ExpectationResult> expectations;
  double load_before = 0, load_after = 0;  ///< 1-minute load averages
  /// Processors that other work kept busy during the run, on average; below 0: not known.
  double other_processors = -1;
};

/// run.json, schema "piecework.run/1".
std::string to_json(const RunRecord& record, const World& world);

/// The part of a record that a continued run takes over.
struct RecordedPart {
  std::vector<FrameRecord> frames;
  std::vector<ExpectationResult> expectations;
};

/// Reads a run.json written by to_json() up to and including step `last_step`.
/// \throws InputError if the text is not such a file.
RecordedPart recorded_part(std::string_view text, const std::string& source, int last_step);

/// RFC 4180, one row per frame and phase: frame,step,time_s,phase,ms_per_step.
std::string to_csv(const RunRecord& record);

/// The tables as a person pastes them: the paper's Table 1 columns, phases with medians and
/// intervals, accuracy, environment.
std::string to_markdown(const RunRecord& record, const World& world);

}  // namespace piecework::runner
