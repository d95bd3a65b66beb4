// Whole steps with contact: our analogues of the paper's Figs. 11 and 14, and what a step costs.
//
//   contact_steps/drape/n:N/tolerance:T/threads:P  scene B, beside public simulators on one thread
//   contact_steps/active/scene:S/threads:P         shipped scenes: step time against active pairs
//   contact_steps/friction/solid:S/mu:M            a sheet on a slope against Coulomb's law
//   contact_steps/weight/state:S/support:B/ratio:R/tolerance:T
//                     iterations against the stiffness of contact, R times the default one, beside
//                     those of the same steps without what touches
//   contact_steps/detection/n:N                    detection in the first steps of scene B
//
// A row is one simulation; its time is that of its steps. Validation: nothing passes through
// anything, something touches, what should slide slides as far as it should.
//
// --traces=FILE: a record of every step of drape and active, as JSON.

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <piecework/contact/contact.hpp>
#include <piecework/core/atomic_file.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/core/statistics.hpp>
#include <piecework/scene/scene_io.hpp>

#include "bench.hpp"
#include "contact_scenes.hpp"
#include "power_law.hpp"
#include "simulation.hpp"
#include "step_records.hpp"

namespace piecework::bench {
namespace {

using Records = std::vector<StepRecord>;

constexpr const char* kExactTolerance = "1e-5";  ///< mean edges, of steps that others are judged by
constexpr int kMostIterations = 2000;

const Option traces_option("--traces", "file for a record of every step, as JSON");

/// The same scene with steps that are as good as exact, and nothing checked.
scene::Scene exact(scene::Scene scene) {
  scene.quality.tolerance = std::stod(kExactTolerance);
  scene.quality.max_iterations = kMostIterations;
  scene.contact.check = false;
  return scene;
}

void add_to_traces(RecordedRun run) {
  static std::vector<RecordedRun> all;
  if (traces_option.value().empty()) return;
  all.push_back(std::move(run));
  write_file_atomically(traces_option.value(), records_json(all));
}

double total_seconds(const Records& records) {
  return 1e-3 *
         std::accumulate(records.begin(), records.end(), 0.0,
                         [](double sum, const StepRecord& r) { return sum + r.report.step_ms; });
}

void write(benchmark::State& state, const Records& records) {
  for (const auto& [name, value] : summary(records))
    if (std::isfinite(value)) state.counters[name] = value;
}

double median(std::vector<double> values) { return median_interval(std::move(values)).median; }

/// A row that runs a scene from its beginning.
struct SceneRow {
  const char* family;
  std::string name;       ///< of the scene
  std::string tolerance;  ///< of its steps
  int threads;
  int steps;
  int judged_every = 0;  ///< each so many steps the true error is found; 0: never
};

Records simulate(const Simulation& simulation, const SceneRow& row, const Simulation& judge) {
  model::State state = simulation.start();
  Records records;
  for (int k = 1; k <= row.steps; ++k) {
    const bool judged = row.judged_every > 0 && k % row.judged_every == 0;
    const model::State before = judged ? state : model::State{};
    records.push_back(take_step(*simulation.integrator, state));
    if (judged)
      records.back().true_error = distance_from_exact(*judge.integrator, before, state.x,
                                                      simulation.world->model.mean_edge);
  }
  return records;
}

void run_scene(benchmark::State& state, const SceneRow& row, const scene::Scene& scene) {
  if (row.threads > available_threads()) {
    skip(state, fmt::format("{} threads on {} cores", row.threads, available_threads()));
    return;
  }
  const Simulation simulation(scene), judge(exact(scene));
  Records records;
  for (auto _ : state) {
    records = ThreadPool(row.threads).run([&] { return simulate(simulation, row, judge); });
    state.SetIterationTime(total_seconds(records));
  }
  if (const std::string why = defect(records); !why.empty()) {
    fail(state, why);
    return;
  }
  const int vertices = simulation.world->model.num_vertices();
  write(state, records);
  state.counters["vertices"] = vertices;
  add_to_traces({row.family, row.name, row.tolerance, vertices, row.threads, records});
}

/// A sheet comes to lie on the slope for so many steps, then its way is measured for as many.
constexpr int kSlideSteps = 30;
constexpr double kMostDeviation = 0.05;  ///< of the distance by Coulomb's law

void friction(benchmark::State& state, bool mesh, double mu) {
  const Simulation simulation(slope_scene(mesh, mu));
  model::State motion = simulation.start();
  const auto place = [&] { return motion.x.col(0).mean(); };
  Records records;
  double speed = 0, slid = 0;
  for (auto _ : state) {
    for (int k = 0; k < kSlideSteps; ++k) (void)simulation.integrator->step(motion);
    const double begin = place();
    speed = motion.v.col(0).mean();
    for (int k = 0; k < kSlideSteps; ++k)
      records.push_back(take_step(*simulation.integrator, motion));
    slid = place() - begin;
    state.SetIterationTime(total_seconds(records));
  }
  const double h = simulation.world->scene.step.h;
  const double expected = coulomb_distance(speed, mu, h, kSlideSteps);
  const double creep = simulation.world->scene.contact.slip_speed * h * kSlideSteps;
  write(state, records);
  state.counters["slid_mm"] = 1e3 * slid;
  state.counters["expected_mm"] = 1e3 * expected;
  state.counters["speed"] = motion.v.col(0).mean();
  std::string why = defect(records);
  if (std::abs(slid - expected) > kMostDeviation * expected + creep)
    why = fmt::format("slid {:.4g} m, Coulomb's law says {:.4g} m", slid, expected);
  if (!why.empty()) fail(state, why);
}

/// A cloth at rest on its support, with contact `ratio` times as stiff as by default.
struct Settled {
  model::State state;
  double stiffness = 0;  ///< of contact by default, N/m
};

constexpr int kSettlingSteps = 60, kStifferSteps = 10;
constexpr double kDamping = 5, kStifferDamping = 30;  ///< meanwhile, 1/s

int support_side(Support support) {
  if (quick()) return 12;
  return support == Support::Rigid ? 30 : 20;
}

model::State settle(const scene::Scene& scene, const model::State* from, int steps) {
  const Simulation simulation(scene);
  model::State state = from ? *from : simulation.start();
  for (int k = 0; k < steps; ++k) (void)simulation.integrator->step(state);
  return state;
}

/// Contact gets stiffer by a factor of ten at a time: at once it would hurl the cloth away.
const Settled& settled(Support support, double ratio) {
  static std::map<std::pair<Support, double>, Settled> kept;
  const auto key = std::make_pair(support, ratio);
  if (const auto known = kept.find(key); known != kept.end()) return known->second;
  scene::Scene scene = support_scene(support, support_side(support), kSticks);
  if (ratio > 1) {
    const Settled& softer = settled(support, ratio / 10);
    scene.damping = kStifferDamping;
    scene.contact.stiffness = ratio * softer.stiffness;
    return kept[key] = {settle(scene, &softer.state, kStifferSteps), softer.stiffness};
  }
  scene.damping = kDamping;
  const double stiffness =
      contact::default_stiffness(runner::build_world(scene)->model, scene.step.h);
  return kept[key] = {settle(scene, nullptr, quick() ? 20 : kSettlingSteps), stiffness};
}

struct WeightRow {
  bool slides;
  Support support;
  double ratio;  ///< a power of ten
  std::string tolerance;
};

/// What is not measured: what slides gets moving.
int unmeasured_steps() { return quick() ? 2 : 8; }

void weight(benchmark::State& state, const WeightRow& row) {
  const Settled& from = settled(row.support, row.ratio);
  const int side = support_side(row.support);
  scene::Scene scene = support_scene(row.support, side, row.slides ? kSlides : kSticks);
  scene.quality.tolerance = std::stod(row.tolerance);
  scene.contact.stiffness = row.ratio * from.stiffness;
  const Simulation simulation(scene), free(without_contact(scene));
  model::State motion = from.state;
  for (int k = 0; k < unmeasured_steps(); ++k) (void)simulation.integrator->step(motion);
  Records records;
  std::vector<double> free_iterations, free_solves, speeds;
  for (auto _ : state) {
    for (int k = 0; k < (quick() ? 3 : 12); ++k) {
      model::State without = motion;
      const model::StepReport report = free.integrator->step(without);
      free_iterations.push_back(report.iterations);
      free_solves.push_back(report.global_solves);
      records.push_back(take_step(*simulation.integrator, motion));
      speeds.push_back(motion.v.topRows(side * side).rowwise().norm().mean());
    }
    state.SetIterationTime(total_seconds(records));
  }
  write(state, records);
  state.counters["free_iterations"] = median(free_iterations);
  state.counters["free_solves"] = median(free_solves);
  state.counters["stiffness"] = *scene.contact.stiffness;
  state.counters["stiffness_ratio"] =
      *scene.contact.stiffness / simulation.world->scene.materials.begin()->second.stretching;
  state.counters["speed"] = median(speeds);
  if (const std::string why = defect(records); !why.empty()) fail(state, why);
}

void detection(benchmark::State& state) {
  static std::vector<double> sizes, costs;  // of the rows so far
  const Simulation simulation(drape_scene(side_of(state.range(0)), "1e-2"));
  Records records;
  for (auto _ : state) {
    records = ThreadPool(std::min(2, available_threads())).run([&] {
      model::State motion = simulation.start();
      Records all;
      for (int k = 0; k < (quick() ? 6 : 10); ++k)
        all.push_back(take_step(*simulation.integrator, motion));
      return all;
    });
    std::erase_if(records, [](const StepRecord& r) { return r.contact().pairs == 0; });
    state.SetIterationTime(total_seconds(records));
  }
  if (const std::string why = defect(records); !why.empty()) {
    fail(state, why);
    return;
  }
  const auto triangles = static_cast<double>(simulation.world->model.triangles.size());
  std::vector<double> per_step;
  double ms = 0, cull_ms = 0, iterations = 0;
  for (const StepRecord& r : records) {
    per_step.push_back(1e3 * r.contact().detection_ms() / triangles);
    ms += r.contact().detection_ms();
    cull_ms += r.contact().cull_ms;
    iterations += r.report.iterations;
  }
  sizes.push_back(triangles);
  costs.push_back(ms / iterations);
  write(state, records);
  state.counters["us_per_triangle_step"] = median(per_step);
  state.counters["us_per_triangle_iteration"] = 1e3 * ms / iterations / triangles;
  state.counters["cull_us_per_triangle_step"] =
      1e3 * cull_ms / static_cast<double>(records.size()) / triangles;
  if (sizes.size() > 1) state.counters["growth_by_n"] = power_exponent(sizes, costs);
}

template <class Function>
benchmark::internal::Benchmark* add(const std::string& name, Function function) {
  return benchmark::RegisterBenchmark(("contact_steps/" + name).c_str(), std::move(function))
      ->Unit(benchmark::kMillisecond)
      ->UseManualTime()
      ->Iterations(1);
}

void add_drape(std::int64_t n, const SceneRow& row) {
  add(fmt::format("drape/n:{}/tolerance:{}/threads:{}", n, row.tolerance, row.threads),
      [=](benchmark::State& state) {
        run_scene(state, row, drape_scene(side_of(n), row.tolerance));
      });
}

void add_scene(const char* name, int steps, int threads) {
  const scene::Scene scene = scene::load_scene(name);
  const SceneRow row{"active", name, fmt::format("{:g}", scene.quality.tolerance), threads, steps};
  add(fmt::format("active/scene:{}/threads:{}", name, threads),
      [=](benchmark::State& state) { run_scene(state, row, scene); });
}

void add_drapes() {
  const auto row = [](const char* tolerance, int threads, int steps, int judged_every) {
    return SceneRow{"drape", "drape_on_sphere", tolerance, threads, steps, judged_every};
  };
  if (quick()) {
    add_drape(256, row("1e-2", 1, 8, 4));
    return;
  }
  for (const char* tolerance : {"1e-1", "1e-2", "1e-3"}) add_drape(2500, row(tolerance, 1, 60, 10));
  add_drape(2500, row("1e-2", 2, 60, 0));
  for (const int threads : {1, 2})  // its beginning: all of it takes many minutes
    add_drape(19881, row("1e-2", threads, 24, 0));
}

void add_weight(const WeightRow& row) {
  add(fmt::format("weight/state:{}/support:{}/ratio:{:g}/tolerance:{}",
                  row.slides ? "sliding" : "resting",
                  row.support == Support::Rigid ? "rigid" : "elastic", row.ratio, row.tolerance),
      [row](benchmark::State& state) { weight(state, row); });
}

void add_weights() {
  for (const bool slides : {false, true})
    for (const Support support : {Support::Rigid, Support::Elastic})
      for (const double ratio : {1.0, 10.0, 100.0, 1e3})
        for (const char* tolerance : {"1e-2", "1e-3"})
          if (!quick() || ratio == 1) add_weight({slides, support, ratio, tolerance});
}

const Registration registration([] {
  add_drapes();
  add_scene("stack_of_20", quick() ? 12 : 60, quick() ? 1 : 2);
  if (!quick()) add_scene("pot_drape", 90, 2);
  for (const bool mesh : {false, true})
    for (const double mu : {0.0, 0.1, 0.2, 0.3, 0.4, 0.6})
      if (!quick() || (mu == 0.2 && !mesh))
        add(fmt::format("friction/solid:{}/mu:{:g}", mesh ? "mesh" : "plane", mu),
            [=](benchmark::State& state) { friction(state, mesh, mu); });
  add_weights();
  auto* rows = add("detection", detection)->ArgName("n");
  for (const std::int64_t n : {2500, 10000, 19881, 60025})
    if (!quick() || n == 2500) rows->Arg(n);
});

}  // namespace
}  // namespace piecework::bench
