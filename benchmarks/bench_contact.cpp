// Solvers of the contact system (K + D) x = b, our analogue of the paper's Fig. 8: time, iterations
// and factor solves until the largest error of x, against CHOLMOD's solution, is 1e-3 of the
// largest |x|. The number of iterations is found in a run that looks at the error; then a run of so
// many is timed, from the change of D on, in turns with K^-1-CG on the same system.
//
// contact/SOLVER/n:N/ratio:R/threads:T[/set:SET]; a quarter of the vertices in contact, on a disk
// unless SET says so; R = w_k / k_s. pcg_last_factor_P: the factor is of a set of which P % differ.
// crossover/SOLVER/changed:M/...: M contacts of the disk have changed since the last factor.
// --traces=FILE: residual and error after each iteration, as JSON.

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/clock.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/core/statistics.hpp>
#include <piecework/global/diagonal_update.hpp>

#include "bench.hpp"
#include "contact_problem.hpp"
#include "interleaved.hpp"

namespace piecework::bench {
namespace {

using global::DiagonalMethod;
using global::DiagonalOptions;
using global::DiagonalReport;
using global::DiagonalUpdateSolver;
using testing::ContactSet;

constexpr double kError = 1e-3;       ///< where a timed run ends
constexpr double kTraceError = 1e-8;  ///< where a trace ends
constexpr int kMostIterations = 5000;

const Option traces_option("--traces", "file for residual and error of each iteration, as JSON");

struct Solver {
  const char* name;
  DiagonalMethod method;
  DiagonalOptions options = {};
  double changed = 0;  ///< part of the contacts in which the factored set differs; 0: no set
};

constexpr DiagonalOptions kDouble{.precision = global::Precision::Double};
constexpr DiagonalOptions kFiveSteps{.steps = 5, .recompute = true};

constexpr Solver kSolvers[] = {
    {"refactor", DiagonalMethod::Refactor},
    {"refactor_f64", DiagonalMethod::Refactor, kDouble},
    {"pcg_last_factor_2", DiagonalMethod::LastFactor, {}, 0.02},
    {"pcg_last_factor_10", DiagonalMethod::LastFactor, {}, 0.1},
    {"pcg_last_factor_30", DiagonalMethod::LastFactor, {}, 0.3},
    {"frozen_schur", DiagonalMethod::FrozenSchur},
    {"hybrid", DiagonalMethod::Hybrid},
    {"dual", DiagonalMethod::Dual},
    {"woodbury_sd_pcg", DiagonalMethod::SteepestDescent},
    {"woodbury_sd5_pcg", DiagonalMethod::SteepestDescent, kFiveSteps},
    {"kinv_pcg", DiagonalMethod::InverseK},
    {"jacobi_pcg", DiagonalMethod::Jacobi},
};
constexpr Solver kCrossover[] = {{"refactor", DiagonalMethod::Refactor},
                                 {"pcg_last_factor", DiagonalMethod::LastFactor},
                                 {"low_rank", DiagonalMethod::LowRank, {.max_rank = 40}}};

struct Row {
  std::int64_t vertices;
  double ratio;
  int threads;
  ContactSet set;
  std::optional<int> changed;  ///< contacts since the last factor; otherwise Solver::changed says
};

ContactSheet& sheet_of(std::int64_t vertices) {
  static std::pair<std::int64_t, std::unique_ptr<ContactSheet>> kept;
  if (kept.first != vertices) kept = {vertices, std::make_unique<ContactSheet>(vertices)};
  return *kept.second;
}

/// The problem of a row; only the newest is kept, so rows of one problem should follow each other.
ContactProblem& problem_of(const Row& row) {
  using Key = std::tuple<std::int64_t, double, ContactSet>;
  static std::pair<Key, std::unique_ptr<ContactProblem>> kept;
  const Key key{row.vertices, row.ratio, row.set};
  if (!kept.second || kept.first != key)
    kept = {key, std::make_unique<ContactProblem>(sheet_of(row.vertices), row.set, row.ratio)};
  return *kept.second;
}

void require(global::SolveStatus status) {
  if (status != global::SolveStatus::Ok) throw std::runtime_error("no factor");
}

/// A solver with what it knows before a solve is timed: K, or the factor of an earlier D.
class Contender {
 public:
  Contender(const Solver& solver, const Row& row)
      : problem_(problem_of(row)), before_(problem_.D.size(), 0.0) {
    ContactSheet& sheet = sheet_of(row.vertices);
    DiagonalOptions options = solver.options;
    options.elastic_weight = sheet.stretching;
    solver_ = global::make_diagonal_solver(solver.method, options);
    require(solver_->prepare(sheet.K, sheet.tree));
    const auto contacts = std::count_if(problem_.D.begin(), problem_.D.end(),
                                        [](double weight) { return weight > 0; });
    const int changed = row.changed.value_or(
        static_cast<int>(std::lround(solver.changed * static_cast<double>(contacts))));
    if (changed > 0) before_ = changed_contacts(problem_.D, changed);
  }

  /// The state before a timed run. (A factor that a method keeps stays with it.)
  void reset() { require(solver_->update(before_)); }

  /// D changes and x is found from x = 0.
  DiagonalReport run(const global::DiagonalLimits& limits) {
    x_.setZero(problem_.b.rows(), 3);
    Stopwatch watch;
    require(solver_->update(problem_.D));
    update_ms_ = watch.lap();
    const DiagonalReport report = solver_->solve(problem_.b, x_, limits);
    solve_ms_ = watch.lap();
    return report;
  }

  [[nodiscard]] const Positions& x() const { return x_; }
  [[nodiscard]] double error() const { return problem_.error(x_); }
  [[nodiscard]] double update_ms() const { return update_ms_; }
  [[nodiscard]] double solve_ms() const { return solve_ms_; }

 private:
  ContactProblem& problem_;
  std::vector<double> before_;
  std::unique_ptr<DiagonalUpdateSolver> solver_;
  Positions x_;
  double update_ms_ = 0, solve_ms_ = 0;
};

struct Point {
  int iteration;
  double ms, residual, error;
};

struct Course {
  std::vector<Point> points;
  int iterations = -1;  ///< until kError; -1: not reached
};

/// One run in which every iterate is looked at. The clock stands still meanwhile.
Course follow(Contender& contender, const Row& row, double error) {
  const ContactProblem& problem = problem_of(row);
  const SparseMatrix& K = sheet_of(row.vertices).K;
  const Eigen::Map<const Eigen::VectorXd> D(problem.D.data(), problem.b.rows());
  Course course;
  Stopwatch watch;
  double passed = 0;
  const auto observe = [&](int iteration, const Positions& x) {
    passed += watch.lap();
    const Positions r = problem.b - K * x - D.asDiagonal() * x;
    course.points.push_back({iteration, passed, r.norm() / problem.b.norm(), problem.error(x)});
    if (course.iterations < 0 && course.points.back().error <= kError)
      course.iterations = iteration;
    watch.lap();
    return course.points.back().error > error;
  };
  contender.reset();
  watch.lap();
  (void)contender.run({.tolerance = 1e-15, .max_iterations = kMostIterations, .observer = observe});
  return course;
}

std::string number(double value) {
  return std::isfinite(value) ? fmt::format("{:.5g}", value) : "null";
}

/// Adds a trace to the file of --traces, which is whole after every row.
void keep_trace(const Solver& solver, const Row& row, const Course& course) {
  static std::string all;
  std::string points;
  for (const Point& p : course.points)
    points += fmt::format("{}[{}, {}, {}, {}]", points.empty() ? "" : ", ", p.iteration,
                          number(p.ms), number(p.residual), number(p.error));
  all += fmt::format(
      R"({}{{"solver": "{}", "set": "{}", "n": {}, "ratio": {}, "threads": {}, "points": [{}]}})",
      all.empty() ? "\n" : ",\n", solver.name, testing::to_string(row.set), row.vertices, row.ratio,
      row.threads, points);
  write_file_atomically(
      traces_option.value(),
      fmt::format("{{\"schema\": \"piecework.contact_traces/1\", \"columns\": [\"iteration\", "
                  "\"ms\", \"residual\", \"true_error\"], \"traces\": [{}]}}\n",
                  all));
}

double median(std::vector<double> values) { return median_interval(std::move(values)).median; }

/// Times runs of `iterations` in turns with runs of the baseline.
void time(benchmark::State& state, Contender& ours, int iterations, Contender& base,
          int base_iterations) {
  InterleavedTimer timer;
  std::vector<double> update_ms;
  std::vector<double> solve_ms;
  DiagonalReport report;
  for (auto _ : state) {
    ours.reset();
    base.reset();
    timer.sample([&] { report = ours.run({.tolerance = 1e-15, .max_iterations = iterations}); },
                 [&] { (void)base.run({.tolerance = 1e-15, .max_iterations = base_iterations}); });
    update_ms.push_back(ours.update_ms());
    solve_ms.push_back(ours.solve_ms());
    state.SetIterationTime(timer.last_a());
  }
  timer.write(state.counters);
  state.counters["ratio"] = 1 / timer.ratio_of_medians();
  state.counters["time_ms"] = 1e3 * timer.a_seconds().median;
  state.counters["update_ms"] = median(update_ms);
  state.counters["solve_ms"] = median(solve_ms);
  state.counters["iterations"] = report.iterations;
  state.counters["applications"] = report.applications;
  state.counters["refactored_rows"] = report.refactored_rows;
  state.counters["residual"] = report.residual;
  state.counters["true_error"] = ours.error();
}

void measure(benchmark::State& state, const Solver& solver, const Row& row) {
  if (row.threads > available_threads()) {
    skip(state, fmt::format("{} threads on {} cores", row.threads, available_threads()));
    return;
  }
  ThreadPool pool(row.threads);
  pool.run([&] {
    Contender ours(solver, row);
    Contender base({"", DiagonalMethod::InverseK}, row);
    const bool trace = !traces_option.value().empty() && !row.changed;
    const Course course = follow(ours, row, trace ? kTraceError : kError);
    const Course base_course = follow(base, row, kError);
    if (course.iterations < 0 || base_course.iterations < 0) {
      fail(state, fmt::format("an error of {:.2g} is left after {} iterations",
                              course.points.back().error, course.points.back().iteration));
      return;
    }
    if (trace) keep_trace(solver, row, course);
    time(state, ours, course.iterations, base, base_course.iterations);
    if (!(ours.error() <= 1.01 * kError))
      fail(state, fmt::format("true error {:.2g}, allowed {:.2g}", ours.error(), kError));
  });
}

void add(const std::string& name, const Solver& solver, const Row& row) {
  benchmark::RegisterBenchmark(name.c_str(),
                               [=](benchmark::State& state) { measure(state, solver, row); })
      ->Unit(benchmark::kMillisecond)
      ->UseManualTime()
      ->Iterations(quick()                ? 2
                   : row.vertices < 30000 ? 9
                                          : 6);
}

void add_sets(std::int64_t n) {
  for (const double ratio : {50.0, 1e3, 1e4})
    for (const ContactSet set : testing::kContactSets)
      for (const int threads : {1, 2}) {
        const bool disk = set == ContactSet::Disk;
        if (threads == 1 && (!disk || ratio != 1e3)) continue;
        if (quick() && ratio != 50) continue;
        if (n > 60025 && (ratio != 1e3 || threads == 1)) continue;  // minutes each
        for (const Solver& solver : kSolvers)
          add(fmt::format("contact/{}/n:{}/ratio:{}/threads:{}{}", solver.name, n, ratio, threads,
                          disk ? "" : fmt::format("/set:{}", testing::to_string(set))),
              solver, {n, ratio, threads, set, {}});
      }
}

void add_crossover(std::int64_t n) {
  for (const double ratio : {50.0, 1e3})
    for (const int changed : {1, 4, 12, 40, 120, 400, 1200})
      for (const Solver& solver : kCrossover)
        if (solver.method != DiagonalMethod::LowRank || changed <= solver.options.max_rank)
          add(fmt::format("crossover/{}/changed:{}/n:{}/ratio:{}/threads:2", solver.name, changed,
                          n, ratio),
              solver, {n, ratio, 2, ContactSet::Disk, changed});
}

const Registration registration([] {
  for (const std::int64_t n : {3721, 19881, 60025, 90000, 199809}) {  // 90000: Fig. 8's
    if (quick() && n > 3721) break;
    add_sets(n);
    if ((n != 3721 && n != 90000) || quick()) add_crossover(n);
  }
});

}  // namespace
}  // namespace piecework::bench
