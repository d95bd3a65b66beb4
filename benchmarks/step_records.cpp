#include "step_records.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include <piecework/core/statistics.hpp>

#include "interleaved.hpp"
#include "power_law.hpp"

namespace piecework::bench {
namespace {

constexpr double kSpreadForGrowth = 3;  ///< most over fewest pairs that show how time grows

using Quantity = std::function<double(const StepRecord&)>;

std::vector<double> values(const std::vector<StepRecord>& records, const Quantity& quantity) {
  std::vector<double> result;
  for (const StepRecord& record : records) result.push_back(quantity(record));
  return result;
}

double total(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

double largest(const std::vector<double>& values) {
  return *std::max_element(values.begin(), values.end());
}

/// Infinity if none is.
double least_positive(const std::vector<double>& values) {
  double least = std::numeric_limits<double>::infinity();
  for (const double value : values)
    if (value > 0) least = std::min(least, value);
  return least;
}

double median(std::vector<double> values) { return median_interval(std::move(values)).median; }

double mean(const std::vector<double>& values) {
  return total(values) / static_cast<double>(values.size());
}

/// A phase that did not run took no time.
double ran(double ms) { return std::max(0.0, ms); }

double cull(const StepRecord& r) { return ran(r.report.phases.cull); }
double narrow(const StepRecord& r) { return ran(r.report.phases.narrow); }
double check(const StepRecord& r) { return ran(r.report.phases.check); }
double step_ms(const StepRecord& r) { return r.report.step_ms; }
double cpu_ms(const StepRecord& r) { return r.cpu_ms; }
double iterations(const StepRecord& r) { return r.report.iterations; }
double pairs(const StepRecord& r) { return r.contact().pairs; }

std::string number(double value) {
  return std::isfinite(value) ? fmt::format("{:.5g}", value) : "null";
}

std::string point(const StepRecord& r) {
  return fmt::format("[{}, {}, {}, {}, {}, {}, {}, {}]", r.step, number(step_ms(r)),
                     number(cpu_ms(r)), number(cull(r)), number(narrow(r)), r.report.iterations,
                     r.contact().pairs, number(r.true_error));
}

}  // namespace

StepRecord take_step(model::Integrator& integrator, model::State& state) {
  StepRecord record;
  const double before = ProcessClock::cpu();
  record.report = integrator.step(state);
  record.cpu_ms = 1e3 * (ProcessClock::cpu() - before);
  record.step = state.step;
  return record;
}

double distance_from_exact(model::Integrator& exact, model::State before, const Positions& x,
                           double unit) {
  if (!exact.step(before).converged) return std::numeric_limits<double>::quiet_NaN();
  return (before.x - x).rowwise().norm().maxCoeff() / unit;
}

std::map<std::string, double> summary(const std::vector<StepRecord>& records) {
  std::map<std::string, double> result;
  const auto of = [&](const Quantity& quantity) { return values(records, quantity); };
  const std::vector<double> wall = of(step_ms), cpu = of(cpu_ms), its = of(iterations),
                            touching = of(pairs);
  const double time = total(wall);
  result["steps"] = static_cast<double>(records.size());
  result["step_ms"] = median(wall);
  result["step_ms_mean"] = mean(wall);
  // Of processor times: other work on the machine does not make a step slow.
  result["max_over_median"] = largest(cpu) / median(cpu);
  result["cpu_ms"] = median(cpu);
  result["cpu_ms_mean"] = mean(cpu);
  result["iterations"] = median(its);
  result["iterations_mean"] = mean(its);
  result["iterations_max"] = largest(its);
  result["solves"] = mean(of([](const StepRecord& r) { return r.report.global_solves; }));
  result["cull_share"] = total(of(cull)) / time;
  result["narrow_share"] = total(of(narrow)) / time;
  result["check_share"] = total(of(check)) / time;
  result["pairs"] = median(touching);
  result["pairs_max"] = largest(touching);
  result["converged"] = mean(of([](const StepRecord& r) { return r.report.converged ? 1 : 0; }));
  result["interpenetrations"] =
      total(of([](const StepRecord& r) { return r.contact().interpenetrations; }));
  if (largest(touching) >= kSpreadForGrowth * least_positive(touching)) {
    result["growth_by_pairs"] = power_exponent(touching, wall);
    result["iteration_growth_by_pairs"] = power_exponent(
        touching, of([](const StepRecord& r) { return step_ms(r) / iterations(r); }));
  }
  std::vector<double> errors = of([](const StepRecord& r) { return r.true_error; });
  std::erase_if(errors, [](double error) { return std::isnan(error); });
  if (errors.empty()) return result;
  result["true_errors"] = static_cast<double>(errors.size());
  result["true_error"] = median(errors);
  result["true_error_max"] = largest(errors);
  return result;
}

std::string defect(const std::vector<StepRecord>& records) {
  int passed = 0, most = 0;
  for (const StepRecord& record : records) {
    passed += record.contact().interpenetrations;
    most = std::max(most, record.contact().pairs);
  }
  if (passed > 0) return fmt::format("{} interpenetrations", passed);
  return most == 0 ? "nothing touched" : "";
}

std::string records_json(const std::vector<RecordedRun>& runs) {
  std::string text =
      "{\"schema\": \"piecework.step_records/1\", \"columns\": [\"step\", \"step_ms\", \"cpu_ms\", "
      "\"cull_ms\", \"narrow_ms\", \"iterations\", \"pairs\", \"true_error\"], \"runs\": [";
  for (const RecordedRun& run : runs) {
    std::string points;
    for (const StepRecord& record : run.records)
      points += (points.empty() ? "" : ", ") + point(record);
    text += fmt::format(
        R"({}{{"family": "{}", "scene": "{}", "n": {}, "tolerance": "{}", "threads": {}, "points": [{}]}})",
        &run == runs.data() ? "\n" : ",\n", run.family, run.scene, run.n, run.tolerance,
        run.threads, points);
  }
  return text + "]}\n";
}

}  // namespace piecework::bench
