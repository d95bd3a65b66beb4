#include "predict.hpp"

#include <gtest/gtest.h>

namespace piecework::bench {
namespace {

using global::TreeSchedule;

/// Four equal tasks of 3 ms each way, one front of 8 ms each way in two panels of up to four tiles.
TreeSchedule schedule() {
  TreeSchedule result;
  result.tasks.assign(4, {3, 3, 300, 300});
  TreeSchedule::Front front;
  front.forward_ms = front.backward_ms = 8;
  front.forward_bytes = front.backward_bytes = 800;
  front.panels = 2;
  front.forward_tiles = front.backward_tiles = 4;
  result.fronts = {front};
  return result;
}

TEST(Predict, OneCoreDoesEverythingInTurn) {
  EXPECT_DOUBLE_EQ(predicted_ms(schedule(), 1, {1, 1}), 4 * 3 * 2 + 8 * 2);
}

TEST(Predict, TasksAndTilesLimitWhatCoresCanDo) {
  EXPECT_DOUBLE_EQ(predicted_ms(schedule(), 2, {}), 2 * (6 + 4));
  EXPECT_DOUBLE_EQ(predicted_ms(schedule(), 3, {}), 2 * (6 + 8.0 / 3));
  EXPECT_DOUBLE_EQ(predicted_ms(schedule(), 64, {}), 2 * (3 + 2));
}

TEST(Predict, BarriersAndBandwidthAddUp) {
  EXPECT_DOUBLE_EQ(predicted_ms(schedule(), 64, {0.5, 0}), 2 * (3 + 0.5 + 2 + 3 * 0.5));
  EXPECT_DOUBLE_EQ(predicted_ms(schedule(), 64, {0, 200}), 2 * (6 + 4));
}

TEST(Predict, MediansAreTakenPartByPart) {
  TreeSchedule slow = schedule();
  slow.tasks[1].forward_ms = 90;
  TreeSchedule fast = schedule();
  fast.fronts[0].backward_ms = 1;
  const TreeSchedule median = median_schedule({slow, schedule(), fast});
  EXPECT_DOUBLE_EQ(median.tasks[1].forward_ms, 3);
  EXPECT_DOUBLE_EQ(median.fronts[0].backward_ms, 8);
}

}  // namespace
}  // namespace piecework::bench
