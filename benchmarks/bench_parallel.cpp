// What one pass through core/parallel.hpp costs: its sum, with all threads of the machine, beside
// a plain loop over the same numbers. Below the size at which the ratio crosses 1, a serial loop
// is the better choice. Validation: both sums agree to rounding.

#include <cmath>
#include <cstddef>
#include <vector>

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <piecework/core/parallel.hpp>
#include <piecework/core/random.hpp>

#include "bench.hpp"
#include "interleaved.hpp"

namespace piecework::bench {
namespace {

void sum_against_plain_loop(benchmark::State& state) {
  Random random(5);
  std::vector<double> terms(static_cast<std::size_t>(state.range(0)));
  for (double& term : terms) term = random.uniform();
  ThreadPool pool(0);
  double ours = 0;
  double plain = 0;
  const auto parallel = [&] {
    ours = pool.run([&] {
      return parallel_sum<double>(terms.size(), [&](std::size_t i) { return terms[i]; });
    });
    keep(ours);
  };
  const auto loop = [&] {
    plain = 0;
    for (const double term : terms) plain += term;
    keep(plain);
  };
  parallel();
  loop();
  InterleavedTimer timer;
  for (auto _ : state) {
    timer.sample(parallel, loop);
    state.SetIterationTime(timer.last_a());
  }
  if (!(std::abs(ours - plain) <= 1e-12 * plain)) {
    fail(state, fmt::format("sums differ: {} and {}", ours, plain));
    return;
  }
  timer.write(state.counters);
  state.counters["threads"] = pool.threads();
}

const Registration registration([] {
  auto* sum = benchmark::RegisterBenchmark("parallel_sum", sum_against_plain_loop);
  sum->UseManualTime()->Unit(benchmark::kMillisecond)->ArgName("terms");
  for (const std::int64_t terms : {1000, 19881, 199809, 1000000})
    if (!quick() || terms < 20000) sum->Arg(terms);
});

}  // namespace
}  // namespace piecework::bench
