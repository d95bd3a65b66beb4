// piecework sweep: one scene under many settings, one table.

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <sstream>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/clock.hpp>
#include <piecework/core/error.hpp>
#include <piecework/runner/saved_run.hpp>
#include <piecework/runner/sweep.hpp>
#include <piecework/runner/sweep_scripts.hpp>

#include "case_process.hpp"
#include "commands.hpp"
#include "console.hpp"
#include "signals.hpp"

namespace piecework::cli {
namespace {

namespace fs = std::filesystem;

constexpr const char* kExamples =
    "Run the cases of a plan, each into a directory of its own, and write a table over them: "
    "sweep.md, sweep.csv, sweep.json. Finished cases are skipped. docs/sweep.md has the keys.\n\n"
    "Examples:\n"
    "  piecework sweep plan.json -o out/sweep\n"
    "  piecework sweep plan.json -o out/sweep --shard 2/8      every eighth case, on some machine\n"
    "  piecework sweep plan.json --list                        what would run\n"
    "  piecework sweep plan.json --emit make > sweep.mk        slurm and snakemake likewise";

struct SweepArguments {
  std::string plan;
  std::string directory;
  std::string shard;
  std::string emit;
  bool list = false;
  bool retry = false;
};

runner::Shard parse_shard(const std::string& text) {
  runner::Shard shard;
  char rest = 0;
  if (text.empty()) return shard;
  if (std::sscanf(text.c_str(), "%d/%d%c", &shard.index, &shard.count, &rest) != 2 ||
      shard.index < 1 || shard.index > shard.count)
    throw Error(ExitCode::Usage,
                fmt::format("--shard {}: write i/n, 1 <= i <= n, e.g. --shard 1/4", text));
  return shard;
}

/// Why a case failed: its last words.
std::string complaint(const fs::path& log, int exit_code) {
  constexpr int kSignalled = 128;
  constexpr std::string_view kOurs = "piecework: ";
  std::istringstream lines(read_file(log));
  std::string last, ours;
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty()) last = line;
    if (line.starts_with(kOurs)) ours = line.substr(kOurs.size());
  }
  if (exit_code > kSignalled)  // the kernel says 9 when memory runs out
    return fmt::format("killed by signal {}; it last said: {}", exit_code - kSignalled, last);
  return ours.empty() ? last : ours;
}

runner::CaseRecord run_case(const scene::Plan& plan, const runner::SweepJob& job,
                            const fs::path& directory) {
  std::vector<std::string> arguments = {"run", plan.scene.string(), "-o", directory.string(),
                                        "--no-images"};
  for (const scene::Setting& setting : job.settings) {
    arguments.emplace_back("--set");
    arguments.push_back(setting.key + "=" + setting.value);
  }
  ensure_directory(directory);
  const fs::path log = directory / "log.txt";
  const ChildEnd end = run_piecework(arguments, log);
  return {end.exit_code, end.exit_code == 0 ? "" : complaint(log, end.exit_code), end.stopped};
}

/// One line per case.
class ConsoleObserver : public runner::SweepObserver {
 public:
  ConsoleObserver(const Verbosity& verbosity, fs::path directory, std::size_t jobs)
      : quiet_(verbosity.quiet), directory_(std::move(directory)), jobs_(jobs) {}

  void started(const runner::SweepJob& job, std::size_t number) override {
    watch_.lap();
    if (!quiet_) say("[{}/{}] {} ...\n", number, jobs_, job.name);
  }

  void finished(const runner::SweepJob& job, std::size_t number, const runner::CaseRecord& record,
                bool now) override {
    if (record.exit_code != 0)
      say("[{}/{}] {}: failed{} with exit code {}: {}\n", number, jobs_, job.name,
          now ? "" : " before", record.exit_code, record.message);
    else if (!quiet_)
      say("[{}/{}] {}: {}\n", number, jobs_, job.name, now ? result(job) : "finished before");
  }

  void busy(const runner::SweepJob& job, std::size_t number) override {
    say("[{}/{}] {}: another process is running it\n", number, jobs_, job.name);
  }

  bool should_stop() override { return stop_signal() != 0; }

 private:
  [[nodiscard]] std::string result(const runner::SweepJob& job) const {
    const auto frames = runner::read_saved_run(directory_ / job.name).frames;
    const runner::Totals sum = runner::totals(frames);
    std::vector<double> ms;
    for (const runner::FrameRecord& frame : frames) ms.push_back(frame.step_ms);
    return fmt::format("{:.3g} ms/step, {:.3g} it, {}/{} steps converged ({:.1f} s)",
                       median_interval(ms).median, double(sum.iterations) / std::max(1, sum.steps),
                       sum.converged_steps, sum.steps, 1e-3 * watch_.elapsed_ms());
  }

  bool quiet_;
  fs::path directory_;
  std::size_t jobs_;
  Stopwatch watch_;
};

int print_script(const SweepArguments& arguments, const std::vector<runner::SweepJob>& jobs,
                 const std::string& directory) {
  const runner::ScriptOptions options{arguments.plan, directory};
  fmt::print("{}", arguments.emit == "make"    ? runner::makefile(jobs, options)
                   : arguments.emit == "slurm" ? runner::slurm_script(jobs, options)
                                               : runner::snakefile(jobs, options));
  return 0;
}

int print_list(const std::vector<runner::SweepJob>& jobs, const runner::Shard& shard,
               const fs::path& directory) {
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    if (!shard.has(i)) continue;
    const auto record = runner::read_case(directory / jobs[i].name);
    fmt::print("{}/{} {} {}\n", i + 1, jobs.size(), jobs[i].name,
               !record                  ? "unfinished"
               : record->exit_code == 0 ? "finished"
                                        : fmt::format("failed ({})", record->exit_code));
  }
  return 0;
}

int report(const runner::SweepOutcome& outcome, const fs::path& directory, bool quiet) {
  if (outcome.missing == 0)
    fmt::print("{}\n", (directory / "sweep.md").string());
  else if (!quiet)
    say("{} cases of the plan are not finished; the tables are written when all are\n",
        outcome.missing);
  constexpr int kSignalled = 128;
  if (outcome.stopped) {
    say("stopped; the same command continues\n");
    return kSignalled + (stop_signal() != 0 ? stop_signal() : SIGTERM);
  }
  if (outcome.failed > 0)
    say("{} cases failed; their log.txt say more, --retry runs them again\n", outcome.failed);
  return static_cast<int>(outcome.failed + outcome.busy > 0 ? ExitCode::SimulationFailed
                                                            : ExitCode::Ok);
}

int sweep(const SweepArguments& arguments, const Verbosity& verbosity) {
  const runner::Shard shard = parse_shard(arguments.shard);
  const scene::Plan plan = scene::load_plan(arguments.plan);
  const std::vector<runner::SweepJob> jobs = runner::sweep_jobs(plan);
  const std::string directory =
      arguments.directory.empty() ? "out/" + plan.name : arguments.directory;
  if (!arguments.emit.empty()) return print_script(arguments, jobs, directory);
  if (arguments.list) return print_list(jobs, shard, directory);

  const SignalGuard guard;
  ConsoleObserver observer(verbosity, directory, jobs.size());
  const auto run = [&](const runner::SweepJob& job, const fs::path& where) {
    return run_case(plan, job, where);
  };
  const runner::SweepOutcome outcome = runner::run_sweep(
      plan, jobs, {.directory = directory, .shard = shard, .retry = arguments.retry}, run,
      observer);
  return report(outcome, directory, verbosity.quiet);
}

}  // namespace

void add_sweep(CLI::App& program, Action& action, const Verbosity& verbosity) {
  auto arguments = std::make_shared<SweepArguments>();
  CLI::App* app = program.add_subcommand("sweep", kExamples);
  app->add_option("plan", arguments->plan, "Plan file")->required();
  app->add_option("-o,--output", arguments->directory, "Directory [out/<plan name>]");
  CLI::Option* shard =
      app->add_option("--shard", arguments->shard, "Run part i of n only, e.g. 1/4");
  app->add_flag("--retry", arguments->retry, "Run cases that failed again");
  CLI::Option* list = app->add_flag("--list", arguments->list, "Print the cases, run nothing");
  app->add_option("--emit", arguments->emit,
                  "Print a script that runs the cases instead: make, slurm or snakemake")
      ->check(CLI::IsMember({"make", "slurm", "snakemake"}))
      ->excludes(shard)
      ->excludes(list);
  app->callback([arguments, &action, &verbosity] {
    action = [arguments, &verbosity] { return sweep(*arguments, verbosity); };
  });
}

}  // namespace piecework::cli
