#include <piecework/runner/tune.hpp>

#include <algorithm>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include <piecework/core/clock.hpp>
#include <piecework/core/error.hpp>
#include <piecework/local/jacobi.hpp>
#include <piecework/model/assembly.hpp>
#include <piecework/model/reduction.hpp>
#include <piecework/runner/methods.hpp>
#include <piecework/runner/start.hpp>

namespace piecework::runner {
namespace {

/// K~ dx = -T_f^T grad E, N, on the unknowns of the first step.
struct FirstSolve {
  SparseMatrix K;
  std::vector<int> vertices;  ///< per unknown
  global::RightHandSides b;
};

/// Takes the first iteration's system from a step, and takes no step.
class Capture final : public model::Minimizer {
 public:
  Capture(const World& world, FirstSolve& system) : world_(world), system_(system) {}

  void prepare(const std::vector<char>&) override {}
  [[nodiscard]] model::SetupReport setup_report() const override { return {}; }
  [[nodiscard]] std::string description() const override { return "capture"; }

  model::StepReport minimize(const model::StepProblem& problem, Positions& x) override {
    const double h = world_.scene.step.h;
    Positions gradient;
    local::JacobiStep(world_.model, h).evaluate(x, problem, gradient);
    const model::Reduction reduction(world_.model, *problem.fixed);
    system_.K = reduction.system(model::assemble_system(world_.model, h));
    system_.vertices = reduction.vertices();
    system_.b.resize(reduction.count(), 3);
    for (int i = 0; i < reduction.count(); ++i) system_.b.row(i) = -reduction.row(gradient, i);
    return {};
  }

 private:
  const World& world_;
  FirstSolve& system_;
};

FirstSolve first_solve(const World& world) {
  FirstSolve system;
  model::Integrator integrator(world.model, world.forces, world.pins,
                               {.h = world.scene.step.h, .damping = world.scene.damping},
                               std::make_unique<Capture>(world, system));
  model::State state = start_state(world, integrator);
  integrator.step(state);
  if (system.vertices.empty())
    throw InputError(
        fmt::format("{}: /cloths: every vertex is held in the first step; there is no "
                    "global solve to measure",
                    world.scene.source));
  return system;
}

/// Sets domains and solver of a world for a while.
class WorldGuard {
 public:
  explicit WorldGuard(World& world)
      : world_(world), solver_(world.scene.solver), domains_(world.domains) {}
  ~WorldGuard() {
    world_.scene.solver = std::move(solver_);
    world_.domains = std::move(domains_);
  }
  WorldGuard(const WorldGuard&) = delete;
  WorldGuard& operator=(const WorldGuard&) = delete;

 private:
  World& world_;
  scene::Solver solver_;
  decomposition::Decomposition domains_;
};

/// The factored solver of a setting.
std::unique_ptr<global::ExactSolver> make_solver(World& world, const FirstSolve& system,
                                                 const DomainSetting& setting,
                                                 const std::string& global) {
  world.scene = with_setting(std::move(world.scene), setting);
  world.scene.solver.global = global;
  world.domains = decomposition::decompose(
      world.elements(), {.domains = setting.domains, .domain_weights = setting.weights});
  auto solver = make_exact_solver(world);
  const global::SolveStatus status = solver->factor(system.K, system.vertices);
  if (status == global::SolveStatus::Ok) return solver;
  throw SimulationError(fmt::format("{} domains, \"{}\": {}", setting.domains, global,
                                    status == global::SolveStatus::OutOfMemory
                                        ? "the factor does not fit into memory"
                                        : "the system matrix is not positive definite"));
}

/// Milliseconds of one solve, the mean of kTuneSolves.
double time_solve(global::ExactSolver& solver, const FirstSolve& system,
                  global::RightHandSides& x) {
  double sum = 0;
  for (int i = 0; i < kTuneSolves; ++i) {
    x = system.b;
    const Stopwatch watch;
    const global::SolveStatus status = solver.solve(x);
    sum += watch.elapsed_ms();
    if (status != global::SolveStatus::Ok)
      throw SimulationError("the global solve failed (out of memory)");
  }
  return sum / kTuneSolves;
}

/// A candidate against the present setting, in turns whose order alternates.
/// \param[in,out] present_ms  samples of the present setting, of all candidates
Timing compare(global::ExactSolver& present, global::ExactSolver& candidate,
               const FirstSolve& system, std::vector<double>& present_ms) {
  global::RightHandSides x;
  (void)time_solve(present, system, x);  // warms up
  (void)time_solve(candidate, system, x);
  std::vector<double> ms;
  std::vector<double> ratios;
  for (int pair = 0; pair < kTunePairs; ++pair) {
    const bool candidate_first = pair % 2 == 1;
    double own = candidate_first ? time_solve(candidate, system, x) : 0;
    present_ms.push_back(time_solve(present, system, x));
    if (!candidate_first) own = time_solve(candidate, system, x);
    ms.push_back(own);
    ratios.push_back(own / present_ms.back());
  }
  return {median_interval(ms), median_interval(ratios)};
}

/// Adds a solver's column to all rows.
void measure_column(World& world, const FirstSolve& system, const std::string& global,
                    std::vector<CandidateRow>& rows) {
  CandidateRow& first = rows.front();
  const auto present = make_solver(world, system, first.setting, global);
  std::vector<double> present_ms;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    CandidateRow& row = rows[i];
    try {
      const auto solver = make_solver(world, system, row.setting, global);
      row.timings.push_back(compare(*present, *solver, system, present_ms));
    } catch (const InputError& error) {  // an interface that is too large
      row.refusal = error.what();
      row.timings.push_back({});
    }
  }
  if (present_ms.empty()) {
    global::RightHandSides x;
    (void)time_solve(*present, system, x);
    for (int i = 0; i < kTunePairs; ++i) present_ms.push_back(time_solve(*present, system, x));
  }
  first.timings.push_back({median_interval(present_ms),
                           {.median = 1, .low = 1, .high = 1, .count = present_ms.size()}});
}

}  // namespace

Measurements measure_settings(World& world, const std::vector<DomainSetting>& candidates) {
  Measurements result;
  const DomainSetting present = present_setting(world.scene);
  result.rows.push_back({.setting = present, .timings = {}, .refusal = {}});
  for (const DomainSetting& candidate : candidates)
    if (candidate != present)
      result.rows.push_back({.setting = candidate, .timings = {}, .refusal = {}});
  result.solvers = {"tree"};
  if (world.scene.solver.global == "primal_dual") result.solvers.emplace_back("primal_dual");
  const FirstSolve system = first_solve(world);
  const WorldGuard guard(world);
  for (const std::string& solver : result.solvers)
    measure_column(world, system, solver, result.rows);
  return result;
}

}  // namespace piecework::runner
