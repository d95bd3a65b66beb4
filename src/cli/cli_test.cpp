// The program as a user or a script meets it: files, streams, exit codes.

#include <cstring>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "cli_test_util.hpp"

namespace piecework::cli {
namespace {

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

TEST_F(Cli, SchemaEnvAndScenesAreMachineReadable) {
  EXPECT_TRUE(nlohmann::json::parse(call("schema").out).contains("$schema"));
  EXPECT_TRUE(nlohmann::json::parse(call("env").out).contains("compiler"));
  const std::string scenes = call("scenes").out;
  for (const char* name :
       {"hanging_tablecloth", "flag_in_wind", "sewn_bag", "trampoline", "two_sheets"})
    EXPECT_NE(scenes.find(name), std::string::npos);
}

}  // namespace
}  // namespace piecework::cli
