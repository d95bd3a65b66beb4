// The program as a user or a script meets it: files, streams, exit codes, signals.

#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <piecework/core/atomic_file.hpp>

namespace piecework::cli {
namespace {

namespace fs = std::filesystem;

struct Result {
  int code = -1;  ///< exit code, or 128 + signal
  std::string out;
  std::string err;
};

class Cli : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / fmt::format("piecework_cli_{}", ::getpid());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  /// Runs `piecework <arguments>`; arguments are shell words.
  [[nodiscard]] Result call(const std::string& arguments) const {
    const fs::path out = folder_ / "stdout";
    const fs::path err = folder_ / "stderr";
    const int status = std::system(fmt::format("'{}' {} >'{}' 2>'{}' </dev/null", PIECEWORK_PROGRAM,
                                               arguments, out.string(), err.string())
                                       .c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), read_file(out),
            read_file(err)};
  }

  /// A sheet of `side` x `side` vertices that hangs, as a scene file.
  [[nodiscard]] std::string scene(int side = 12, int steps = 6) const {
    const fs::path path = folder_ / fmt::format("sheet{}_{}.json", side, steps);
    write_file_atomically(path, fmt::format(R"({{"name": "sheet", "step": {{"steps": {}}},
      "solver": {{"domains": 4}}, "quality": {{"stop": "iterations", "max_iterations": 5}},
      "materials": {{"m": {{"stretching": 261, "bending": 1e-5}}}},
      "cloths": [{{"material": "m", "mesh": {{"generator": "sheet", "columns": {}, "rows": {}}},
                 "pins": [{{"region": {{"vertices": [0]}}}}]}}],
      "expect": [{{"quantity": "lowest_y", "max": -0.001}}]}})",
                                            steps, side, side));
    return path.string();
  }

  [[nodiscard]] std::string dir(const std::string& name) const { return (folder_ / name).string(); }

  fs::path folder_;
};

/// Vertices of a binary PLY of doubles, parsed without Piecework's readers.
std::vector<double> ply_positions(const fs::path& path) {
  const std::string content = read_file(path);
  const std::string end = "end_header\n";
  const auto body = content.find(end) + end.size();
  std::istringstream header(content.substr(0, body));
  std::size_t vertices = 0;
  for (std::string word; header >> word;)
    if (word == "vertex") header >> vertices;
  EXPECT_NE(content.find("format binary_little_endian"), std::string::npos);
  EXPECT_NE(content.find("property double x"), std::string::npos);
  std::vector<double> positions(3 * vertices);
  std::memcpy(positions.data(), content.data() + body, positions.size() * sizeof(double));
  return positions;
}

TEST_F(Cli, HelpStartsWithExamplesAndVersionIsPrinted) {
  const Result help = call("--help");
  EXPECT_EQ(help.code, 0);
  EXPECT_LT(help.out.find("Examples:"), help.out.find("Options:"));
  for (const char* command : {"run", "render", "partition", "tune", "compare", "sweep", "ccd",
                              "check", "env", "schema", "doctor", "scenes"}) {
    EXPECT_NE(help.out.find(command), std::string::npos) << command;
    EXPECT_EQ(call(std::string(command) + " --help").code, 0) << command;
  }
  EXPECT_EQ(call("--version").out.substr(0, 9), "piecework");
}

TEST_F(Cli, WrongUsageIsExitCode2) {
  for (const char* arguments :
       {"", "nonsense", "run", "run x --no-such-flag", "run x --threads zero",
        "run x --set novalue", "render x --color purple", "partition x -k 0",
        "partition hanging_tablecloth -o x.png --size huge"}) {
    const Result result = call(arguments);
    EXPECT_EQ(result.code, 2) << arguments << "\n" << result.err;
    EXPECT_FALSE(result.err.empty());
    EXPECT_TRUE(result.out.empty());
  }
}

TEST_F(Cli, WrongInputIsExitCode3AndNamesFileItemAndRemedy) {
  write_file_atomically(folder_ / "typo.json", R"({"name": "x", "stpe": {}})");
  const Result typo = call("run " + dir("typo.json") + " -o " + dir("o"));
  EXPECT_EQ(typo.code, 3);
  EXPECT_NE(typo.err.find("typo.json:1:"), std::string::npos) << typo.err;
  EXPECT_NE(typo.err.find("\"step\""), std::string::npos) << typo.err;
  EXPECT_FALSE(fs::exists(dir("o"))) << "nothing is created for a scene that cannot be read";

  EXPECT_EQ(call("run hanging_tablecloht").code, 3);
  EXPECT_NE(call("run hanging_tablecloht").err.find("hanging_tablecloth"), std::string::npos);
  EXPECT_EQ(call("check /nowhere.json").code, 3);
  EXPECT_EQ(call("render " + folder_.string()).code, 3);
  write_file_atomically(folder_ / "nan.obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n");
  const Result nan = call("partition " + dir("nan.obj") + " -k 2");
  EXPECT_EQ(nan.code, 3);
  EXPECT_NE(nan.err.find("nan.obj"), std::string::npos) << nan.err;
  EXPECT_EQ(call("partition " + dir("missing.obj") + " -k 2").code, 3);
}

TEST_F(Cli, OutputThatIsLostIsExitCode4) {
  for (const char* command : {"env", "schema", "scenes"}) {
    const int status = std::system(
        fmt::format("'{}' {} >/dev/full 2>/dev/null", PIECEWORK_PROGRAM, command).c_str());
    EXPECT_EQ(WEXITSTATUS(status), 4) << command;
  }
  // Messages that nobody can read do not end a simulation.
  const int status = std::system(fmt::format("'{}' run {} --no-images -o {} >/dev/null 2>/dev/full",
                                             PIECEWORK_PROGRAM, scene(), dir("log"))
                                     .c_str());
  EXPECT_EQ(WEXITSTATUS(status), 0);
  EXPECT_TRUE(fs::exists(dir("log/checkpoint.bin")));
}

TEST_F(Cli, UnwritableOutputIsExitCode4) {
  write_file_atomically(folder_ / "file", "in the way");
  const Result result = call("run " + scene() + " --no-images -o " + dir("file/sub"));
  EXPECT_EQ(result.code, 4) << result.err;
  EXPECT_NE(result.err.find("file/sub"), std::string::npos);
}

TEST_F(Cli, FailedExpectationIsExitCode5OnRequest) {
  const std::string command =
      "run " + scene() + " --no-images --set expect.0.max=-5 -o " + dir("e");
  EXPECT_EQ(call(command).code, 0) << "not asked for";
  const Result result = call(command + " --overwrite --expect");
  EXPECT_EQ(result.code, 5);
  EXPECT_NE(result.err.find("lowest_y"), std::string::npos);
  EXPECT_EQ(call("run " + scene() + " --no-images --expect -o " + dir("good")).code, 0);
}

TEST_F(Cli, ExpectationThatIsNotReachedIsExitCode5) {
  const Result result = call("run " + scene() + " --no-images --expect --set expect.0.at=0.05 " +
                             "--frames 2 -o " + dir("short"));
  EXPECT_EQ(result.code, 5);
  EXPECT_NE(result.err.find("not reached"), std::string::npos) << result.err;
}

TEST_F(Cli, NoImagesNeedsNoOpenGl) {
  EXPECT_EQ(call("run " + scene() + " --no-images -o " + dir("g")).code, 0);
  EXPECT_FALSE(fs::exists(dir("g/frame_0000.png")));
  // Where no provider works, a run with pictures says so before it simulates anything.
  if (call("doctor").code == 6) {
    EXPECT_EQ(call("run " + scene() + " -o " + dir("h")).code, 6);
    EXPECT_FALSE(fs::exists(dir("h")));
  }
}

TEST_F(Cli, RunLeavesFramesInTheOrderOfTheScene) {
  const Result result = call("run " + scene(12, 3) +
                             " --no-images --export ply --frames 2 --threads 2 -o " + dir("r"));
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_NE(result.out.find("summary.md"), std::string::npos);
  const std::vector<double> start = ply_positions(dir("r/frame_0000.ply"));
  ASSERT_EQ(start.size(), 3U * 144);
  EXPECT_EQ(start[3 * 11], 1.0) << "vertex 11 is the corner (1, 0, 0)";
  EXPECT_EQ(start[3 * 143 + 2], 1.0);
  const std::vector<double> end = ply_positions(dir("r/frame_0002.ply"));
  EXPECT_EQ(end[1], 0.0) << "vertex 0 is pinned";
  EXPECT_LT(end[3 * 143 + 1], -1e-4);
  EXPECT_FALSE(fs::exists(dir("r/frame_0003.ply")));
  const auto json = nlohmann::json::parse(read_file(dir("r/run.json")));
  EXPECT_EQ(json.at("frames").size(), 2U);
}

TEST_F(Cli, ThreadsDoNotChangeABit) {
  const std::string path = scene(40, 4);
  for (const int threads : {1, 2, 4, 8})
    ASSERT_EQ(call(fmt::format("run {} --no-images --export ply --threads {} -o {}", path, threads,
                               dir(fmt::format("t{}", threads))))
                  .code,
              0);
  const std::string expected = read_file(dir("t1/frame_0004.ply"));
  for (const int threads : {2, 4, 8})
    EXPECT_TRUE(read_file(dir(fmt::format("t{}/frame_0004.ply", threads))) == expected) << threads;
}

/// Starts `piecework run` in the background, without a shell between.
pid_t start(const std::vector<std::string>& arguments) {
  std::vector<char*> argv{const_cast<char*>(PIECEWORK_PROGRAM)};  // NOLINT: execv's interface
  for (const std::string& argument : arguments)
    argv.push_back(const_cast<char*>(argument.c_str()));  // NOLINT
  argv.push_back(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    std::freopen("/dev/null", "w", stderr);
    std::freopen("/dev/null", "w", stdout);
    execv(PIECEWORK_PROGRAM, argv.data());
    _exit(127);
  }
  return child;
}

bool wait_for(const fs::path& path) {
  for (int i = 0; i < 3000 && !fs::exists(path); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  return fs::exists(path);
}

TEST_F(Cli, KilledRunResumesWithTheSameBits) {
  const std::string path = scene(60, 40);
  ASSERT_EQ(call("run " + path + " --no-images --export ply -o " + dir("whole")).code, 0);
  int kills = 0;
  for (const int until : {3, 11, 23}) {
    const pid_t child = start({"run", path, "--no-images", "--export", "ply", "--checkpoint-every",
                               "2", "--resume", "-o", dir("killed")});
    ASSERT_TRUE(wait_for(fs::path(dir("killed")) / fmt::format("frame_{:04}.ply", until)));
    kill(child, SIGKILL);
    int status = 0;
    waitpid(child, &status, 0);
    kills += WIFSIGNALED(status);
  }
  EXPECT_GT(kills, 0) << "every run was over before it could be killed";
  ASSERT_EQ(call("run " + path + " --no-images --export ply --resume -o " + dir("killed")).code, 0);
  for (int frame = 0; frame <= 40; ++frame) {
    const std::string name = fmt::format("frame_{:04}.ply", frame);
    ASSERT_TRUE(read_file(fs::path(dir("whole")) / name) ==
                read_file(fs::path(dir("killed")) / name))
        << name;
  }
  EXPECT_EQ(nlohmann::json::parse(read_file(dir("killed/run.json"))).at("frames").size(), 40U);
}

TEST_F(Cli, InterruptStopsWithACheckpointAndExitCode130) {
  const std::string path = scene(60, 400);
  const pid_t child = start({"run", path, "--no-images", "-o", dir("i")});
  ASSERT_TRUE(wait_for(dir("i/state/frame_0002.bin")));
  kill(child, SIGINT);
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 130);
  EXPECT_TRUE(fs::exists(dir("i/checkpoint.bin")));
  const auto json = nlohmann::json::parse(read_file(dir("i/run.json")));
  EXPECT_GE(json.at("frames").size(), 2U);
  EXPECT_LT(json.at("frames").size(), 400U);
}

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

TEST_F(Cli, PartitionPrintsCountsAsJson) {
  const Result result = call("partition hanging_tablecloth -k 16 --json");
  ASSERT_EQ(result.code, 0) << result.err;
  const auto json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json.at("domains"), 16);
  EXPECT_EQ(json.at("corner").get<int>() + json.at("remainder").get<int>(), 10000);
  EXPECT_GT(json.at("boundary").get<int>(), json.at("corner").get<int>());
  EXPECT_GT(json.at("edge_cut").get<int>(), 0);
  EXPECT_LT(json.at("balance").get<double>(), 1.2);
  EXPECT_EQ(json.size(), 6U);
}

TEST_F(Cli, CheckSaysWhatIsOnAndRunsNothing) {
  const Result result = call("check " + scene());
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_NE(result.out.find("sound"), std::string::npos);
  EXPECT_NE(result.out.find("wind           -"), std::string::npos) << result.out;
  EXPECT_NE(result.out.find("border (44)"), std::string::npos) << result.out;
}

TEST_F(Cli, TuneProposesForASimulatedHybridProcessor) {
  write_file_atomically(folder_ / "hybrid.json", R"({"kinds": [
      {"name": "performance", "cores": 8, "speed": 1.0},
      {"name": "efficient", "cores": 8, "speed": 0.55}]})");
  const std::string path = scene(160, 2);  // 25600 vertices
  const std::string command = "tune " + path + " --topology " + dir("hybrid.json") + " -o ";
  const Result result = call(command + dir("tuned.json"));
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_NE(result.out.find("chosen: 16 domains, 8 x 1, 8 x 0.55 sizes"), std::string::npos)
      << result.out;
  EXPECT_EQ(call(command + dir("again.json")).out.find("ms,"), std::string::npos);
  EXPECT_EQ(read_file(dir("tuned.json")), read_file(dir("again.json"))) << "nothing is measured";
  const auto json = nlohmann::json::parse(read_file(dir("tuned.json")));
  const auto weights = json.at("solver").at("domain_weights").get<std::vector<double>>();
  ASSERT_EQ(weights.size(), 16U);
  EXPECT_EQ(json.at("solver").at("domains"), 16);
  for (std::size_t k = 0; k < 8; ++k) EXPECT_DOUBLE_EQ(weights[8 + k] / weights[k], 0.55);
  const Result check = call("check " + dir("tuned.json"));
  EXPECT_EQ(check.code, 0) << check.err;
  EXPECT_NE(check.out.find("domains       16"), std::string::npos) << check.out;
}

TEST_F(Cli, TuneMeasuresThisMachineAndKeepsTheScene) {
  const std::string path = scene(50, 2);
  const std::string before = read_file(path);
  const Result said = call("tune " + path + " --threads 2");
  ASSERT_EQ(said.code, 0) << said.err;
  EXPECT_NE(said.out.find("now: 4 | equal |"), std::string::npos) << said.out;
  EXPECT_NE(said.out.find("chosen: "), std::string::npos) << said.out;
  const Result refused = call("tune " + path + " --threads 2 -o " + path);
  EXPECT_EQ(refused.code, 2);
  EXPECT_NE(refused.err.find("--overwrite"), std::string::npos) << refused.err;
  EXPECT_EQ(read_file(path), before);
  EXPECT_EQ(call("tune " + path + " --threads 2 --overwrite -o " + path).code, 0);
  EXPECT_NE(read_file(path), before);
  EXPECT_EQ(call("run " + path + " --no-images --expect -o " + dir("tuned")).code, 0);
}

TEST_F(Cli, TuneFaultsHaveTheirExitCodes) {
  const std::string path = scene();
  EXPECT_EQ(call("tune").code, 2);
  EXPECT_EQ(call("tune " + path + " --threads 0").code, 2);
  EXPECT_EQ(call("tune /nowhere.json").code, 3);
  EXPECT_EQ(call("tune " + path + " --topology /nowhere.json").code, 3);
  write_file_atomically(folder_ / "t.json",
                        R"({"kinds": [{"name": "a", "cores": 0, "speed": 1}]})");
  const Result bad = call("tune " + path + " --topology " + dir("t.json"));
  EXPECT_EQ(bad.code, 3);
  EXPECT_NE(bad.err.find("t.json: /kinds/0/cores: 0 is no count"), std::string::npos) << bad.err;
  write_file_atomically(folder_ / "t.json",
                        R"({"kinds": [{"name": "a", "cores": 2, "speed": 1}]})");
  EXPECT_EQ(call("tune " + path + " --topology " + dir("t.json") + " -o /nowhere/x.json").code, 4);
}

TEST_F(Cli, SchemaEnvAndScenesAreMachineReadable) {
  EXPECT_TRUE(nlohmann::json::parse(call("schema").out).contains("$schema"));
  EXPECT_TRUE(nlohmann::json::parse(call("env").out).contains("compiler"));
  const std::string scenes = call("scenes").out;
  for (const char* name :
       {"hanging_tablecloth", "flag_in_wind", "sewn_bag", "trampoline", "two_sheets"})
    EXPECT_NE(scenes.find(name), std::string::npos);
}

class CliPictures : public Cli {
 protected:
  void SetUp() override {
    Cli::SetUp();
    if (call("doctor").code != 0) GTEST_SKIP() << "no OpenGL here (libosmesa6 or EGL)";
  }
};

TEST_F(CliPictures, RunDrawsFramesAndASheetAndRenderDrawsThemAgain) {
  ASSERT_EQ(call("run " + scene(12, 2) + " --size 320x240 -o " + dir("p")).code, 0);
  for (const char* name : {"frame_0000.png", "frame_0002.png", "contact_sheet.png"})
    EXPECT_EQ(read_file(fs::path(dir("p")) / name).substr(1, 3), "PNG") << name;
  const Result again =
      call("render " + dir("p") + " --color strain --frames 1: -o 's_{frame}.png'");
  EXPECT_EQ(again.code, 0) << again.err;
  EXPECT_TRUE(fs::exists(dir("p/s_2.png")));
  EXPECT_FALSE(fs::exists(dir("p/s_0.png")));
  EXPECT_EQ(call("render " + dir("p") + " --frames 2:7").code, 3);
  EXPECT_EQ(call("render " + dir("p") + " -o '{frames}.png'").code, 2);
  EXPECT_EQ(call("render " + dir("nowhere")).code, 3);
  EXPECT_EQ(call("render " + dir("p") + " -o one.png").code, 3);
}

TEST_F(CliPictures, PartitionAndRenderDrawMeshes) {
  write_file_atomically(folder_ / "two.obj", "v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nf 1 2 3 4\n");
  EXPECT_EQ(call("partition " + dir("two.obj") + " -k 2 --color dof -o " + dir("d.png")).code, 0);
  EXPECT_EQ(
      call("render " + dir("two.obj") + " --color shaded --size 200x200 -o " + dir("m.png")).code,
      0);
  EXPECT_EQ(read_file(dir("d.png")).substr(1, 3), "PNG");
  EXPECT_EQ(read_file(dir("m.png")).substr(1, 3), "PNG");
}

TEST_F(CliPictures, NoStateLeavesNoState) {
  ASSERT_EQ(call("run " + scene(12, 2) + " --size 160x120 --no-state -o " + dir("n")).code, 0);
  EXPECT_TRUE(fs::exists(dir("n/frame_0002.png")));
  EXPECT_FALSE(fs::exists(dir("n/state")));
}

/// One query: a vertex above a triangle and, if `hit`, below it at the end. Numbers that need GMP.
std::string vertex_face_query(bool hit, bool truth, const std::string& end = "\n") {
  const std::string zeros(60, '0');
  const char* points[] = {"1,5,1,5,1,1", "0,1,0,1,0,1", "1,1,0,1,0,1", "0,1,1,1,0,1"};
  std::string text;
  for (int i = 0; i < 8; ++i) {
    const bool last_vertex = i == 4 && hit;
    text += last_vertex ? fmt::format("1{0},5{0},1,5,-1,1", zeros) : points[i % 4];
    text += fmt::format(",{}{}", truth ? 1 : 0, end);
  }
  return text;
}

TEST_F(Cli, CcdJudgesAFileOfQueries) {
  const std::string path = dir("q.csv");
  write_file_atomically(path, vertex_face_query(true, true) + vertex_face_query(false, false) +
                                  vertex_face_query(true, false, "\r\n"));
  for (const char* method : {"halley", "newton", "additive"}) {
    const Result result = call(fmt::format("ccd {} --kind vf --json --method {}", path, method));
    ASSERT_EQ(result.code, 0) << result.err;
    const auto json = nlohmann::json::parse(result.out);
    EXPECT_EQ(json.at("queries"), 3);
    EXPECT_EQ(json.at("hits"), 1);
    EXPECT_EQ(json.at("missed"), 0);
    EXPECT_EQ(json.at("false_positives"), 1);
    EXPECT_EQ(json.at("kind"), "vf");
    EXPECT_EQ(json.at("rounded_coordinates"), 8 + 2 * 2);  // 1/5
    EXPECT_GT(json.at("median_ns"), 0);
    EXPECT_GE(json.at("p99_ns"), json.at("median_ns"));
  }
  const Result table = call("ccd " + path + " --kind vf");
  EXPECT_EQ(table.code, 0);
  EXPECT_NE(table.out.find("false positives  1"), std::string::npos) << table.out;
  EXPECT_NE(table.err.find("rounded"), std::string::npos);
  const Result wide = call("ccd " + path + " --kind vf --json --min-separation 1.5");
  EXPECT_EQ(nlohmann::json::parse(wide.out).at("false_positives"), 2);
}

TEST_F(Cli, CcdSaysWhatItMissed) {
  write_file_atomically(dir("vertex-face.csv"), vertex_face_query(false, true));
  const Result result = call("ccd " + dir("vertex-face.csv"));  // the truth is a lie
  EXPECT_EQ(result.code, 5);
  EXPECT_NE(result.err.find("1 of 1 meetings were missed"), std::string::npos) << result.err;
  EXPECT_NE(result.out.find("missed           1"), std::string::npos) << result.out;
}

TEST_F(Cli, CcdNeedsAKindAndASoundFile) {
  write_file_atomically(dir("q.csv"), vertex_face_query(true, true));
  EXPECT_EQ(call("ccd " + dir("q.csv")).code, 2);
  EXPECT_EQ(call("ccd " + dir("q.csv") + " --kind xx").code, 2);
  EXPECT_EQ(call("ccd " + dir("q.csv") + " --kind vf --min-separation=-1").code, 2);
  EXPECT_EQ(call("ccd " + dir("none.csv") + " --kind vf").code, 3);
  write_file_atomically(dir("edge-edge.csv"), vertex_face_query(true, true) + "0,1,0,0,0,1,1\n");
  const Result bad = call("ccd " + dir("edge-edge.csv"));
  EXPECT_EQ(bad.code, 3);
  EXPECT_NE(bad.err.find("edge-edge.csv:9: a denominator is zero"), std::string::npos) << bad.err;
  EXPECT_TRUE(bad.out.empty());
}

/// Every scene that comes along keeps its own promises.
class ShippedScene : public Cli, public ::testing::WithParamInterface<const char*> {};

TEST_P(ShippedScene, KeepsItsExpectations) {
  const Result result =
      call(fmt::format("run {} --no-images --no-state --expect -o {}", GetParam(), dir("s")));
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_FALSE(nlohmann::json::parse(read_file(dir("s/run.json"))).at("expectations").empty());
}

INSTANTIATE_TEST_SUITE_P(All, ShippedScene,
                         ::testing::Values("hanging_tablecloth", "flag_in_wind", "sewn_bag",
                                           "trampoline", "two_sheets"),
                         [](const auto& scene) { return std::string(scene.param); });

}  // namespace
}  // namespace piecework::cli
