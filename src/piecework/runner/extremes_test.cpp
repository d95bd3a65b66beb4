// Every extreme ends well: finite, no energy or momentum out of nothing, no step that says
// "converged" and is not, or a refusal that says what to change.

#include <algorithm>
#include <cctype>
#include <ostream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "extremes.hpp"

namespace piecework::runner {

void PrintTo(const Extreme& extreme, std::ostream* out) { *out << extreme.name; }

namespace {

class Extremes : public ::testing::TestWithParam<Extreme> {};

TEST_P(Extremes, EndsWell) {
  const ExtremeResult result = run_extreme(GetParam());
  EXPECT_EQ(fault_of(GetParam(), result), "");
  if (result.refusal.empty()) {
    EXPECT_EQ(result.steps, GetParam().scene.step.steps);
  }
}

std::string test_name(const ::testing::TestParamInfo<Extreme>& info) {
  std::string name = info.param.name;
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(All, Extremes, ::testing::ValuesIn(extremes()), test_name);

/// The judge himself: what he must not let pass.
TEST(ExtremesJudge, FindsFault) {
  const Extreme extreme = ordinary_cloth();
  EXPECT_EQ(fault_of(extreme, {}), "");
  EXPECT_NE(fault_of(extreme, {.finite = false}), "");
  EXPECT_NE(fault_of(extreme, {.drift = 1}), "");
  EXPECT_NE(fault_of(extreme, {.unsolved = 0.5}), "");
  EXPECT_NE(fault_of(extreme, {.error = 1}), "");
  EXPECT_NE(fault_of(extreme, {.refusal = "no"}), "");
  EXPECT_EQ(fault_of(extreme, {.refusal = "no; say yes"}), "");
}

}  // namespace
}  // namespace piecework::runner
