// The vanilla baseline's step: time per L-G iteration split into local and global, beside the same
// on one thread; what it takes to get to the first step; and whole steps of scene A, where public
// simulators were measured too. Validation: both thread counts give the same bits, and the energy
// is finite.

#include <cmath>
#include <cstdint>
#include <fstream>
#include <numeric>
#include <span>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <piecework/baselines/vanilla_pd.hpp>
#include <piecework/core/clock.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/core/statistics.hpp>
#include <piecework/mesh/generate.hpp>
#include <piecework/runner/methods.hpp>
#include <piecework/runner/world.hpp>
#include <piecework/scene/scene_io.hpp>
#include <piecework/testing/small_cloths.hpp>

#include "bench.hpp"
#include "interleaved.hpp"
#include "simulation.hpp"
#include "step_records.hpp"

namespace piecework::bench {
namespace {

constexpr int kIterations = 5;
constexpr double kH = 1.0 / 120.0;

mesh::TriangleMesh sheet(int side) {
  return mesh::generate(mesh::GeneratorKind::Sheet,
                        {.columns = side, .rows = side, .pattern = mesh::SheetPattern::Delaunay})
      .mesh;
}

void step(benchmark::State& state) {
  const int side = side_of(state.range(0));
  const int threads = static_cast<int>(state.range(1));
  if (threads > available_threads()) {
    skip(state, fmt::format("{} threads on {} cores", threads, available_threads()));
    return;
  }
  const mesh::TriangleMesh mesh = sheet(side);
  const model::ClothModel model = testing::cloth_model(mesh, testing::cotton());
  const Positions z = mesh.positions + testing::random_positions(side * side, 0.1 / side, 1);
  const std::vector<char> fixed(static_cast<std::size_t>(side) * static_cast<std::size_t>(side), 0);
  baselines::VanillaPd solver(model, kH, 9.81,
                              {model::StopRule::Iterations, 0, kIterations, kIterations});
  solver.prepare(fixed);

  model::StepReport report;
  double local_ms = 0;
  double global_ms = 0;
  const auto run = [&](int count, Positions& x) {
    ThreadPool(count).run([&] {
      x = z;
      report = solver.minimize({&z, &fixed, &z}, x);
    });
  };
  Positions ours;
  Positions one_thread;
  run(threads, ours);
  InterleavedTimer timer;
  for (auto _ : state) {
    timer.sample(
        [&] {
          run(threads, ours);
          local_ms += report.phases.local;
          global_ms += report.phases.global;
        },
        [&] { run(1, one_thread); });
    state.SetIterationTime(timer.last_a() / kIterations);
  }
  if (ours != one_thread || !std::isfinite(report.energy)) {
    fail(state, "the thread counts disagree");
    return;
  }
  timer.write(state.counters);
  const auto solves = static_cast<double>(state.iterations()) * kIterations;
  state.counters["local_ms"] = local_ms / solves;
  state.counters["global_ms"] = global_ms / solves;
  state.counters["gradient"] = report.gradient;
  state.counters["nnz"] = solver.setup_report().factor_nonzeros;
  state.counters["factor_bytes"] = solver.setup_report().factor_bytes;
}

/// Largest resident memory of this process so far, MB.
double peak_megabytes() {
  std::ifstream file("/proc/self/status");
  for (std::string line; std::getline(file, line);)
    if (line.starts_with("VmHWM:")) return std::stod(line.substr(6)) / 1024;
  return -1;
}

/// From a scene to the end of its first L-G iteration.
void startup(benchmark::State& state) {
  scene::Scene scene;
  scene.solver.domains = 32;
  scene.quality.stop = "iterations";
  scene.quality.max_iterations = 1;
  scene.materials["cotton"] = {.stretching = 261, .bending = 7e-6};
  scene::Cloth cloth{.material = "cotton"};
  cloth.mesh.generator = "sheet";
  cloth.mesh.pattern = "delaunay";
  cloth.mesh.columns = cloth.mesh.rows = side_of(state.range(0));
  cloth.pins = {{.region = {.vertices = {0, cloth.mesh.columns - 1}}}};
  scene.cloths = {cloth};
  for (auto _ : state) {
    const auto world = runner::build_world(scene);
    Stopwatch watch;
    const auto integrator = runner::make_integrator(*world);
    model::State motion = integrator->initial_state(world->part_velocity);
    integrator->prepare(motion);
    state.counters["factor_ms"] = watch.elapsed_ms();
    const model::StepReport report = integrator->step(motion);
    state.counters["load_ms"] = world->load_ms;
    state.counters["partition_ms"] = world->partition_ms;
    state.counters["gradient"] = report.gradient;
  }
  state.counters["peak_mb"] = peak_megabytes();
}

/// Public simulators on scene A: processor ms per step on one thread of another machine of this
/// kind. Stark 16197f7 ends a step when no vertex moves faster than kStillSpeed between Newton
/// iterates, C-IPC (Codim-IPC 9c6cbe3) when their root mean square does not.
struct Peers {
  std::int64_t vertices;
  double c_ipc_ms, stark_ms;
};
constexpr Peers kPeers[] = {
    {2500, 552, 70}, {10000, 2703, 321}, {19881, 5418, 800}, {60025, 22200, 5390}};
constexpr double kStillSpeed = 1e-3;     ///< m/s
constexpr std::size_t kFirstSteps = 12;  ///< the dearest rows of the peers are no longer

/// Scene A from its beginning to Stark's tolerance, on one thread.
void hanging(benchmark::State& state, const Peers& peers) {
  scene::Scene scene = scene::load_scene("hanging_tablecloth");
  scene::Mesh& mesh = scene.cloths.front().mesh;
  mesh.columns = mesh.rows = side_of(peers.vertices);
  scene.quality.stop = "dx_inf";
  scene.quality.tolerance = kStillSpeed * scene.step.h;  // the unit box is a metre
  const int steps = quick() ? static_cast<int>(kFirstSteps) : scene.step.steps;
  std::vector<double> cpu_ms;
  double iterations = 0, converged = 0, energy = 0;
  for (auto _ : state)
    ThreadPool(1).run([&] {
      const Simulation simulation(scene);
      model::State motion = simulation.start();
      const Stopwatch watch;
      for (int k = 0; k < steps; ++k) {
        const StepRecord record = take_step(*simulation.integrator, motion);
        cpu_ms.push_back(record.cpu_ms);
        iterations += record.report.iterations;
        converged += record.report.converged ? 1 : 0;
        energy = record.report.energy;
      }
      state.SetIterationTime(1e-3 * watch.elapsed_ms());
    });
  if (!std::isfinite(energy)) return fail(state, "not finite");
  const std::span<const double> first(cpu_ms.data(), kFirstSteps);
  const double ours = median_interval({first.begin(), first.end()}).median;
  state.counters["first_cpu_ms"] = ours;
  state.counters["mean_cpu_ms"] = std::accumulate(cpu_ms.begin(), cpu_ms.end(), 0.0) / steps;
  state.counters["mean_iterations"] = iterations / steps;
  state.counters["converged"] = converged / steps;
  state.counters["quoted_stark_ms"] = peers.stark_ms;
  state.counters["quoted_c_ipc_ms"] = peers.c_ipc_ms;
  state.counters["stark_over_ours"] = peers.stark_ms / ours;
  state.counters["c_ipc_over_ours"] = peers.c_ipc_ms / ours;
}

const Registration registration([] {
  auto* start = benchmark::RegisterBenchmark("startup", startup);
  start->Unit(benchmark::kSecond)->UseRealTime()->Iterations(1)->ArgName("n");
  for (const std::int64_t n : {19881, 199809})
    if (!quick() || n == 19881) start->Arg(n);
  auto* steps = benchmark::RegisterBenchmark("step/vanilla_pd", step);
  steps->Unit(benchmark::kMillisecond)->UseManualTime()->ArgNames({"n", "threads"});
  for (const std::int64_t n : {19881, 60025, 199809})
    for (const std::int64_t threads : {1, 2, 4})
      if (!quick() || n == 19881) steps->Args({n, threads})->Iterations(quick() ? 6 : 10);
  for (const Peers& peers : kPeers)
    if (!quick() || peers.vertices == 2500)
      benchmark::RegisterBenchmark(fmt::format("hanging/n:{}/threads:1", peers.vertices).c_str(),
                                   hanging, peers)
          ->Unit(benchmark::kSecond)
          ->UseManualTime()
          ->Iterations(1);
});

}  // namespace
}  // namespace piecework::bench
