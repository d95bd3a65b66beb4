#pragma once

// A sweep: the cases of a plan, each run into a directory of its own, and a table over them.
// docs/sweep.md is the user's page.
//
//     DIR/<case>/            a run directory, and
//     DIR/<case>/case.json   how it ended; written last, so its presence means: finished
//     DIR/sweep.md, .csv, .json   written when all cases are finished

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <piecework/runner/compare.hpp>
#include <piecework/scene/plan.hpp>

namespace piecework::runner {

/// One run of a sweep.
struct SweepJob {
  /// Of its directory: "tolerance-0.01_domains-16_1f2e3d4c", letters, digits and "._+-" only. The
  /// last part is a hash of what is simulated, so that an edited scene gets new directories.
  std::string name;
  bool reference = false;
  scene::Case own;                       ///< settings that only this case has
  std::vector<scene::Setting> settings;  ///< all, in the order in which they apply
};

/// The runs of a plan, the reference first. Loads the scene under the settings of each.
/// \throws InputError, with the place in the plan, if a case is no valid scene or there twice.
std::vector<SweepJob> sweep_jobs(const scene::Plan& plan);

/// Part `index` of `count`, from 1: the jobs whose number from 0 is index - 1 modulo count.
struct Shard {
  int index = 1, count = 1;
  [[nodiscard]] bool has(std::size_t job) const {
    return job % static_cast<std::size_t>(count) == static_cast<std::size_t>(index - 1);
  }
};

/// How a case ended.
struct CaseRecord {
  int exit_code = 0;
  std::string message;   ///< of a failure
  bool stopped = false;  ///< by a signal: not finished, not recorded
};

/// What case.json in this directory says; nothing if the case is not finished.
std::optional<CaseRecord> read_case(const std::filesystem::path& directory);

/// Runs a job into a directory.
using CaseRunner =
    std::function<CaseRecord(const SweepJob& job, const std::filesystem::path& directory)>;

struct SweepOptions {
  std::filesystem::path directory;
  Shard shard;
  bool retry = false;  ///< failed cases are run again
};

/// Watches a sweep. `number` counts the jobs of the plan from 1.
class SweepObserver {
 public:
  virtual ~SweepObserver() = default;
  virtual void started(const SweepJob& job, std::size_t number) = 0;
  /// \param now  false: it was finished before
  virtual void finished(const SweepJob& job, std::size_t number, const CaseRecord& record,
                        bool now) = 0;
  /// Another process is running it.
  virtual void busy(const SweepJob& job, std::size_t number) = 0;
  virtual bool should_stop() = 0;
};

struct SweepOutcome {
  int failed = 0;        ///< cases of this shard with an exit code other than 0, earlier ones too
  int busy = 0;          ///< cases of this shard that another process is running
  bool stopped = false;  ///< by a signal
  std::size_t missing = 0;  ///< unfinished cases of the whole plan; 0: the tables are written
};

/// Runs the unfinished jobs of a shard one after another, and writes the tables if none is left.
/// A job that fails is recorded, and the sweep goes on.
/// \throws OutputError.
SweepOutcome run_sweep(const scene::Plan& plan, const std::vector<SweepJob>& jobs,
                       const SweepOptions& options, const CaseRunner& run_case,
                       SweepObserver& observer);

/// One line of the table. Of a case that failed, only `record` is known.
struct SweepRow {
  SweepJob job;
  CaseRecord record;
  int steps = 0, converged_steps = 0;
  MedianInterval ms;       ///< per step, over the frames
  bool disturbed = false;  ///< other work took processors from it
  double iterations_per_step = 0;
  double worst_gradient = 0;        ///< rms nodal residual / mean nodal weight
  double worst_error = 0;           ///< estimated, mean edge lengths
  std::optional<Comparison> error;  ///< against the reference
  std::string note;                 ///< why something is missing
};

struct SweepTable {
  std::string name, description, scene;
  std::vector<std::string> keys;  ///< columns: what varies
  bool has_reference = false;
  std::vector<SweepRow> rows;
  std::string environment_json;  ///< of the first run
  int machines = 0;              ///< how many different environments ran cases
};

/// Reads the results of finished jobs; compares them with the reference.
SweepTable read_sweep(const scene::Plan& plan, const std::vector<SweepJob>& jobs,
                      const std::filesystem::path& directory);

std::string to_markdown(const SweepTable& table);
/// RFC 4180, one row per case.
std::string to_csv(const SweepTable& table);
/// Schema "piecework.sweep/1".
std::string to_json(const SweepTable& table);

/// A setting's value as a person writes it: texts without their quotes.
std::string plain_value(const std::string& json);
/// The same for tables and names: numbers with six digits at most.
std::string short_value(const std::string& json);

}  // namespace piecework::runner
