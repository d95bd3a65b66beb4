// piecework partition, check, tune and ccd.

#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "cli_test_util.hpp"

namespace piecework::cli {
namespace {

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

TEST_F(Cli, CheckRefusesContactThatARunWouldRefuse) {
  const std::string scene = "check drape_on_sphere";
  EXPECT_EQ(call(scene).code, 0);
  for (const auto& [override, word] : {std::pair("contact.distance=0.02", "/contact/distance"),
                                       std::pair("solver.method=newton", "/solver/method")}) {
    const Result result = call(scene + " --set " + override);
    EXPECT_EQ(result.code, 3) << override;
    EXPECT_NE(result.err.find(word), std::string::npos) << result.err;
    EXPECT_TRUE(result.out.empty()) << result.out;
  }
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

}  // namespace
}  // namespace piecework::cli
