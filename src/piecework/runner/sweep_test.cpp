#include <piecework/runner/sweep.hpp>

#include <fcntl.h>
#include <sys/file.h>

#include <algorithm>
#include <map>
#include <set>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <piecework/core/descriptor.hpp>
#include <piecework/core/error.hpp>
#include <piecework/runner/sweep_scripts.hpp>

#include "saved_run_test_util.hpp"
#include "small_scene.hpp"

namespace piecework::runner {
namespace {

namespace fs = std::filesystem;

constexpr const char* kScene = R"({"step": {"h": 0.01, "steps": 8},
    "materials": {"m": {"stretching": 261}},
    "cloths": [{"material": "m", "mesh": {"generator": "sheet", "columns": 4, "rows": 4}}]})";

class Counter : public SweepObserver {
 public:
  void started(const SweepJob&, std::size_t) override { ++starts; }
  void finished(const SweepJob&, std::size_t, const CaseRecord&, bool now) override {
    skipped += !now;
  }
  void busy(const SweepJob&, std::size_t) override { ++busies; }
  bool should_stop() override { return false; }
  int starts = 0, skipped = 0, busies = 0;
};

class Sweep : public ::testing::Test {
 protected:
  void SetUp() override { write_file_atomically(folder_.path() / "scene.json", kScene); }

  [[nodiscard]] scene::Plan plan(const std::string& more) const {
    write_file_atomically(folder_.path() / "plan.json",
                          fmt::format(R"({{"scene": "scene.json", {}}})", more));
    return scene::load_plan(folder_.path() / "plan.json");
  }
  [[nodiscard]] fs::path out() const { return folder_.path() / "out"; }

  /// Runs with hand-made results.
  SweepOutcome run(const scene::Plan& plan, const CaseRunner& runner, SweepOptions options = {}) {
    options.directory = out();
    return run_sweep(plan, sweep_jobs(plan), options, runner, counter_);
  }

  TemporaryFolder folder_;
  Counter counter_;
};

/// Every case succeeds.
CaseRecord succeed(const SweepJob&, const fs::path& directory) {
  make_run(directory, {});
  return {};
}

std::vector<std::string> names(const std::vector<SweepJob>& jobs) {
  std::vector<std::string> found;
  for (const SweepJob& job : jobs) found.push_back(job.name);
  return found;
}

TEST_F(Sweep, NamesAreReadableStableAndFitForFiles) {
  const char* keys = R"("vary": {"solver.domains": [1, 2], "quality.tolerance": [0.01]},
                        "cases": [{"solver.global": "single", "gravity": [0, -1, 0]}],
                        "reference": {"quality.preset": "reference"})";
  const auto jobs = sweep_jobs(plan(keys));
  ASSERT_EQ(jobs.size(), 4U);
  EXPECT_TRUE(jobs[0].reference);
  EXPECT_EQ(jobs[0].name.substr(0, 10), "reference_");
  EXPECT_EQ(jobs[1].name.substr(0, 25), "domains-1_tolerance-0.01_");
  EXPECT_EQ(jobs[3].name.substr(0, 29), "global-single_gravity-0--1-0_");
  for (const SweepJob& job : jobs)
    EXPECT_EQ(job.name.find_first_not_of(
                  "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._+-"),
              std::string::npos)
        << job.name;
  EXPECT_EQ(names(sweep_jobs(plan(keys))), names(jobs));
  // Another place of the scene, or other words in it, change nothing; other physics do.
  std::string edited = kScene;
  write_file_atomically(folder_.path() / "scene.json", "// a comment\n" + edited);
  EXPECT_EQ(names(sweep_jobs(plan(keys))), names(jobs));
  write_file_atomically(folder_.path() / "scene.json",
                        edited.replace(edited.find("261"), 3, "262"));
  const auto others = names(sweep_jobs(plan(keys)));
  for (std::size_t i = 0; i < jobs.size(); ++i) EXPECT_NE(others[i], jobs[i].name);
}

TEST_F(Sweep, NamesTellKeysOfOneLastWordApart) {
  const auto jobs =
      sweep_jobs(plan(R"("vary": {"cloths.0.mesh.columns": [5], "cloths.0.mesh.rows": [6]},
              "cases": [{"step.steps": 4}, {"solver.threads": 2}, {"solver.threads": 3}, {}])"));
  EXPECT_EQ(jobs[0].name.substr(0, 17), "columns-5_rows-6_");
  EXPECT_EQ(jobs[4].name.substr(0, 5), "case_");
  const auto all = names(jobs);
  EXPECT_EQ(std::set<std::string>(all.begin(), all.end()).size(), jobs.size());
  const auto same_word =
      sweep_jobs(plan(R"("vary": {"solver.domains": [1], "wind.velocity": [[1, 0, 0]],
                       "cloths.0.velocity": [[0, 1, 0]]})"));
  EXPECT_NE(same_word[0].name.find("_wind.velocity-1-0-0_cloths.0.velocity-0-1-0"),
            std::string::npos)
      << same_word[0].name;
}

TEST_F(Sweep, BadCasesAreOneErrorWithTheirPlace) {
  const auto message = [&](const std::string& more) -> std::string {
    try {
      (void)sweep_jobs(plan(more));
    } catch (const InputError& error) {
      return error.what();
    }
    return "no error";
  };
  EXPECT_NE(message(R"("vary": {"solver.domains": [1, "two"]})")
                .find("/vary/solver.domains/1: /solver/domains: expected a whole number, found the "
                      "text \"two\""),
            std::string::npos);
  EXPECT_NE(message(R"("vary": {"solver.domains": [1]}, "steps": -1)")
                .find("/steps: /step/steps: -1 is out of range"),
            std::string::npos);
  EXPECT_NE(message(R"("vary": {"solver.domains": [1, 2, 1]})").find("is there twice; remove one"),
            std::string::npos);
  EXPECT_NE(message(R"("vary": {"solver.domains": [1]}, "reference": {"quality.stopp": 1})")
                .find("/reference/quality.stopp: /quality/stopp: unknown key \"stopp\"; did you "
                      "mean \"stop\"?"),
            std::string::npos);
}

TEST(SweepShard, ShardsCoverEachJobExactlyOnce) {
  for (const int count : {1, 2, 3, 7, 20}) {
    for (std::size_t job = 0; job < 13; ++job) {
      int owners = 0;
      for (int index = 1; index <= count; ++index) owners += Shard{index, count}.has(job);
      EXPECT_EQ(owners, 1) << job << " of " << count;
    }
  }
  EXPECT_TRUE((Shard{2, 3}.has(4)));
}

TEST_F(Sweep, ShardsTogetherRunEverythingOnceAndTheLastWritesTheTable) {
  const auto p = plan(R"("vary": {"solver.domains": [1, 2, 3, 4, 5]})");
  std::map<std::string, int> runs;
  const CaseRunner runner = [&](const SweepJob& job, const fs::path& directory) {
    ++runs[job.name];
    return succeed(job, directory);
  };
  for (const int index : {1, 2, 3}) {
    EXPECT_FALSE(fs::exists(out() / "sweep.md"));
    const SweepOutcome outcome = run(p, runner, {.shard = {index, 3}});
    EXPECT_EQ(outcome.missing == 0, index == 3);
  }
  EXPECT_EQ(runs.size(), 5U);
  for (const auto& [name, count] : runs) EXPECT_EQ(count, 1) << name;
  for (const char* name : {"sweep.md", "sweep.csv", "sweep.json"})
    EXPECT_TRUE(fs::exists(out() / name)) << name;
}

// Each shard alone, as on machines that do not see each other: nothing is skipped as finished.
TEST_F(Sweep, ShardsDoNotOverlap) {
  const auto p = plan(R"("vary": {"solver.domains": [1, 2, 3, 4, 5]})");
  std::vector<std::string> ran;
  for (const int index : {1, 2, 3})
    (void)run_sweep(
        p, sweep_jobs(p),
        {.directory = folder_.path() / fmt::format("shard{}", index), .shard = {index, 3}},
        [&](const SweepJob& job, const fs::path& directory) {
          ran.push_back(job.name);
          return succeed(job, directory);
        },
        counter_);
  std::vector<std::string> all = names(sweep_jobs(p));
  std::sort(all.begin(), all.end());
  std::sort(ran.begin(), ran.end());
  EXPECT_EQ(ran, all);
}

TEST_F(Sweep, StoppedSweepContinuesWhereItWas) {
  const auto p = plan(R"("vary": {"solver.domains": [1, 2, 3]})");
  const SweepOutcome first = run(p, [](const SweepJob& job, const fs::path& directory) {
    const bool second = job.name.starts_with("domains-2");
    return second ? CaseRecord{130, "", true} : succeed(job, directory);
  });
  EXPECT_TRUE(first.stopped);
  EXPECT_EQ(first.missing, 2U);
  EXPECT_EQ(counter_.starts, 2);
  counter_ = {};
  EXPECT_EQ(run(p, succeed).missing, 0U);
  EXPECT_EQ(counter_.skipped, 1);
  EXPECT_EQ(counter_.starts, 2);
  counter_ = {};
  (void)run(p, succeed);
  EXPECT_EQ(counter_.skipped, 3);
  EXPECT_EQ(counter_.starts, 0);
  // A torn or foreign record is no record, nor is one whose run is gone.
  const auto jobs = sweep_jobs(p);
  write_file_atomically(out() / jobs[0].name / "case.json", "{\"schema\": \"piecew");
  fs::remove(out() / jobs[1].name / "run.json");
  counter_ = {};
  (void)run(p, succeed);
  EXPECT_EQ(counter_.starts, 2);
}

TEST_F(Sweep, FailingCaseIsRecordedAndTheOthersRun) {
  const auto p =
      plan(R"("vary": {"solver.domains": [1, 2, 3]}, "reference": {"solver.domains": 2})");
  const CaseRunner breaks = [](const SweepJob& job, const fs::path& directory) {
    if (job.name.starts_with("domains-2")) return CaseRecord{1, "diverged | at step 3", false};
    return succeed(job, directory);
  };
  const SweepOutcome outcome = run(p, breaks);
  EXPECT_EQ(outcome.failed, 1);
  EXPECT_EQ(outcome.missing, 0U);
  const std::string text = read_file(out() / "sweep.md");
  EXPECT_NE(text.find("| FAIL |"), std::string::npos) << text;
  EXPECT_NE(text.find("diverged | at step 3"), std::string::npos) << text;
  const auto json = nlohmann::json::parse(read_file(out() / "sweep.json"));
  EXPECT_EQ(json.at("cases").at(2).at("exit_code"), 1);
  EXPECT_FALSE(json.at("cases").at(2).contains("ms_per_step"));
  // It is not run again, but still counts; unless asked.
  counter_ = {};
  EXPECT_EQ(run(p, succeed).failed, 1);
  EXPECT_EQ(counter_.starts, 0);
  EXPECT_EQ(run(p, succeed, {.retry = true}).failed, 0);
  EXPECT_EQ(counter_.starts, 1);
}

TEST_F(Sweep, FailingReferenceLeavesErrorsOut) {
  const auto p = plan(R"("vary": {"solver.domains": [1]}, "reference": {"solver.domains": 2})");
  (void)run(p, [](const SweepJob& job, const fs::path& directory) {
    return job.reference ? CaseRecord{137, "killed", false} : succeed(job, directory);
  });
  const auto json = nlohmann::json::parse(read_file(out() / "sweep.json"));
  EXPECT_TRUE(json.at("cases").at(1).at("position_error").is_null());
  EXPECT_NE(json.at("cases").at(1).at("note").get<std::string>().find("no run.json"),
            std::string::npos);
}

TEST_F(Sweep, CaseThatAnotherProcessRunsIsLeftToIt) {
  const auto p = plan(R"("vary": {"solver.domains": [1, 2]})");
  const fs::path first = out() / sweep_jobs(p)[0].name;
  ensure_directory(first);
  const Descriptor lock(::open(first.c_str(), O_RDONLY | O_DIRECTORY));
  ASSERT_EQ(::flock(lock.get(), LOCK_EX | LOCK_NB), 0);
  const SweepOutcome outcome = run(p, succeed);
  EXPECT_EQ(outcome.busy, 1);
  EXPECT_EQ(outcome.missing, 1U);
  EXPECT_EQ(counter_.starts, 1);
}

/// Six frames of one step, at 1 ... 6 ms.
void give_times(const fs::path& directory) {
  auto json = nlohmann::ordered_json::parse(read_file(directory / "run.json"));
  for (std::size_t i = 0; i < 6; ++i) json["frames"][i]["step_ms"] = 1.0 + static_cast<double>(i);
  write_file_atomically(directory / "run.json", json.dump());
}

TEST_F(Sweep, TableHasTheValuesOfTheRuns) {
  const auto p = plan(R"("name": "t", "vary": {"solver.global": ["tree", "single"]},
                         "cases": [{"solver.domains": 7}], "reference": {"step.h": 0.005})");
  (void)run(p, [](const SweepJob& job, const fs::path& directory) {
    make_run(directory, {.frames = 6,
                         .offset = job.name.starts_with("global-tree") ? 0.3 : 0,
                         .gradient = 2e-4,
                         .error = 0.04});
    give_times(directory);
    return CaseRecord{};
  });
  const auto json = nlohmann::json::parse(read_file(out() / "sweep.json"));
  EXPECT_EQ(json.at("schema"), "piecework.sweep/1");
  EXPECT_EQ(json.at("interleaved"), false);
  ASSERT_EQ(json.at("cases").size(), 4U);
  const auto& reference = json.at("cases").at(0);
  EXPECT_EQ(reference.at("reference"), true);
  EXPECT_TRUE(reference.at("position_error").is_null());
  const auto& tree = json.at("cases").at(1);
  EXPECT_EQ(tree.at("settings").at("solver.global"), "tree");
  EXPECT_EQ(tree.at("ms_per_step").at("median"), 3.5);
  EXPECT_EQ(tree.at("ms_per_step").at("low"), 1);
  EXPECT_EQ(tree.at("ms_per_step").at("high"), 6);
  EXPECT_EQ(tree.at("iterations_per_step"), 5);
  EXPECT_EQ(tree.at("worst_gradient"), 2e-4);
  EXPECT_EQ(tree.at("worst_error_mean_edges"), 0.04);
  EXPECT_EQ(tree.at("steps"), 6);
  EXPECT_EQ(tree.at("converged_steps"), 5);
  EXPECT_NEAR(tree.at("position_error").at("max_m").get<double>(), 0.3, 1e-15);
  EXPECT_NEAR(tree.at("position_error").at("rms_m").get<double>(), 0.15, 1e-15);
  EXPECT_NEAR(tree.at("position_error").at("relative").get<double>(), 0.5, 1e-14);
  EXPECT_EQ(json.at("cases").at(2).at("position_error").at("max_m"), 0);

  const std::string text = read_file(out() / "sweep.md");
  const std::string row = fmt::format(
      "| {} | tree | - | 3.50 [1.00-6.00] | 5.00 | 2.00e-04 | 0.0400 | 0.300 | 0.150 | 0.500 | 5/6 "
      "| 0 |\n",
      tree.at("name").get<std::string>());
  EXPECT_NE(text.find(row), std::string::npos) << text;
  EXPECT_NE(text.find("not interleaved"), std::string::npos);
  EXPECT_NE(text.find("1 of 6 steps of the reference did not reach"), std::string::npos);
  EXPECT_EQ(text.find("different machines"), std::string::npos);
  EXPECT_LT(text.find("| reference_"), text.find("| global-tree")) << "the baseline comes first";
}

TEST_F(Sweep, CsvHasOneFieldPerColumn) {
  const auto p = plan(R"("vary": {"name": ["a, \"b\"", "c"]}, "reference": {"solver.domains": 2})");
  (void)run(p, [](const SweepJob& job, const fs::path& directory) {
    if (job.name.starts_with("name-c")) return CaseRecord{3, "bad", false};
    return succeed(job, directory);
  });
  const std::string csv = read_file(out() / "sweep.csv");
  EXPECT_NE(csv.find("\"a, \"\"b\"\"\""), std::string::npos) << csv;
  std::vector<int> fields;
  bool quoted = false;
  int commas = 0;
  for (const char c : csv) {
    if (c == '"') quoted = !quoted;
    if (c == ',' && !quoted) ++commas;
    if (c == '\n') fields.push_back(commas + 1), commas = 0;
  }
  EXPECT_EQ(fields, std::vector<int>(4, 3 + 13)) << csv;
}

TEST_F(Sweep, MarksDisturbedTimesAndShortensNumbers) {
  const auto p = plan(R"("vary": {"step.h": [0.008333333333333333], "solver.domains": [1, 2]})");
  (void)run(p, [](const SweepJob& job, const fs::path& directory) {
    make_run(directory, {});
    auto json = nlohmann::ordered_json::parse(read_file(directory / "run.json"));
    json["environment"]["disturbed"] = job.name.find("domains-2") != std::string::npos;
    write_file_atomically(directory / "run.json", json.dump());
    return CaseRecord{};
  });
  const std::string text = read_file(out() / "sweep.md");
  EXPECT_NE(text.find("| 0.00833333 | 1 | 2.00 | "), std::string::npos) << text;
  EXPECT_NE(text.find("| 0.00833333 | 2 | 2.00 † | "), std::string::npos) << text;
  EXPECT_NE(text.find("† Disturbed"), std::string::npos) << text;
  EXPECT_EQ(text.find("different machines"), std::string::npos) << "the mark is no machine";
  EXPECT_NE(text.find("| h-0.00833333_domains-1_"), std::string::npos) << text;
  const auto json = nlohmann::json::parse(read_file(out() / "sweep.json"));
  EXPECT_EQ(json.at("cases").at(0).at("settings").at("step.h"), 0.008333333333333333);
  EXPECT_EQ(json.at("cases").at(1).at("disturbed"), true);
}

TEST_F(Sweep, SaysWhenMachinesDiffer) {
  const auto p = plan(R"("vary": {"solver.domains": [1, 2]})");
  (void)run(p, [](const SweepJob& job, const fs::path& directory) {
    make_run(directory, {});
    auto json = nlohmann::ordered_json::parse(read_file(directory / "run.json"));
    json["environment"]["cpu"] = job.name;
    write_file_atomically(directory / "run.json", json.dump());
    return CaseRecord{};
  });
  EXPECT_NE(read_file(out() / "sweep.md").find("2 different machines"), std::string::npos);
}

TEST_F(Sweep, ScriptsNameEveryCaseOnce) {
  const auto jobs = sweep_jobs(plan(R"("vary": {"solver.domains": [1, 2, 3]})"));
  const ScriptOptions options{"plan.json", "out/s"};
  const std::string make = makefile(jobs, options);
  const std::string snake = snakefile(jobs, options);
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    EXPECT_NE(
        make.find(fmt::format("\nout/s/{}/case.json:\n\t$(PIECEWORK) sweep plan.json -o out/s "
                              "--shard {}/3 || test -f $@\n",
                              jobs[i].name, i + 1)),
        std::string::npos)
        << make;
    EXPECT_NE(snake.find(fmt::format("    \"{}\",\n", jobs[i].name)), std::string::npos) << snake;
  }
  const std::string slurm = slurm_script(jobs, {"my plan.json", "out/it's"});
  EXPECT_NE(slurm.find("#SBATCH --array=1-3\n"), std::string::npos);
  EXPECT_NE(slurm.find("sweep 'my plan.json' -o 'out/it'\\''s' --shard"), std::string::npos)
      << slurm;
  EXPECT_THROW((void)makefile(jobs, {"my plan.json", "out"}), InputError);
}

}  // namespace
}  // namespace piecework::runner
