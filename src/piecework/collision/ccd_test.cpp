#include <piecework/collision/ccd.hpp>

#include <cmath>
#include <limits>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include <piecework/core/random.hpp>

namespace piecework::collision {
namespace {

constexpr auto kVt = PairKind::VertexTriangle;
constexpr auto kEe = PairKind::EdgeEdge;

PairPoints shifted(PairPoints x, const Vec3& by) {
  for (Vec3& p : x) p += by;
  return x;
}

/// A vertex one above the middle of a triangle in the plane z = 0, and the same two below.
const PairPoints kAbove{Vec3(0.2, 0.2, 1), Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)};
const PairPoints kBelow{Vec3(0.2, 0.2, -1), Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)};
/// Two crossing edges, one unit apart, and after changing sides.
const PairPoints kCrossed{Vec3(-1, 0, 1), Vec3(1, 0, 1), Vec3(0, -1, 0), Vec3(0, 1, 0)};
const PairPoints kUncrossed{Vec3(-1, 0, -1), Vec3(1, 0, -1), Vec3(0, -1, 0), Vec3(0, 1, 0)};

/// Every method must say the same about a meeting at `expected`.
void expect_hit(PairKind kind, const PairPoints& start, const PairPoints& end, double expected,
                double slack = 1e-8) {
  for (const CcdMethod method : {CcdMethod::Halley, CcdMethod::Newton, CcdMethod::Additive}) {
    const CcdResult r = first_contact(kind, start, end, {.method = method});
    EXPECT_TRUE(r.hit);
    EXPECT_LE(r.time, expected);
    EXPECT_GE(r.time, expected - slack);
  }
}

void expect_miss(PairKind kind, const PairPoints& start, const PairPoints& end) {
  for (const CcdMethod method : {CcdMethod::Halley, CcdMethod::Newton, CcdMethod::Additive}) {
    const CcdResult r = first_contact(kind, start, end, {.method = method});
    EXPECT_FALSE(r.hit);
    EXPECT_EQ(r.time, 1);
  }
}

TEST(Ccd, FindsPlainMeetings) {
  expect_hit(kVt, kAbove, kBelow, 0.5);
  expect_hit(kVt, kBelow, kAbove, 0.5);
  expect_hit(kEe, kCrossed, kUncrossed, 0.5);
  expect_miss(kVt, kAbove, kAbove);
  expect_miss(kEe, kCrossed, kCrossed);
}

TEST(Ccd, PassingThePlaneOutsideIsNoMeeting) {
  PairPoints start = kAbove, end = kBelow;
  start[0].x() = end[0].x() = 0.81;  // beyond the long side by 0.01 / sqrt(2)
  expect_miss(kVt, start, end);
  start = kCrossed, end = kUncrossed;
  for (PairPoints* x : {&start, &end}) (*x)[0].x() = 0.01;  // the edge begins beside the other
  expect_miss(kEe, start, end);
}

TEST(Ccd, MeetingsAtTheBordersCount) {
  PairPoints start = kAbove, end = kBelow;
  for (const Vec3& corner : {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0.5, 0.5, 0)}) {
    start[0] = corner + Vec3(0, 0, 1);
    end[0] = corner - Vec3(0, 0, 1);
    expect_hit(kVt, start, end, 0.5);
    end[0] = corner;
    expect_hit(kVt, start, end, 1);
    expect_hit(kVt, end, start, 0);
  }
}

TEST(Ccd, DegenerateElementsMeet) {
  const Vec3 o(0, 0, 0), a(1, 0, 0), b(0.25, 0, 0), up(0, 0, 1), back(0, 0, -1);
  const PairPoints parallel{o + up, a + up, b, b + a};
  expect_hit(kEe, parallel, {o + back, a + back, b, b + a}, 0.5);
  expect_hit(kEe, {b + up, b + up, o, a}, {b + back, b + back, o, a}, 0.5);  // a zero-length edge
  expect_hit(kEe, {o + up, o + up, o, o}, {o + back, o + back, o, o}, 0.5);  // two points
  expect_hit(kVt, {b + up, o, a, o}, {b + back, o, a, o}, 0.5);              // no area
  expect_hit(kVt, {o + a, o, o, o}, {o - a, o, o, o}, 0.5);                  // a point
  expect_miss(kEe, parallel, shifted(parallel, Vec3(5, 6, 7)));
  expect_miss(kVt, {a + up, o, o, o}, {up - a, o, o, o});
}

TEST(Ccd, CoplanarMotionMeetsOnlyWhereItDoes) {
  PairPoints start{Vec3(2, 0.2, 0), Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)}, end = start;
  end[0] = Vec3(0, 0.2, 0);
  expect_hit(kVt, start, end, 0.6);
  end[0] = Vec3(0.9, 0.2, 0);
  expect_miss(kVt, start, end);
}

TEST(Ccd, CommonMotionHoweverFarChangesNothing) {
  for (const double far : {1e4, 1e6, 1e9}) {
    const Vec3 by(far, -far, 2 * far);
    expect_hit(kVt, shifted(kAbove, -by), shifted(kBelow, by), 0.5, 1e-6);
    expect_hit(kEe, shifted(kCrossed, by), shifted(kUncrossed, -by), 0.5, 1e-6);
    expect_miss(kVt, shifted(kAbove, -by), shifted(kAbove, by));
    expect_miss(kEe, shifted(kCrossed, -by), shifted(kCrossed, by));
  }
}

TEST(Ccd, MinimumSeparationIsMetWhenItIsReached) {
  for (const auto& [kind, start, end] :
       {std::tuple{kVt, kAbove, kBelow}, std::tuple{kEe, kCrossed, kUncrossed}})
    for (const double gap : {1e-9, 1e-3, 0.1, 0.9}) {
      const CcdResult r = first_contact(kind, start, end, {.min_separation = gap});
      EXPECT_TRUE(r.hit);
      EXPECT_LE(r.time, 0.5 * (1 - gap));
      EXPECT_GE(r.time, 0.5 * (1 - gap) - 1e-6);
      EXPECT_FALSE(first_contact(kind, start, start, {.min_separation = gap}).hit);
      EXPECT_TRUE(first_contact(kind, end, end, {.min_separation = 1 + gap}).hit);
    }
}

TEST(Ccd, WhatCannotBeComputedIsAHitAtOnce) {
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e50}) {
    PairPoints end = kAbove;
    end[2].y() = bad;
    const CcdResult r = first_contact(kVt, kAbove, end, {});
    EXPECT_TRUE(r.hit);
    EXPECT_EQ(r.time, 0);
  }
  const PairPoints point{Vec3(3, 4, 5), Vec3(3, 4, 5), Vec3(3, 4, 5), Vec3(3, 4, 5)};
  expect_hit(kEe, point, shifted(point, Vec3(1, 1, 1)), 0);
}

TEST(Ccd, ManyAtOnceAreTheSameAsOneByOne) {
  Random random(5);
  std::vector<CcdQuery> queries(3000);
  for (CcdQuery& q : queries) {
    q.kind = random.uniform() < 0.5 ? kVt : kEe;
    for (PairPoints* x : {&q.start, &q.end})
      for (Vec3& p : *x)
        p = Vec3(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
  }
  std::vector<CcdResult> results(queries.size());
  first_contacts(queries, {}, results);
  int hits = 0;
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const CcdQuery& q = queries[i];
    const CcdResult r = first_contact(q.kind, q.start, q.end, {});
    EXPECT_EQ(r.hit, results[i].hit);
    EXPECT_EQ(r.time, results[i].time);
    hits += r.hit ? 1 : 0;
  }
  EXPECT_GT(hits, 100);
  EXPECT_LT(hits, 2900);
}

}  // namespace
}  // namespace piecework::collision
