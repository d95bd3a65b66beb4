// Our analogue of the paper's Fig. 9: one global solve with three right-hand sides, for every
// method, size, number of domains and threads. Each row times itself and CHOLMOD on one thread
// alternately and reports the ratio itself. Validation: the solution against CHOLMOD's.

#include <atomic>
#include <cmath>
#include <functional>
#include <iostream>  // Eigen/MetisSupport uses it without including it
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>
#include <fmt/format.h>
#include <Eigen/MetisSupport>
#include <Eigen/SparseCholesky>

#include <piecework/core/parallel.hpp>
#include <piecework/decomposition/decomposition.hpp>
#include <piecework/global/cholmod_solver.hpp>
#include <piecework/global/eigen_views.hpp>
#include <piecework/global/primal_dual.hpp>
#include <piecework/global/tree_solver.hpp>
#include <piecework/mesh/generate.hpp>
#include <piecework/model/assembly.hpp>
#include <piecework/testing/small_cloths.hpp>

#include "bench.hpp"
#include "interleaved.hpp"
#include "predict.hpp"

namespace piecework::bench {
namespace {

using Counters = benchmark::UserCounters;

constexpr double kH = 1.0 / 120.0;

/// The jittered sheet of unit size: 0.5 kg/m^2, 2e4 N/m and, unless stretch only, 2e-2 N m.
struct Problem {
  model::ClothModel model;
  SparseMatrix K;
  Positions b;
  Positions solution;  ///< CHOLMOD's
  global::CholmodSolver cholmod;
  global::RightHandSides columns;  ///< what CHOLMOD overwrites

  Problem(std::int64_t vertices, bool bending)
      : model(testing::cloth_model(
            mesh::generate(mesh::GeneratorKind::Sheet, {.columns = side_of(vertices),
                                                        .rows = side_of(vertices),
                                                        .pattern = mesh::SheetPattern::Delaunay})
                .mesh,
            {0.5, 2e4, bending ? std::optional(2e-2) : std::nullopt})),
        K(model::assemble_system(model, kH)),
        b(K * testing::random_positions(static_cast<int>(K.rows()), 1, 1)) {
    if (cholmod.factor(K) != global::SolveStatus::Ok) throw std::runtime_error("CHOLMOD failed");
    solve_with_cholmod();
    solution = columns;
  }

  void solve_with_cholmod() {
    columns = b;
    if (cholmod.solve(columns) != global::SolveStatus::Ok)
      throw std::runtime_error("CHOLMOD failed");
  }

  [[nodiscard]] double energy_norm(const Positions& e) const {
    return std::sqrt((e.transpose() * (K * e)).trace());
  }
};

/// The problem of a row; only the newest is kept, so rows of one size should follow each other.
Problem& problem(std::int64_t vertices, bool bending) {
  static std::unique_ptr<Problem> kept;
  static std::pair<std::int64_t, bool> kept_for{-1, false};
  if (kept_for != std::pair(vertices, bending)) {
    kept.reset();
    kept = std::make_unique<Problem>(vertices, bending);
    kept_for = {vertices, bending};
  }
  return *kept;
}

struct Borders {
  std::vector<int> parent, row_node;
  Borders(const model::ClothModel& model, int domains) {
    const auto parts = decomposition::decompose(
        {model.triangles, model.hinges, model.hinge_bends, model.num_vertices()},
        {.domains = domains});
    for (const auto& node : parts.nodes) parent.push_back(node.parent);
    row_node = parts.vertex_node;
  }
};

/// One way to solve; made and run inside the row's thread pool.
struct Method {
  std::function<void()> set_up;         ///< everything before the first solve
  std::function<void(Positions&)> run;  ///< what is timed
  std::function<void(Counters&)> count = [](Counters&) {};
  double error_limit = 1e-9;       ///< relative, 2-norm; not positive: nothing to compare
  double contraction_limit = 0;    ///< energy norm, for solvers in 32 bits
  std::function<void()> baseline;  ///< default: CHOLMOD's solve
};

struct Row {
  std::int64_t vertices;
  int domains;
  int threads;
  bool bending;
};

void count_tree(const global::TreeSolver& solver, Counters& counters) {
  const global::TreeReport& report = solver.report();
  counters["nnz"] = report.nonzeros;
  counters["stored"] = report.stored_numbers;
  counters["bytes"] = static_cast<double>(report.bytes);
  counters["read_bytes"] = report.read_bytes;
  counters["analyze_ms"] = report.analyze_ms;
  counters["factor_ms"] = report.factor_ms;
  counters["substituted"] = report.substituted_panels;
  if (report.contraction > 0) counters["contraction"] = report.contraction;
}

global::TreeSolver make_tree(const Problem& p, const Row& row, const global::TreeOptions& options) {
  global::TreeSolver solver(options);
  if (row.domains > 1) {
    const Borders borders(p.model, row.domains);
    const global::DomainTree tree{borders.parent, borders.row_node};
    solver.analyze(global::pattern_of(p.K), &tree);
  } else {
    solver.analyze(global::pattern_of(p.K));
  }
  if (solver.factor(global::values_of(p.K)) != global::SolveStatus::Ok)
    throw std::runtime_error("not positive definite");
  return solver;
}

constexpr global::TreeOptions kSingle{.precision = global::Precision::Single,
                                      .contraction_limit = 1};

Method tree(Problem& p, const Row& row, const global::TreeOptions& options) {
  auto solver = std::make_shared<global::TreeSolver>();
  Method method;
  method.set_up = [=, &p] { *solver = make_tree(p, row, options); };
  method.run = [=, &p](Positions& x) {
    if (solver->solve(p.b.data(), x.data(), 3, 3, 1) != global::SolveStatus::Ok)
      throw std::runtime_error("solve failed");
  };
  method.count = [=](Counters& counters) { count_tree(*solver, counters); };
  if (options.precision == global::Precision::Single) {
    method.error_limit = 0;
    method.contraction_limit = 1e-3;
  }
  return method;
}

/// K with three right-hand sides and a second matrix of its pattern with one, together. The
/// baseline is CHOLMOD's solve with K alone.
Method tree_pair(Problem& p, const Row& row, const global::TreeOptions& options) {
  struct State {
    global::TreeSolver K, second;
    Eigen::VectorXd b, x;
  };
  auto state = std::make_shared<State>();
  Method method = tree(p, row, options);
  method.set_up = [=, &p] {
    state->K = make_tree(p, row, options);
    state->second = global::TreeSolver(options);
    state->second.share_analysis(state->K);
    SparseMatrix second = p.K;
    second.diagonal() *= 2;
    if (state->second.factor(global::values_of(second)) != global::SolveStatus::Ok)
      throw std::runtime_error("not positive definite");
    state->b = p.b.col(0);
    state->x = state->b;
  };
  method.run = [=, &p](Positions& x) {
    if (state->K.solve_with(p.b.data(), x.data(), 3, state->second, state->b.data(),
                            state->x.data(), 1, 3, 1) != global::SolveStatus::Ok)
      throw std::runtime_error("solve failed");
  };
  method.count = [=](Counters& counters) { count_tree(state->K, counters); };
  return method;
}

/// Reads the stored factor twice: what a solve could take at best.
Method read_limit(Problem& p, const Row& row, const global::TreeOptions& options) {
  auto solver = std::make_shared<global::TreeSolver>();
  Method method;
  method.set_up = [=, &p] { *solver = make_tree(p, row, options); };
  method.run = [=](Positions&) {
    keep(solver->read_factor());
    keep(solver->read_factor());
  };
  method.count = [=](Counters& counters) { count_tree(*solver, counters); };
  method.error_limit = 0;
  return method;
}

/// A new factorisation on the known pattern; the baseline is CHOLMOD's.
Method refactor(Problem& p, const Row& row, const global::TreeOptions& options) {
  auto solver = std::make_shared<global::TreeSolver>();
  Method method;
  method.set_up = [=, &p] { *solver = make_tree(p, row, options); };
  method.run = [=, &p](Positions&) {
    if (solver->factor(global::values_of(p.K)) != global::SolveStatus::Ok)
      throw std::runtime_error("not positive definite");
  };
  method.count = [=](Counters& counters) {
    count_tree(*solver, counters);
    counters["flops"] = solver->report().flops;
  };
  method.error_limit = 0;
  method.baseline = [&p] {
    if (p.cholmod.refactor(p.K) != global::SolveStatus::Ok)
      throw std::runtime_error("CHOLMOD failed");
  };
  return method;
}

/// The paper's method, with its own domains; the parts of a solve are reported as Fig. 9 stacks
/// them.
Method primal_dual(Problem& p, const Row& row, const global::PrimalDualOptions& options) {
  struct State {
    global::PrimalDual solver;
    global::RightHandSides x;
    std::vector<double> domains_ms, interface_ms, refinements;
  };
  auto state = std::make_shared<State>();
  Method method;
  method.set_up = [=, &p] {
    const auto parts = decomposition::decompose(
        {p.model.triangles, p.model.hinges, p.model.hinge_bends, p.model.num_vertices()},
        {.domains = row.domains});
    const auto shares = model::assemble_domain_systems(
        p.model,
        {parts.num_domains, parts.triangle_domain, parts.hinge_domain, parts.vertex_domains}, kH);
    auto dofs = global::classify_dofs(shares, p.model.num_vertices(), {.corner_fraction = 0});
    if (state->solver.factor(shares, std::move(dofs), options) != global::SolveStatus::Ok)
      throw std::runtime_error("not positive definite");
  };
  method.run = [=, &p](Positions& x) {
    state->x = p.b;
    if (state->solver.solve(state->x) != global::SolveStatus::Ok)
      throw std::runtime_error("solve failed");
    x = state->x;
    const global::PrimalDualTimes& times = state->solver.last_times();
    state->domains_ms.push_back(times.domains_ms);
    state->interface_ms.push_back(times.interface_ms);
    state->refinements.push_back(times.refinements);
  };
  method.count = [=](Counters& counters) {
    const global::PrimalDualReport& report = state->solver.report();
    counters["nnz"] = report.domain_nonzeros + report.interface_nonzeros;
    counters["bytes"] = static_cast<double>(report.domain_bytes + report.interface_bytes);
    counters["analyze_ms"] = report.analyze_ms;
    counters["factor_ms"] = report.factor_ms - report.analyze_ms;
    counters["multipliers"] = report.num_multipliers;
    counters["corners"] = report.num_corners;
    counters["domains_ms"] = median_interval(state->domains_ms).median;
    counters["interface_ms"] = median_interval(state->interface_ms).median;
    counters["refinements"] = median_interval(state->refinements).median;
  };
  return method;
}

Method cholmod(Problem& p) {
  Method method;
  method.set_up = [] {};
  method.run = [&p](Positions& x) {
    p.solve_with_cholmod();
    x = p.columns;
  };
  method.count = [&p](Counters& counters) {
    const global::FactorReport& report = p.cholmod.report();
    counters["nnz"] = report.nonzeros;
    counters["bytes"] = static_cast<double>(report.bytes);
    counters["analyze_ms"] = report.analyze_ms;
    counters["factor_ms"] = report.factor_ms;
  };
  return method;
}

template <class Factor>
Method eigen(Problem& p) {
  auto factor = std::make_shared<Factor>();
  Method method;
  method.set_up = [=, &p] { factor->compute(p.K); };
  method.run = [=, &p](Positions& x) { x = factor->solve(p.b); };
  return method;
}

/// What many write: the 3n x 3n matrix of all coordinates, one right-hand side.
Method naive(Problem& p) {
  struct State {
    global::CholmodSolver solver;
    Eigen::VectorXd b;
  };
  auto state = std::make_shared<State>();
  Method method;
  method.set_up = [=, &p] {
    const int n = static_cast<int>(p.K.rows());
    SparseMatrix K3(3 * n, 3 * n);
    K3.reserve(Eigen::VectorXi::Constant(3 * n, 24));
    for (int c = 0; c < n; ++c)
      for (int d = 0; d < 3; ++d)
        for (SparseMatrix::InnerIterator it(p.K, c); it; ++it)
          K3.insert(3 * static_cast<int>(it.row()) + d, 3 * c + d) = it.value();
    K3.makeCompressed();
    if (state->solver.factor(K3) != global::SolveStatus::Ok)
      throw std::runtime_error("CHOLMOD failed");
  };
  method.run = [=, &p](Positions& x) {
    state->b = Eigen::Map<const Eigen::VectorXd>(p.b.data(), p.b.size());
    if (state->solver.solve(state->b.data(), 1) != global::SolveStatus::Ok)
      throw std::runtime_error("CHOLMOD failed");
    Eigen::Map<Eigen::VectorXd>(x.data(), x.size()) = state->b;
  };
  method.count = [=](Counters& counters) {
    counters["nnz"] = state->solver.report().nonzeros;
    counters["bytes"] = static_cast<double>(state->solver.report().bytes);
  };
  return method;
}

using Maker = Method (*)(Problem&, const Row&);

/// Error of x; false (and the row failed) if it is too large.
bool validate(const Problem& p, const Method& method, const Positions& x, benchmark::State& state) {
  if (method.error_limit <= 0 && method.contraction_limit <= 0) return true;
  const Positions difference = x - p.solution;
  const double error = difference.norm() / p.solution.norm();
  state.counters["error"] = error;
  if (method.error_limit > 0 && !(error <= method.error_limit)) {
    fail(state, fmt::format("error {:.2g}, allowed {:.2g}", error, method.error_limit));
    return false;
  }
  if (method.contraction_limit > 0) {
    const double contraction = p.energy_norm(difference) / p.energy_norm(p.solution);
    state.counters["energy_error"] = contraction;
    if (!(contraction <= method.contraction_limit)) {
      fail(state, fmt::format("energy-norm error {:.2g}, allowed {:.2g}", contraction,
                              method.contraction_limit));
      return false;
    }
  }
  return true;
}

/// Processor over wall time of calls in a row, long enough for the clocks to mean something.
double busy_threads(const std::function<void()>& call) {
  const double cpu = ProcessClock::cpu();
  const double start = ProcessClock::wall();
  while (ProcessClock::wall() - start < 3 * kMinSecondsForCpuTime) call();
  return (ProcessClock::cpu() - cpu) / (ProcessClock::wall() - start);
}

void measure(benchmark::State& state, Maker make, bool bending) {
  const Row row{state.range(0), static_cast<int>(state.range(1)), static_cast<int>(state.range(2)),
                bending};
  if (row.threads > available_threads()) {
    skip(state, fmt::format("{} threads on {} cores", row.threads, available_threads()));
    return;
  }
  Problem& p = problem(row.vertices, bending);
  const Method method = make(p, row);
  const auto baseline = method.baseline ? method.baseline : [&p] { p.solve_with_cholmod(); };
  ThreadPool ours(row.threads);
  ThreadPool one(1);
  Positions x = Positions::Zero(p.b.rows(), 3);
  ours.run([&] {
    method.set_up();
    method.run(x);
  });
  InterleavedTimer timer;
  for (auto _ : state) {
    // In a simulation the factor is read hundreds of times in a row.
    timer.sample_in_a_row([&] { ours.run([&] { method.run(x); }); }, [&] { one.run(baseline); });
    state.SetIterationTime(timer.last_a());
  }
  if (!validate(p, method, x, state)) return;
  timer.write(state.counters);
  state.counters["ratio"] = 1 / timer.ratio_of_medians();
  state.counters["cpu_over_wall"] = busy_threads([&] { ours.run([&] { method.run(x); }); });
  method.count(state.counters);
  if (state.counters.count("read_bytes") > 0 && method.error_limit + method.contraction_limit > 0)
    state.counters["GB_per_s"] = state.counters["read_bytes"] / timer.a_seconds().median / 1e9;
  if (state.counters.count("flops") > 0)
    state.counters["GF_per_s"] = state.counters["flops"] / timer.a_seconds().median / 1e9;
}

void add(const std::string& method, Maker make, const std::vector<std::int64_t>& sizes,
         const std::vector<std::int64_t>& domains, const std::vector<std::int64_t>& threads,
         bool bending = true) {
  const std::string group = bending ? "global" : "global_stretch_only";
  auto* row =
      benchmark::RegisterBenchmark((group + "/" + method).c_str(),
                                   [=](benchmark::State& state) { measure(state, make, bending); });
  row->Unit(benchmark::kMillisecond)->UseManualTime()->ArgNames({"n", "D", "threads"});
  row->Iterations(quick() ? 6 : 21);
  for (const std::int64_t n : sizes)
    for (const std::int64_t d : domains)
      for (const std::int64_t t : threads) row->Args({n, d, t});
}

Method tree_f64(Problem& p, const Row& row) { return tree(p, row, {}); }
Method tree_f32(Problem& p, const Row& row) { return tree(p, row, kSingle); }
Method tree_pair_f32(Problem& p, const Row& row) { return tree_pair(p, row, kSingle); }
Method read_f32(Problem& p, const Row& row) { return read_limit(p, row, kSingle); }
Method read_f64(Problem& p, const Row& row) { return read_limit(p, row, {}); }
Method refactor_f64(Problem& p, const Row& row) { return refactor(p, row, {}); }
Method refactor_f32(Problem& p, const Row& row) {
  global::TreeOptions options = kSingle;
  options.factor_in_single = true;
  options.contraction_limit = 0;
  return refactor(p, row, options);
}

Method primal_dual_ours(Problem& p, const Row& row) {
  return primal_dual(p, row, {.refine_tolerance = std::numeric_limits<double>::infinity()});
}
Method primal_dual_refined(Problem& p, const Row& row) {
  return primal_dual(p, row, {.refine_tolerance = 0, .max_refinements = 1});
}
/// As printed: CHOLMOD in each domain, twice per solve, and on one thread for the interface.
Method primal_dual_literal(Problem& p, const Row& row) {
  return primal_dual(p, row,
                     {.form = global::DomainForm::Literal,
                      .interface = global::InterfaceKind::Sparse,
                      .refine_tolerance = std::numeric_limits<double>::infinity(),
                      .backend = global::reference_backend()});
}

void register_size(std::int64_t n) {
  const std::vector<std::int64_t> all{1, 4, 8, 16, 32, 64, 128};
  const std::vector<std::int64_t> domains = quick() ? std::vector<std::int64_t>{1, 8} : all;
  const std::vector<std::int64_t> threads{1, 2, 4, 8, 16};
  add("cholmod", [](Problem& p, const Row&) { return cholmod(p); }, {n}, {1}, {1});
  if (n <= 60025) {
    add("eigen_llt",
        [](Problem& p, const Row&) {
          return eigen<Eigen::SimplicialLLT<SparseMatrix, Eigen::Lower, Eigen::MetisOrdering<int>>>(
              p);
        },
        {n}, {1}, {1});
    add("eigen_ldlt",
        [](Problem& p, const Row&) {
          return eigen<
              Eigen::SimplicialLDLT<SparseMatrix, Eigen::Lower, Eigen::MetisOrdering<int>>>(p);
        },
        {n}, {1}, {1});
    add("cholmod_3n", [](Problem& p, const Row&) { return naive(p); }, {n}, {1}, {1});
  }
  add("read_limit_f64", read_f64, {n}, {1}, threads);
  add("read_limit_f32", read_f32, {n}, {1}, threads);
  const bool large = n >= 1000000;  // their set-up takes a minute
  const std::vector<std::int64_t> tree_domains = large ? std::vector<std::int64_t>{1, 32} : domains;
  add("tree_f64", tree_f64, {n}, tree_domains, large ? std::vector<std::int64_t>{2} : threads);
  add("tree_f32", tree_f32, {n}, tree_domains, large ? std::vector<std::int64_t>{2} : threads);
  const std::vector<std::int64_t> several(domains.begin() + 1, domains.end());
  if (n < 1000000) {
    add("literal_primal_dual", primal_dual_literal, {n}, several, threads);
    add("primal_dual", primal_dual_ours, {n}, several, threads);
    add("primal_dual_refined", primal_dual_refined, {n}, {8}, {1, 2});
  } else {
    add("literal_primal_dual", primal_dual_literal, {n}, {32}, {2});
    add("primal_dual", primal_dual_ours, {n}, {32}, {2});
  }
  add("tree_pair_f32", tree_pair_f32, {n}, {1}, large ? std::vector<std::int64_t>{2} : threads);
  add("refactor_f64", refactor_f64, {n}, {1}, threads);
  add("refactor_f32", refactor_f32, {n}, {1}, threads);
  add("tree_f64", tree_f64, {n}, {1}, {1, 2}, false);
  add("tree_f32", tree_f32, {n}, {1}, {1, 2}, false);
}

/// Median time until all threads have met in a parallel loop, ms. (Each waits for the others, a
/// millisecond at most: an empty loop is over before a second thread has woken.)
double barrier_ms(ThreadPool& pool) {
  std::vector<double> times;
  const auto meet = [&] {
    std::atomic<int> arrived = 0;
    const double start = ProcessClock::wall();
    parallel_for(
        static_cast<std::size_t>(pool.threads()),
        [&](std::size_t) {
          ++arrived;
          while (arrived < pool.threads() && ProcessClock::wall() - start < 1e-3) {
          }
        },
        1);
    times.push_back(1e3 * (ProcessClock::wall() - start));
  };
  pool.run([&] {
    for (int k = 0; k < 500; ++k) meet();
  });
  return median_interval(std::move(times)).median;
}

/// Median over calls in a row, ms.
double median_ms(ThreadPool& pool, int count, const std::function<void()>& call) {
  std::vector<double> times;
  pool.run(call);
  for (int k = 0; k < count; ++k) {
    const double start = ProcessClock::wall();
    pool.run(call);
    times.push_back(1e3 * (ProcessClock::wall() - start));
  }
  return median_interval(std::move(times)).median;
}

/// Predictions for one size and precision, beside what this machine can measure.
void print_predictions(std::int64_t n, const global::TreeOptions& options) {
  constexpr int kRepeats = 11;
  Problem& p = problem(n, true);
  const int cores = available_threads();
  ThreadPool one(1);
  ThreadPool all(cores);
  global::TreeSolver solver;
  Positions x = p.b;
  const auto solve = [&] { (void)solver.solve(p.b.data(), x.data(), 3, 3, 1); };
  all.run([&] { solver = make_tree(p, {n, 1, cores, true}, options); });
  std::vector<global::TreeSchedule> schedules;
  one.run([&] {
    for (int k = 0; k < kRepeats; ++k) schedules.push_back(solver.profile(p.b.data(), x.data()));
  });
  const global::TreeSchedule schedule = median_schedule(schedules);
  const double cholmod = median_ms(one, kRepeats, [&] { p.solve_with_cholmod(); });
  const double read = median_ms(all, kRepeats, [&] { keep(solver.read_factor()); });
  const double bandwidth = static_cast<double>(solver.report().bytes) / read;
  const double barrier = barrier_ms(all);
  fmt::print(
      "\n**{} vertices, {}-bit factor**: CHOLMOD on 1 thread {:.3g} ms; all {} cores read "
      "the factor at {:.3g} GB/s; a barrier takes {:.2g} us\n\n",
      n, options.precision == global::Precision::Single ? 32 : 64, cholmod, cores, bandwidth / 1e6,
      1e3 * barrier);
  fmt::print(
      "| cores | measured (ms) | predicted, this memory (ms) | ratio | "
      "predicted, memory grows with cores (ms) | ratio |\n"
      "| ---: | ---: | ---: | ---: | ---: | ---: |\n");
  for (int count = 1; count <= 128; count *= 2) {
    std::string measured = "-";
    if (count <= cores) {
      ThreadPool pool(count);
      measured = fmt::format("{:.3g}", median_ms(pool, kRepeats, solve));
    }
    const double here = predicted_ms(schedule, count, {barrier, bandwidth});
    const double free = predicted_ms(schedule, count, {barrier, 0});
    fmt::print("| {} | {} | {:.3g} | {:.3g} | {:.3g} | {:.3g} |\n", count, measured, here,
               cholmod / here, free, cholmod / free);
  }
}

int predict() {
  fmt::print(
      "Predicted times of one global solve with three right-hand sides: a model of the task\n"
      "graph with times of each part measured on one core, not a measurement. `ratio` is\n"
      "CHOLMOD on 1 thread over the prediction.\n");
  for (const std::int64_t n : {19881, 60025, 199809})
    for (const global::TreeOptions& options : {global::TreeOptions{}, kSingle})
      if (!quick() || n == 19881) print_predictions(n, options);
  return 0;
}

const Command predict_command("--predict", "how solves would run on 1 to 128 cores: a model",
                              predict);

const Registration registration([] {
  for (const std::int64_t n : {19881, 60025, 199809, 1000000})
    if (!quick() || n <= 60025) register_size(n);
});

}  // namespace
}  // namespace piecework::bench
