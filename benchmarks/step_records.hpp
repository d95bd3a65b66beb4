#pragma once

// Steps of a simulation as records, their summary as counters, and the records as JSON.

#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include <piecework/model/integrator.hpp>

namespace piecework::bench {

/// One step.
struct StepRecord {
  int step = 0;       ///< from 1
  double cpu_ms = 0;  ///< processor time of all threads
  model::StepReport report;
  /// Largest distance of its end from the exact end, in mean edges; NaN: not known.
  double true_error = std::numeric_limits<double>::quiet_NaN();

  /// \pre the integrator has contact
  [[nodiscard]] const model::ContactReport& contact() const { return *report.contact; }
};

/// Takes a step.
StepRecord take_step(model::Integrator& integrator, model::State& state);

/// One step again from `before`, by an integrator that solves it far more tightly: the largest
/// distance of its end from `x`, over `unit`. NaN if that does not converge.
double distance_from_exact(model::Integrator& exact, model::State before, const Positions& x,
                           double unit);

/// Times, iterations, shares of the phases, contacts and their growth, by name. A share is of the
/// time of all steps. \pre records not empty, with contact
std::map<std::string, double> summary(const std::vector<StepRecord>& records);

/// Why the records are not valid: something passed through something, or nothing ever touched.
/// Empty: they are.
std::string defect(const std::vector<StepRecord>& records);

/// The records of one row of the benchmark.
struct RecordedRun {
  std::string family, scene, tolerance;
  std::int64_t n = 0;  ///< vertices
  int threads = 0;
  std::vector<StepRecord> records;
};

/// {"schema": "piecework.step_records/1", "columns": [...], "runs": [{..., "points": [[...],
/// ...]}]}; what is not finite is null.
std::string records_json(const std::vector<RecordedRun>& runs);

}  // namespace piecework::bench
