// Every scene that comes along keeps its own promises.

#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "cli_test_util.hpp"

namespace piecework::cli {
namespace {

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
