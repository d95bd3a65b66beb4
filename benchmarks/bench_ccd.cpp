// Continuous collision detection of single pairs: how often it is wrong, and what it costs. Every
// set of queries (collision/ccd_query_sets.hpp) goes through every method, and each answer is
// judged by exact arithmetic; without --quick that is more than a million different queries. Times
// are those of the method and of Newton's in turns over the first few thousand queries of the set,
// one thread; ratio is method : Newton. Validation: nothing missed, nothing late.
//
// Rows ccd/separated/* ask for a minimum separation of 0.1 mm, the others for touching.

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <piecework/collision/ccd_oracle.hpp>
#include <piecework/collision/ccd_query_sets.hpp>
#include <piecework/core/parallel.hpp>

#include "bench.hpp"
#include "interleaved.hpp"

namespace piecework::bench {
namespace {

using collision::CcdMethod;
using collision::CcdOptions;
using collision::CcdQuery;
using collision::CcdResult;
using collision::CcdVerdict;
using collision::NamedQuerySet;

constexpr std::size_t kTimedQueries = 4096;
constexpr double kSeparation = 1e-4;  // m

struct Series {
  const char* name;
  CcdOptions options;
};

constexpr std::array<Series, 4> kSeries{{
    {"halley", {.method = CcdMethod::Halley}},
    {"newton", {.method = CcdMethod::Newton}},
    {"additive", {.method = CcdMethod::Additive}},
    {"separated", {.min_separation = kSeparation}},
}};

/// Queries of one set and what happens to them.
struct Judged {
  std::vector<CcdQuery> queries;
  std::vector<std::optional<double>> exact;

  Judged(collision::QuerySet set, std::size_t count, double separation)
      : queries(count), exact(count) {
    parallel_for(count, [&](std::size_t i) {
      queries[i] = collision::make_query(set, i);
      exact[i] = collision::exact_first_contact(queries[i], separation);
    });
  }
};

/// Computed once for all methods.
const Judged& judged(collision::QuerySet set, double separation) {
  static std::map<std::pair<collision::QuerySet, bool>, std::unique_ptr<Judged>> cache;
  auto& entry = cache[{set, separation > 0}];
  const std::size_t count = (separation > 0 ? 10000 : 96000) / (quick() ? 50U : 1U);
  if (!entry) entry = std::make_unique<Judged>(set, count, separation);
  return *entry;
}

void run_all(std::span<const CcdQuery> queries, const CcdOptions& options) {
  for (const CcdQuery& q : queries) keep(first_contact(q.kind, q.start, q.end, options));
}

struct Counts {
  std::array<double, 4> verdicts{};  ///< by CcdVerdict
  double hits = 0, evaluations = 0, additive = 0;
};

Counts count(const Judged& set, const CcdOptions& options) {
  std::vector<CcdResult> results(set.queries.size());
  collision::first_contacts(set.queries, options, results);
  Counts c;
  for (std::size_t i = 0; i < results.size(); ++i) {
    ++c.verdicts[static_cast<std::size_t>(collision::judge(results[i], set.exact[i]))];
    c.hits += set.exact[i] ? 1 : 0;
    c.evaluations += results[i].evaluations;
    c.additive += results[i].additive ? 1 : 0;
  }
  return c;
}

void ccd(benchmark::State& state, const Series& series, const NamedQuerySet& named) {
  const Judged& set = judged(named.set, series.options.min_separation);
  const std::span timed(set.queries.data(), std::min(kTimedQueries, set.queries.size()));
  CcdOptions newton = series.options;
  newton.method = CcdMethod::Newton;
  InterleavedTimer timer;
  for (auto _ : state) {
    timer.sample_in_a_row([&] { run_all(timed, series.options); }, [&] { run_all(timed, newton); });
    state.SetIterationTime(timer.last_a());
  }
  const Counts c = count(set, series.options);
  const auto of = [&](CcdVerdict v) { return c.verdicts[static_cast<std::size_t>(v)]; };
  const auto n = static_cast<double>(set.queries.size());
  state.counters["queries"] = n;
  state.counters["hits"] = c.hits;
  state.counters["missed"] = of(CcdVerdict::Missed);
  state.counters["late"] = of(CcdVerdict::Late);
  state.counters["false_positives"] = of(CcdVerdict::FalsePositive);
  state.counters["evaluations"] = c.evaluations / n;
  state.counters["additive"] = c.additive / n;
  state.counters["ns_per_query"] =
      1e9 * timer.a_seconds().median / static_cast<double>(timed.size());
  state.counters["ratio"] = timer.paired_ratio().median;
  if (of(CcdVerdict::Missed) + of(CcdVerdict::Late) > 0)
    fail(state, fmt::format("{} missed, {} late", of(CcdVerdict::Missed), of(CcdVerdict::Late)));
}

const Registration registration([] {
  for (const NamedQuerySet& set : collision::kQuerySets)
    for (const Series& series : kSeries)
      benchmark::RegisterBenchmark(fmt::format("ccd/{}/{}", series.name, set.name).c_str(), ccd,
                                   series, set)
          ->UseManualTime()
          ->Unit(benchmark::kMillisecond)
          ->Iterations(quick() ? 6 : 31);
});

}  // namespace
}  // namespace piecework::bench
