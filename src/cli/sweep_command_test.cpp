// piecework sweep and compare.

#include <csignal>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "cli_test_util.hpp"

namespace piecework::cli {
namespace {

TEST_F(Cli, CompareMeasuresErrorAndHoldsLimits) {
  const std::string path = scene();
  ASSERT_EQ(call("run " + path + " --no-images -o " + dir("a")).code, 0);
  ASSERT_EQ(call("run " + path + " --no-images --threads 1 -o " + dir("same")).code, 0);
  ASSERT_EQ(
      call("run " + path + " --no-images --set quality.max_iterations=1 -o " + dir("less")).code,
      0);
  const Result same = call("compare " + dir("same") + " " + dir("a") + " --json --max 0");
  ASSERT_EQ(same.code, 0) << same.err;
  EXPECT_EQ(nlohmann::json::parse(same.out).at("max"), 0);
  EXPECT_GT(nlohmann::json::parse(same.out).at("time_ratio"), 0);
  const Result less = call("compare " + dir("less") + " " + dir("a") + " --max 1e-9 --rms 1");
  EXPECT_EQ(less.code, 5);
  EXPECT_NE(less.out.find("| **all** |"), std::string::npos) << less.out;
  EXPECT_NE(less.err.find("max "), std::string::npos) << less.err;
  EXPECT_EQ(less.err.find("rms "), std::string::npos) << less.err;
}

TEST_F(Cli, CompareFaultsHaveTheirExitCodes) {
  ASSERT_EQ(call("run " + scene() + " --no-images -o " + dir("a")).code, 0);
  ASSERT_EQ(call("run " + scene(13) + " --no-images -o " + dir("larger")).code, 0);
  ASSERT_EQ(call("run " + scene() + " --no-images --no-state -o " + dir("bare")).code, 0);
  for (const char* other : {"nowhere", "larger", "bare"}) {
    const Result result = call("compare " + dir("a") + " " + dir(other));
    EXPECT_EQ(result.code, 3) << other;
    EXPECT_NE(result.err.find(dir(other)), std::string::npos) << result.err;
    EXPECT_TRUE(result.out.empty());
  }
  EXPECT_EQ(call("compare " + dir("a")).code, 2);
  EXPECT_EQ(call("compare " + dir("a") + " " + dir("a") + " --max -1").code, 2);
}

/// A plan over scene(): two tolerable numbers of iterations, and one more setting.
class CliSweep : public Cli {
 protected:
  [[nodiscard]] std::string plan(const std::string& scene_path, const std::string& more) const {
    write_file_atomically(folder_ / "plan.json",
                          fmt::format(R"({{"scene": "{}", {}}})", scene_path, more));
    return dir("plan.json");
  }
  [[nodiscard]] nlohmann::json table(const std::string& name) const {
    return nlohmann::json::parse(read_file(dir(name) + "/sweep.json"));
  }
};

TEST_F(CliSweep, RunsEveryCaseOnceAndMeasuresErrors) {
  const std::string path = plan(scene(), R"("steps": 4, "vary": {"quality.max_iterations": [1, 20]},
      "reference": {"quality.max_iterations": 20, "solver.global": "single"})");
  const Result first = call("sweep " + path + " -o " + dir("s"));
  ASSERT_EQ(first.code, 0) << first.err;
  EXPECT_EQ(first.out, dir("s") + "/sweep.md\n");
  const auto cases = table("s").at("cases");
  ASSERT_EQ(cases.size(), 3U);
  EXPECT_EQ(cases[0].at("steps"), 4);
  EXPECT_EQ(cases[1].at("iterations_per_step"), 1);
  EXPECT_GT(cases[1].at("position_error").at("max_m"), 1e-6);
  EXPECT_LT(cases[2].at("position_error").at("max_m"), 1e-9) << "another exact solver";
  // `compare` says the same.
  const auto at = [&](int i) { return dir("s") + "/" + cases[i].at("name").get<std::string>(); };
  const Result compared = call("compare --json " + at(1) + " " + at(0));
  EXPECT_EQ(nlohmann::json::parse(compared.out).at("max"),
            cases[1].at("position_error").at("max_m"));
  const std::string before = read_file(at(1) + "/run.json");
  const Result second = call("sweep " + path + " -o " + dir("s"));
  EXPECT_EQ(second.code, 0);
  EXPECT_NE(second.err.find("finished before"), std::string::npos) << second.err;
  EXPECT_EQ(read_file(at(1) + "/run.json"), before);
}

TEST_F(CliSweep, FailingCaseIsRecordedWithItsMessage) {
  const std::string path =
      plan(scene(), R"("vary": {"cloths.0.mesh": [{"generator": "sheet", "columns": 5, "rows": 5},
                                                  {"file": "nowhere.obj"}]})");
  const Result result = call("sweep " + path + " -o " + dir("s"));
  EXPECT_EQ(result.code, 1);
  EXPECT_NE(result.err.find("nowhere.obj"), std::string::npos) << result.err;
  const auto cases = table("s").at("cases");
  EXPECT_EQ(cases.at(0).at("exit_code"), 0);
  EXPECT_EQ(cases.at(1).at("exit_code"), 3);
  EXPECT_NE(cases.at(1).at("message").get<std::string>().find("nowhere.obj"), std::string::npos);
  EXPECT_EQ(call("sweep " + path + " -o " + dir("s")).code, 1) << "it failed before";
}

TEST_F(CliSweep, KilledAndInterruptedSweepsContinue) {
  const std::string path =
      plan(scene(60, 40), R"("vary": {"quality.max_iterations": [3, 4, 5]}, "steps": 40)");
  const std::string list = call("sweep " + path + " -o " + dir("s") + " --list").out;
  std::vector<std::string> names;
  std::istringstream lines(list);
  for (std::string number, name, state; lines >> number >> name >> state;) names.push_back(name);
  ASSERT_EQ(names.size(), 3U) << list;
  int codes = 0;
  for (const auto& [name, signal] : {std::pair(names[0], SIGKILL), std::pair(names[1], SIGINT)}) {
    const pid_t child = start({"sweep", path, "-o", dir("s")});
    EXPECT_TRUE(wait_for(fs::path(dir("s")) / name / "state/frame_0003.bin")) << name;
    kill(child, signal);
    int status = 0;
    waitpid(child, &status, 0);
    codes += WIFEXITED(status) ? WEXITSTATUS(status) : 1000;
    // The case itself stops at its next frame, and lets go of its directory.
    const std::string locked = fmt::format("flock -w 60 {}/s/{} true", folder_.string(), name);
    EXPECT_EQ(std::system(locked.c_str()), 0);
  }
  EXPECT_EQ(codes, 1000 + 130) << "killed, then stopped";
  EXPECT_FALSE(fs::exists(dir("s") + "/sweep.md"));
  EXPECT_TRUE(fs::exists(dir("s") + "/" + names[0] + "/case.json"));
  EXPECT_FALSE(fs::exists(dir("s") + "/" + names[1] + "/case.json"));
  const Result rest = call("sweep " + path + " -o " + dir("s"));
  ASSERT_EQ(rest.code, 0) << rest.err;
  const auto json = table("s");
  for (const auto& row : json.at("cases")) EXPECT_EQ(row.at("steps"), 40);
}

TEST_F(CliSweep, EmittedMakefileRunsTheShards) {
  if (std::system("make --version >/dev/null 2>&1") != 0) GTEST_SKIP() << "no make here";
  const std::string path = plan(scene(), R"("vary": {"quality.max_iterations": [1, 2]},
      "cases": [{"cloths.0.mesh": {"file": "nowhere.obj"}}])");
  const Result emitted = call("sweep " + path + " -o " + dir("s") + " --emit make");
  ASSERT_EQ(emitted.code, 0) << emitted.err;
  write_file_atomically(dir("sweep.mk"), emitted.out);
  const std::string make = fmt::format("make -k -f {} PIECEWORK={} >{} 2>&1", dir("sweep.mk"),
                                       PIECEWORK_PROGRAM, dir("make.log"));
  EXPECT_NE(std::system(make.c_str()), 0) << "a case fails";
  EXPECT_EQ(table("s").at("cases").size(), 3U) << read_file(dir("make.log"));
  EXPECT_EQ(table("s").at("cases").at(2).at("exit_code"), 3);
  for (const char* kind : {"slurm", "snakemake"})
    EXPECT_EQ(call("sweep " + path + " --emit " + kind).code, 0) << kind;
}

TEST_F(CliSweep, FaultsHaveTheirExitCodes) {
  const std::string path = plan(scene(), R"("vary": {"solver.domians": [1]})");
  const Result bad = call("sweep " + path + " -o " + dir("s"));
  EXPECT_EQ(bad.code, 3);
  EXPECT_NE(bad.err.find("did you mean \"domains\"?"), std::string::npos) << bad.err;
  EXPECT_FALSE(fs::exists(dir("s"))) << "nothing runs";
  EXPECT_EQ(call("sweep /nowhere.json").code, 3);
  EXPECT_EQ(call("sweep").code, 2);
  EXPECT_EQ(call("sweep " + path + " --emit cron").code, 2);
  EXPECT_EQ(call("sweep " + path + " --emit make --shard 1/2").code, 2);
  for (const char* shard : {"0/2", "3/2", "1", "1/2x"})
    EXPECT_EQ(call("sweep " + path + " --shard " + shard).code, 2) << shard;
}

}  // namespace
}  // namespace piecework::cli
