// Every scene that comes along keeps its own promises.

#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "cli_test_util.hpp"

namespace piecework::cli {
namespace {

struct Shipped {
  const char* scene;
  const char* coarser = "";  ///< overrides with which its expectations hold as well
};

class ShippedScene : public Cli, public ::testing::WithParamInterface<Shipped> {};

TEST_P(ShippedScene, KeepsItsExpectations) {
  const auto& [scene, coarser] = GetParam();
  const Result result = call(fmt::format("run {} {} --no-images --no-state --expect --strict -o {}",
                                         scene, coarser, dir("s")));
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_FALSE(nlohmann::json::parse(read_file(dir("s/run.json"))).at("expectations").empty());
}

// The dearer ones run in ci/full.sh.
INSTANTIATE_TEST_SUITE_P(
    All, ShippedScene,
    ::testing::Values(Shipped{"hanging_tablecloth"}, Shipped{"flag_in_wind"}, Shipped{"sewn_bag"},
                      Shipped{"trampoline"}, Shipped{"two_sheets"}, Shipped{"cloth_on_stairs"},
                      Shipped{"drape_on_sphere"}, Shipped{"sleeve_push"},
                      Shipped{"pot_drape",
                              "--set cloths.0.mesh.columns=30 --set cloths.0.mesh.rows=30"}),
    [](const auto& shipped) { return std::string(shipped.param.scene); });

}  // namespace
}  // namespace piecework::cli
