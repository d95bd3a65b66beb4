// Numerical extremes: does the engine stay right where numbers end? One row per extreme; a table of
// answers, not of speed. Validation: what runner/extremes.hpp promises of each.

#include <string>
#include <vector>

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <piecework/runner/extremes.hpp>

#include "bench.hpp"

namespace piecework::bench {
namespace {

using runner::Extreme;
using runner::ExtremeResult;

void extremes(benchmark::State& state, const Extreme& extreme) {
  ExtremeResult result;
  for (auto _ : state) {
    result = runner::run_extreme(extreme);
    state.SetIterationTime(1e-3 * result.ms);
  }
  if (const std::string fault = fault_of(extreme, result); !fault.empty()) {
    fail(state, fault);
    return;
  }
  state.counters["steps"] = result.steps;
  state.counters["converged_steps"] = result.converged;
  state.counters["stalled_steps"] = result.stalled;
  state.counters["lg_iterations"] = result.iterations;
  state.counters["gradient"] = result.gradient;
  state.counters["error"] = result.error;
  state.counters["energy_drift"] = result.drift;
  state.counters["momentum_error"] = result.momentum;
  state.counters["nan"] = result.finite ? 0 : 1;
  state.counters["refused"] = result.refusal.empty() ? 0 : 1;
}

const Registration registration([] {
  for (const Extreme& extreme : runner::extremes()) {
    auto* row = benchmark::RegisterBenchmark(
        fmt::format("extremes/{}", extreme.name).c_str(),
        [extreme](benchmark::State& state) { extremes(state, extreme); });
    row->Unit(benchmark::kMillisecond)->UseManualTime()->Iterations(1);
  }
});

}  // namespace
}  // namespace piecework::bench
