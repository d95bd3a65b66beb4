#include <piecework/runner/proposal.hpp>

#include <gtest/gtest.h>

#include <piecework/scene/scene_io.hpp>

#include "small_scene.hpp"

namespace piecework::runner {
namespace {

Topology hybrid(int fast, int slow, double speed) {
  return {.kinds = {{.name = "performance", .cores = fast, .processors = {}},
                    {.name = "efficient", .cores = slow, .speed = speed, .processors = {}}},
          .source = "test"};
}

Topology plain(int cores) {
  return {.kinds = {{.name = "all alike", .cores = cores, .processors = {}}}, .source = "test"};
}

std::vector<int> counts(const std::vector<DomainSetting>& settings) {
  std::vector<int> result;
  for (const DomainSetting& setting : settings) result.push_back(setting.domains);
  return result;
}

TEST(Proposal, WeightsAreSpeedsInProportionToCores) {
  EXPECT_EQ(weights_for(hybrid(2, 2, 0.5), 4), (std::vector<double>{1, 1, 0.5, 0.5}));
  EXPECT_EQ(weights_for(hybrid(1, 3, 0.5), 8), (std::vector<double>{1, 1, .5, .5, .5, .5, .5, .5}));
  EXPECT_EQ(weights_for(hybrid(1, 1, 0.5), 3), (std::vector<double>{1, 1, 0.5})) << "a tie";
  EXPECT_TRUE(weights_for(hybrid(4, 4, 1.0), 8).empty()) << "the same speed";
  EXPECT_TRUE(weights_for(hybrid(2, 2, 0.5), 1).empty()) << "one domain has no share to speak of";
  EXPECT_TRUE(weights_for(plain(8), 8).empty());
}

TEST(Proposal, CandidatesAreMultiplesOfTheWorkersAndNeverTooSmall) {
  EXPECT_EQ(counts(candidate_settings(plain(8), 8, 1'000'000)), (std::vector<int>{1, 8, 16, 32}));
  EXPECT_EQ(counts(candidate_settings(plain(8), 8, 20'000)), (std::vector<int>{1, 8, 16, 20}));
  EXPECT_EQ(counts(candidate_settings(plain(8), 8, 5'999)), (std::vector<int>{1, 5}));
  EXPECT_EQ(counts(candidate_settings(plain(8), 8, 12)), (std::vector<int>{1}));
  EXPECT_EQ(counts(candidate_settings(plain(1), 1, 1'000'000)), (std::vector<int>{1, 2, 4}));
  for (const DomainSetting& setting : candidate_settings(hybrid(8, 8, 0.25), 16, 30'000)) {
    double sum = 0;
    for (const double weight : setting.weights) sum += weight;
    if (setting.domains == 1) continue;
    EXPECT_GE(30'000 * 0.25 / sum, kMinVerticesPerDomain);
  }
}

TEST(Proposal, WithoutMeasurementOneDomainPerWorker) {
  const Proposal large = propose_unmeasured(hybrid(8, 8, 0.55), 16, 100'000);
  EXPECT_EQ(large.chosen.domains, 16);
  EXPECT_EQ(weights_text(large.chosen.weights), "8 x 1, 8 x 0.55");
  const Proposal small = propose_unmeasured(plain(16), 16, 4'000);
  EXPECT_EQ(small.chosen, (DomainSetting{4, {}}));
  EXPECT_NE(small.reason.find("1000 vertices"), std::string::npos) << small.reason;
}

CandidateRow measured(int domains, double low, double median, double high) {
  return {.setting = {domains, {}},
          .timings = {{.ms = {.median = median}, .ratio = {median, low, high, 15}}},
          .refusal = {}};
}

TEST(Proposal, OnlySignificantGainsCount) {
  const CandidateRow now = measured(32, 1, 1, 1);
  EXPECT_EQ(propose_measured({now}).chosen.domains, 32);
  EXPECT_EQ(propose_measured({now, measured(2, 0.5, 0.8, 1.1), measured(4, 1.2, 1.5, 1.6)})
                .chosen.domains,
            32);
  EXPECT_EQ(propose_measured({now, measured(2, 0.5, 0.7, 1.1), measured(4, 0.8, 0.9, 0.95),
                              measured(8, 0.7, 0.8, 0.9)})
                .chosen.domains,
            8);
  CandidateRow refused = measured(2, 0.1, 0.2, 0.3);
  refused.refusal = "too large";
  EXPECT_EQ(propose_measured({now, refused}).chosen.domains, 32);
}

/// The last solver, the scene's own, decides.
TEST(Proposal, TheScenesOwnSolverDecides) {
  CandidateRow now = measured(32, 1, 1, 1);
  CandidateRow other = measured(4, 0.3, 0.4, 0.5);
  now.timings.push_back(now.timings[0]);
  other.timings.push_back({.ms = {}, .ratio = {2, 1.9, 2.1, 15}});
  EXPECT_EQ(propose_measured({now, other}).chosen.domains, 32);
}

TEST(Proposal, TheWrittenSceneSaysTheSameButForItsDomains) {
  const scene::Scene scene = small_scene();
  const scene::Scene tuned = with_setting(scene, {3, {1, 1, 0.55}});
  const scene::Scene back = scene::parse_scene(scene::resolved_json(tuned), "small.json");
  EXPECT_EQ(present_setting(back), (DomainSetting{3, {1, 1, 0.55}}));
  scene::Scene undone = with_setting(back, present_setting(scene));
  EXPECT_EQ(undone, scene);
}

}  // namespace
}  // namespace piecework::runner
