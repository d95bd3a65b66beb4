// Outer loops against true errors: how many iterations, and how many milliseconds, from the start
// of step 20 of the hanging sheet to a given distance from its minimum. Each row runs the method
// and vanilla projective dynamics with CHOLMOD on one thread in turns. Validation: the reference
// is stationary, and no method ends below it.

#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <piecework/baselines/newton.hpp>
#include <piecework/baselines/vanilla_pd.hpp>
#include <piecework/core/clock.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/core/statistics.hpp>
#include <piecework/runner/methods.hpp>

#include "bench.hpp"
#include "hanging_sheet.hpp"

namespace piecework::bench {
namespace {

struct Level {
  const char* name;
  double error;
};
constexpr std::array<Level, 5> kEnergyLevels{
    {{"1e-1", 1e-1}, {"1e-2", 1e-2}, {"1e-3", 1e-3}, {"1e-4", 1e-4}, {"1e-6", 1e-6}}};
constexpr std::array<Level, 3> kPositionLevels{{{"1e-1", 1e-1}, {"1e-2", 1e-2}, {"1e-3", 1e-3}}};
constexpr double kPaperTolerance = 1e-3;  // ||dx|| in the unit box [Lu25, Sec. 7]
constexpr double kNotReached = -1;

/// When a run may end.
struct Limit {
  double energy_error = 0.5e-6;
  double seconds = 20;
  int iterations = 1000000;
};

/// What a minimiser did on its way; -1 where it did not get.
struct Trace {
  std::array<double, kEnergyLevels.size()> iterations, ms;
  std::array<double, kPositionLevels.size()> position_ms;
  double paper_iterations = kNotReached, paper_error = kNotReached, paper_position = kNotReached;
  double error = kNotReached, position = kNotReached;
  model::StepReport report;

  Trace() {
    iterations.fill(kNotReached);
    ms.fill(kNotReached);
    position_ms.fill(kNotReached);
  }
};

/// Runs a minimiser from the start of the step. The clock stands still while errors are measured.
Trace follow(HangingSheet& sheet, model::Minimizer& minimizer, const Limit& limit) {
  Trace trace;
  model::StepProblem problem = sheet.problem();
  std::vector<double> memory = sheet.memory();
  problem.memory = &memory;
  Stopwatch watch;
  double passed = 0;
  problem.observer = [&](const model::StepReport& report, const Positions& x) {
    passed += watch.lap();
    trace.error = sheet.energy_error(report.energy);
    trace.position = sheet.position_error(x);
    for (std::size_t i = 0; i < kEnergyLevels.size(); ++i)
      if (trace.ms[i] < 0 && trace.error <= kEnergyLevels[i].error) {
        trace.ms[i] = passed;
        trace.iterations[i] = report.iterations;
      }
    for (std::size_t i = 0; i < kPositionLevels.size(); ++i)
      if (trace.position_ms[i] < 0 && trace.position <= kPositionLevels[i].error)
        trace.position_ms[i] = passed;
    if (trace.paper_iterations < 0 && report.iterations > 0 && report.dx_2 <= kPaperTolerance) {
      trace.paper_iterations = report.iterations;
      trace.paper_error = trace.error;
      trace.paper_position = trace.position;
    }
    watch.lap();
    return trace.error > limit.energy_error && passed < 1e3 * limit.seconds &&
           report.iterations < limit.iterations;
  };
  Positions x = sheet.start();
  watch.lap();
  trace.report = minimizer.minimize(problem, x);
  return trace;
}

struct Method {
  const char* name;
  const char* method;      ///< solver.method
  const char* accelerate;  ///< quality.accelerate; null: the default
  const char* hessian = nullptr;
  const char* linear = nullptr;
};

constexpr Method kMethods[] = {{"default", "dd_pd", nullptr},
                               {"lbfgs", "dd_pd", "lbfgs"},
                               {"anderson", "dd_pd", "anderson"},
                               {"chebyshev", "dd_pd", "chebyshev"},
                               {"pd_tree", "dd_pd", "none"},
                               {"newton", "newton", nullptr, "projected", "cholmod"},
                               {"newton_pcg", "newton", nullptr, "projected", "pcg"},
                               {"vanilla_pd", "vanilla_pd", nullptr}};

std::unique_ptr<model::Minimizer> make(const Method& method, HangingSheet& sheet) {
  scene::Scene& scene = sheet.world().scene;
  const scene::Scene kept = scene;
  scene.quality = {};
  scene.quality.stop = "gradient";
  scene.quality.tolerance = 1e-14;
  scene.quality.max_iterations = 100000;
  scene.solver.method = method.method;
  if (method.accelerate) scene.quality.accelerate = method.accelerate;
  if (std::string(method.method) == "vanilla_pd") scene.solver.global = "single";
  const model::StopOptions stop{model::StopRule::Gradient, 1e-14, 100000, 1};
  std::unique_ptr<model::Minimizer> minimizer;
  if (method.hessian)
    minimizer = std::make_unique<baselines::Newton>(
        sheet.world().model, scene.step.h, 9.81, stop,
        baselines::NewtonOptions{.hessian = model::HessianForm::Projected,
                                 .linear = std::string(method.linear) == "pcg"
                                               ? baselines::NewtonLinear::Pcg
                                               : baselines::NewtonLinear::Cholmod});
  else
    minimizer = runner::make_minimizer(sheet.world());
  scene = kept;
  return minimizer;
}

/// Problems and their references, made once for all rows.
HangingSheet& sheet_of(std::size_t cloth, int side) {
  static std::map<std::pair<std::size_t, int>, std::unique_ptr<HangingSheet>> sheets;
  auto& sheet = sheets[{cloth, side}];
  if (!sheet) sheet = std::make_unique<HangingSheet>(kCloths[cloth], side);
  return *sheet;
}

double median_or(const std::vector<double>& values) {
  if (values.empty()) return kNotReached;
  return *std::min_element(values.begin(), values.end()) < 0 ? kNotReached
                                                             : median_interval(values).median;
}

template <std::size_t N>
double median_of(const std::vector<Trace>& traces, const std::array<double, N> Trace::*member,
                 std::size_t i) {
  std::vector<double> values;
  for (const Trace& trace : traces) values.push_back((trace.*member)[i]);
  return median_or(values);
}

void write(benchmark::State& state, const std::vector<Trace>& ours,
           const std::vector<Trace>& base) {
  auto& counters = state.counters;
  for (std::size_t i = 0; i < kEnergyLevels.size(); ++i) {
    const std::string level = kEnergyLevels[i].name;
    const double ms = median_of(ours, &Trace::ms, i);
    const double base_ms = median_of(base, &Trace::ms, i);
    counters["iterations_" + level] = median_of(ours, &Trace::iterations, i);
    counters["time_ms_" + level] = ms;
    counters["ratio_" + level] = ms > 0 && base_ms > 0 ? base_ms / ms : kNotReached;
  }
  for (std::size_t i = 0; i < kPositionLevels.size(); ++i)
    counters[std::string("position_time_ms_") + kPositionLevels[i].name] =
        median_of(ours, &Trace::position_ms, i);
  const Trace& last = ours.back();
  counters["error"] = last.error;
  counters["position_error"] = last.position;
  counters["gradient"] = last.report.gradient;
  counters["evaluations"] = last.report.evaluations;
  counters["paper_iterations"] = last.paper_iterations;
  counters["paper_error"] = last.paper_error;
  counters["paper_position"] = last.paper_position;
  counters["n_samples"] = static_cast<double>(ours.size());
}

void convergence(benchmark::State& state, std::size_t method, std::size_t cloth) {
  const auto vertices = state.range(0);
  const int threads = static_cast<int>(state.range(1));
  if (threads > available_threads()) {
    skip(state, fmt::format("{} threads on {} cores", threads, available_threads()));
    return;
  }
  HangingSheet& sheet = sheet_of(cloth, side_of(vertices));
  const auto ours = make(kMethods[method], sheet);
  baselines::VanillaPd vanilla(sheet.world().model, sheet.world().scene.step.h, 9.81,
                               {model::StopRule::Gradient, 1e-14, 100000, 1});
  // Far enough for a ratio, not to the end: that would take minutes.
  const Limit base_limit{vertices > 30000 ? 1e-3 : 1e-4, quick() ? 3.0 : 12.0};
  ThreadPool pool(threads);
  ThreadPool one(1);
  // In a simulation set-up is behind when a step begins.
  const Limit warm_up{.energy_error = -1, .iterations = 1};
  (void)pool.run([&] { return follow(sheet, *ours, warm_up); });
  (void)one.run([&] { return follow(sheet, vanilla, warm_up); });
  std::vector<Trace> traces;
  std::vector<Trace> base;
  for (auto _ : state) {
    Stopwatch watch;
    traces.push_back(pool.run([&] { return follow(sheet, *ours, {}); }));
    state.SetIterationTime(1e-3 * watch.elapsed_ms());
    base.push_back(one.run([&] { return follow(sheet, vanilla, base_limit); }));
  }
  if (!(sheet.reference_gradient() < 1e-6) || !(traces.back().error > -1e-7)) {
    fail(state, fmt::format("the reference is no minimum: gradient {:.1e}, {:.1e} below it",
                            sheet.reference_gradient(), -traces.back().error));
    return;
  }
  write(state, traces, base);
}

const Registration registration([] {
  for (const std::int64_t n : {2500, 19881, 60025, 199809})
    for (std::size_t cloth = 0; cloth < std::size(kCloths); ++cloth)
      for (std::size_t method = 0; method < std::size(kMethods); ++method) {
        if (quick() && n > 2500) continue;
        // What takes minutes per step says no more at 200K than at 60K.
        const bool large = n > 100000;
        if (large && (kMethods[method].hessian != nullptr || cloth != 1)) continue;
        auto* row = benchmark::RegisterBenchmark(
            fmt::format("convergence/{}/{}", kMethods[method].name, kCloths[cloth].name).c_str(),
            [method, cloth](benchmark::State& state) { convergence(state, method, cloth); });
        row->Unit(benchmark::kMillisecond)->UseManualTime()->ArgNames({"n", "threads"});
        row->Args({n, 2})->Iterations(quick() || large ? 1 : 3);
      }
});

}  // namespace
}  // namespace piecework::bench
