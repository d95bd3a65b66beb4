// first_contact() against exact arithmetic, and that against answers known by hand.

#include <piecework/collision/ccd_oracle.hpp>

#include <algorithm>
#include <optional>
#include <string>

#include <gtest/gtest.h>

#include <piecework/collision/ccd_query_sets.hpp>

namespace piecework::collision {
namespace {

constexpr auto kVt = PairKind::VertexTriangle;
constexpr auto kEe = PairKind::EdgeEdge;
using Time = std::optional<double>;

TEST(CcdOracle, KnowsPlainAnswers) {
  CcdQuery q{kVt, {Vec3(0.2, 0.2, 1), Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)}, {}};
  q.end = q.start;
  EXPECT_EQ(exact_first_contact(q), Time());
  q.end[0].z() = -1;
  EXPECT_EQ(exact_first_contact(q), Time(0.5));
  EXPECT_EQ(exact_first_contact(q, 0.25), Time(0.375));
  EXPECT_EQ(exact_first_contact(q, 1), Time(0));
  q.end[0].z() = -2;
  EXPECT_EQ(exact_first_contact(q), Time(1.0 / 3));  // which is below 1 / 3
  q.start[0].x() = q.end[0].x() = 0.75;
  q.start[0].y() = q.end[0].y() = 0.25;  // through the long side
  EXPECT_EQ(exact_first_contact(q), Time(1.0 / 3));
  q.start[0].x() = q.end[0].x() = 0.75 + 0x1p-52;
  EXPECT_EQ(exact_first_contact(q), Time());
}

TEST(CcdOracle, KnowsDegenerateAnswers) {
  const Vec3 o(0, 0, 0), a(1, 0, 0), b(0.25, 0, 0), up(0, 0, 1), down(0, 0, -1);
  // Parallel edges, a zero-length edge, two points, a triangle without area, one that is a point.
  EXPECT_EQ(exact_first_contact({kEe, {o + up, a + up, b, b + a}, {o + down, a + down, b, b + a}}),
            Time(0.5));
  EXPECT_EQ(exact_first_contact({kEe, {b + up, b + up, o, a}, {b + down, b + down, o, a}}),
            Time(0.5));
  EXPECT_EQ(exact_first_contact({kEe, {up, up, o, o}, {down, down, o, o}}), Time(0.5));
  EXPECT_EQ(exact_first_contact({kVt, {b + up, o, a, o}, {b + down, o, a, o}}), Time(0.5));
  EXPECT_EQ(exact_first_contact({kVt, {a, o, o, o}, {-a, o, o, o}}), Time(0.5));
  EXPECT_EQ(exact_first_contact({kVt, {a + b, o, o, a}, {o - b, o, o, a}}), Time(1.0 / 6));
  EXPECT_EQ(exact_first_contact({kEe, {a + b, a, o, b}, {b + b, b, o, b}}), Time(1));
  // In the plane of the triangle, from outside, along a side, and past a corner.
  const Vec3 y(0, 1, 0);
  EXPECT_EQ(exact_first_contact({kVt, {2 * a, o, a, y}, {o, o, a, y}}), Time(0.5));
  EXPECT_EQ(exact_first_contact({kVt, {2 * a + b, o, a, y}, {a + b, o, a, y}}), Time());
  EXPECT_EQ(exact_first_contact({kVt, {2 * a + y, o, a, y}, {y - 2 * a, o, a, y}}), Time(0.5));
  // A triangle that collapses to a segment just when it is hit.
  EXPECT_EQ(exact_first_contact({kVt, {b + up, o, a, b + y}, {b + down, o, a, b - y}}), Time(0.5));
}

struct Counts {
  int hits = 0, missed = 0, late = 0, false_positives = 0;
};

double size_of(const CcdQuery& q) {
  double size = 0;
  for (const PairPoints* side : {&q.start, &q.end})
    for (const Vec3& p : *side)
      size = std::max(size, (p - side->front()).lpNorm<Eigen::Infinity>());
  return size;
}

/// Judges queries [0, queries) of a set. What is called a hit must nearly be one: at the time given
/// or at most 1e-8 later, exact arithmetic sees the pair within the separation and `nearly` of its
/// size.
Counts judge_set(QuerySet set, int queries, const CcdOptions& options, double nearly) {
  Counts c;
  for (int i = 0; i < queries; ++i) {
    const CcdQuery q = make_query(set, static_cast<std::uint64_t>(i));
    const Time exact = exact_first_contact(q, options.min_separation);
    const CcdResult result = first_contact(q.kind, q.start, q.end, options);
    const CcdVerdict verdict = judge(result, exact);
    c.hits += exact ? 1 : 0;
    c.missed += verdict == CcdVerdict::Missed ? 1 : 0;
    c.late += verdict == CcdVerdict::Late ? 1 : 0;
    c.false_positives += verdict == CcdVerdict::FalsePositive ? 1 : 0;
    if (!result.hit || (exact && result.time > *exact - 1e-8)) continue;
    const double wider = options.min_separation + nearly * size_of(q);
    EXPECT_LE(exact_first_contact(q, wider).value_or(2), result.time + 1e-8) << "query " << i;
  }
  return c;
}

class CcdAgainstOracle : public ::testing::TestWithParam<NamedQuerySet> {};

TEST_P(CcdAgainstOracle, NeverMissesAndIsNeverLate) {
  constexpr int kQueries = 1000;
  for (const CcdMethod method : {CcdMethod::Halley, CcdMethod::Newton, CcdMethod::Additive}) {
    const double nearly = method == CcdMethod::Additive ? 1e-4 : 1e-6;
    const Counts c = judge_set(GetParam().set, kQueries, {.method = method}, nearly);
    EXPECT_EQ(c.missed, 0);
    EXPECT_EQ(c.late, 0);
    EXPECT_GT(c.hits, kQueries / 100);
    EXPECT_LT(c.hits, kQueries * 19 / 20);
    RecordProperty("false_positives", c.false_positives);
  }
}

TEST_P(CcdAgainstOracle, KeepsAMinimumSeparation) {
  for (const double separation : {1e-4, 3e-3}) {
    const Counts c = judge_set(GetParam().set, 500, {.min_separation = separation}, 1e-3);
    EXPECT_EQ(c.missed, 0);
    EXPECT_EQ(c.late, 0);
    EXPECT_GT(c.hits, 5);
  }
}

INSTANTIATE_TEST_SUITE_P(Sets, CcdAgainstOracle, ::testing::ValuesIn(kQuerySets),
                         [](const auto& set) { return std::string(set.param.name); });

}  // namespace
}  // namespace piecework::collision
