#include <piecework/scene/plan.hpp>

#include <unistd.h>

#include <set>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/error.hpp>

namespace piecework::scene {
namespace {

namespace fs = std::filesystem;

/// "a=1 b=2" for each case.
std::vector<std::string> cases(const std::string& text) {
  std::vector<std::string> found;
  for (const Case& settings : parse_plan(text, "p.json").cases) {
    std::string line;
    for (const Setting& s : settings) line += (line.empty() ? "" : " ") + s.key + "=" + s.value;
    found.push_back(line);
  }
  return found;
}

using Lines = std::vector<std::string>;

TEST(Plan, VaryIsTheProductWithTheFirstKeySlowest) {
  EXPECT_EQ(cases(R"({"scene": "s", "vary": {"a": [1, 2], "b": ["x", null, 0.5]}})"),
            (Lines{R"(a=1 b="x")", "a=1 b=null", "a=1 b=0.5", R"(a=2 b="x")", "a=2 b=null",
                   "a=2 b=0.5"}));
}

TEST(Plan, ZippedKeysVaryTogetherAndMultiplyTheRest) {
  EXPECT_EQ(cases(R"({"scene": "s", "vary": {"a": [1, 2]},
                      "zip": [{"h": [0.1, 0.2], "n": [20, 10]}, {"c": [7]}]})"),
            (Lines{"a=1 h=0.1 n=20 c=7", "a=1 h=0.2 n=10 c=7", "a=2 h=0.1 n=20 c=7",
                   "a=2 h=0.2 n=10 c=7"}));
}

TEST(Plan, ExplicitCasesComeLastAndAreNotMultiplied) {
  const std::string text = R"({"scene": "s", "vary": {"a": [1, 2]},
                               "cases": [{"b": [1, {"x": true}]}, {}]})";
  EXPECT_EQ(cases(text), (Lines{"a=1", "a=2", R"(b=[1,{"x":true}])", ""}));
  EXPECT_EQ(parse_plan(text, "p.json").keys, (Lines{"a", "b"}));
}

TEST(Plan, StepsSetAndReferenceAreOfEveryRunOrOfOne) {
  const Plan plan = parse_plan(R"({
    // a comment
    "name": "n", "description": "d", "scene": "s", "steps": 12, "set": {"x.y": 3},
    "vary": {"a": [1]}, "reference": {"quality.preset": "reference"}})",
                               "dir/p.json");
  EXPECT_EQ(plan.name, "n");
  EXPECT_EQ(plan.description, "d");
  ASSERT_EQ(plan.common.size(), 2U);
  EXPECT_EQ(plan.common[0].key, "x.y");
  EXPECT_EQ(plan.common[1].key, "step.steps");
  EXPECT_EQ(plan.common[1].value, "12");
  EXPECT_EQ(plan.common[0].source, "dir/p.json:3:80: /set/x.y");
  ASSERT_TRUE(plan.reference);
  EXPECT_EQ(plan.reference->at(0).value, "\"reference\"");
  EXPECT_EQ(parse_plan(R"({"scene": "s", "vary": {"a": [1]}})", "dir/p.json").name, "p");
}

std::string message_of(const std::string& text) {
  try {
    (void)parse_plan(text, "p.json");
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

TEST(Plan, FaultsNamePlaceValueAndRemedy) {
  const std::vector<std::pair<std::string, std::string>> faults = {
      {"[]",
       "p.json:1:1: /: expected an object, found a list; write { \"scene\": ..., \"vary\": { "
       "... } }"},
      {"{", "p.json:1:2: /: "},
      {R"({"vary": {"a": [1]}})",
       "p.json:1:1: /: \"scene\" is missing; name a scene file, or a built-in scene"},
      {R"({"scene": 3})",
       "p.json:1:11: /scene: expected a text, found the number 3; write it in double quotes"},
      {R"({"scene": "s"})", "p.json:1:1: /: there is no case; add \"vary\", \"zip\" or \"cases\""},
      {R"({"scene": "s", "varry": {}})",
       "p.json:1:16: /varry: unknown key \"varry\"; did you mean \"vary\"?"},
      {R"({"scene": "s", "solver.domains": 3})",
       "p.json:1:16: /solver.domains: unknown key \"solver.domains\"; move it into \"set\" (one "
       "value) or \"vary\" (a list of values)"},
      {R"({"scene": "s", "vary": [1]})",
       "p.json:1:24: /vary: expected an object, found a list; write { \"solver.domains\": [16, 32] "
       "}"},
      {R"({"scene": "s", "vary": {"a": 1}})",
       "p.json:1:30: /vary/a: expected a list, found the number 1; write a list of values, such as "
       "[16, 32]"},
      {R"({"scene": "s", "vary": {"a": []}})",
       "p.json:1:30: /vary/a: the list is empty; write a list of values, such as [16, 32]"},
      {R"({"scene": "s", "vary": {"a": [1]}, "zip": [{"a": [1]}]})",
       "p.json:1:45: /zip/0/a: \"a\" varies already; remove one of the two"},
      {R"({"scene": "s", "zip": [{"a": [1, 2], "b": [1]}]})",
       "p.json:1:43: /zip/0/b: 1 values, but \"a\" has 2; lists of one group must be equally long"},
      {R"({"scene": "s", "zip": [{}]})",
       "p.json:1:24: /zip/0: the group is empty; name keys with lists of values, or remove it"},
      {R"({"scene": "s", "zip": {"a": [1]}})",
       "p.json:1:23: /zip: expected a list, found an object"},
      {R"({"scene": "s", "cases": [3]})",
       "p.json:1:26: /cases/0: expected an object, found the number 3"},
      {R"({"scene": "s", "cases": [{}], "reference": "best"})",
       "p.json:1:44: /reference: expected an object, found the text \"best\""}};
  for (const auto& [text, message] : faults)
    EXPECT_EQ(message_of(text).substr(0, message.size()), message) << text;
}

TEST(Plan, TooManyCasesAreTakenForAMistake) {
  std::string values = "0";
  for (int i = 1; i < 30; ++i) values += fmt::format(", {}", i);
  std::string keys;
  for (int k = 0; k < 40; ++k)
    keys += fmt::format("{}\"k{}\": [{}]", k == 0 ? "" : ", ", k, values);
  EXPECT_NE(message_of("{\"scene\": \"s\", \"vary\": {" + keys + "}}").find("the limit is 10000"),
            std::string::npos);
}

class PlanFiles : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / fmt::format("piecework_plan_{}", ::getpid());
    fs::create_directories(folder_ / "plans");
  }
  void TearDown() override { fs::remove_all(folder_); }
  [[nodiscard]] Plan load(const std::string& scene, const std::string& more) const {
    write_file_atomically(folder_ / "plans/p.json",
                          fmt::format(R"({{"scene": "{}", {}}})", scene, more));
    return load_plan(folder_ / "plans/p.json");
  }
  [[nodiscard]] std::string refusal(const std::string& scene, const std::string& more) const {
    try {
      const Plan plan = load(scene, more);
      for (const Case& settings : plan.cases) (void)load_scene_with(plan.scene, settings);
    } catch (const InputError& error) {
      std::string text = error.what();
      const std::string folder = (folder_ / "plans/").string();
      for (auto at = text.find(folder); at != std::string::npos; at = text.find(folder))
        text.erase(at, folder.size());
      return text;
    }
    return "no error";
  }
  fs::path folder_;
};

TEST_F(PlanFiles, ScenesAreFoundBesideThePlanOrByName) {
  const char* vary = R"("vary": {"solver.domains": [1]})";
  EXPECT_EQ(load("hanging_tablecloth", vary).scene.filename(), "hanging_tablecloth.json");
  write_file_atomically(folder_ / "mine.json", R"({"materials": {"m": {}},
      "cloths": [{"mesh": {"generator": "sheet"}, "material": "m"}]})");
  EXPECT_EQ(load("../mine.json", vary).scene, folder_ / "mine.json");
  EXPECT_NE(refusal("hanging_tablecloht", vary).find("/scene: "), std::string::npos);
  EXPECT_NE(refusal("hanging_tablecloht", vary)
                .find("hanging_tablecloht: no such file, nor a built-in scene; did you mean "
                      "\"hanging_tablecloth\"?"),
            std::string::npos)
      << refusal("hanging_tablecloht", vary);
}

TEST_F(PlanFiles, FaultsInSettingsNameTheirPlaceInThePlanAndInTheScene) {
  const std::string scene = "hanging_tablecloth";
  EXPECT_EQ(refusal(scene, R"("vary": {"solver.domains": [1, 0]})"),
            "p.json:1:64: /vary/solver.domains/1: /solver/domains: 0 is out of range; choose a "
            "value of at least 1 and at most 65536");
  EXPECT_EQ(refusal(scene, R"("vary": {"solver.domians": [16]})"),
            "p.json:1:61: /vary/solver.domians/0: /solver/domians: unknown key \"domians\"; did "
            "you mean \"domains\"?");
  EXPECT_EQ(refusal(scene, R"("cases": [{"solver.global": "treee"}])"),
            "p.json:1:61: /cases/0/solver.global: /solver/global: unknown value \"treee\"; did you "
            "mean \"tree\"?");
}

TEST(Plan, DocsShowTheShippedPlan) {
  const std::string page = read_file(PIECEWORK_SOURCE_DIR "/docs/sweep.md");
  const std::string fence = "```json\n";
  const std::size_t begin = page.find(fence) + fence.size();
  const std::string shown = page.substr(begin, page.find("```", begin) - begin);
  const std::string file = PIECEWORK_SOURCE_DIR "/scenes/plans/tablecloth_accuracy.json";
  EXPECT_EQ(cases(shown), cases(read_file(file)));
  EXPECT_EQ(cases(shown).size(), 7U);
  EXPECT_EQ(parse_plan(shown, "p").description, load_plan(file).description);
}

TEST_F(PlanFiles, ShippedPlansAreSound) {
  int plans = 0;
  for (const auto& entry : fs::directory_iterator(PIECEWORK_SOURCE_DIR "/scenes/plans")) {
    SCOPED_TRACE(entry.path());
    const Plan plan = load_plan(entry.path());
    EXPECT_FALSE(plan.description.empty());
    std::vector<Case> all = plan.cases;
    if (plan.reference) all.push_back(*plan.reference);
    for (Case settings : all) {
      settings.insert(settings.begin(), plan.common.begin(), plan.common.end());
      EXPECT_NO_THROW((void)load_scene_with(plan.scene, settings));
    }
    ++plans;
  }
  EXPECT_GE(plans, 1);
}

}  // namespace
}  // namespace piecework::scene
