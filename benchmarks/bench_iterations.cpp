// Local-global iterations as the paper counts them, our analogues of three of its figures:
//
//   fig12/...  the local step: Gauss-Seidel sweeps against projections all at once, 64 domains
//   fig7/...   the residual's pattern with a fixed and with alternating orders of the sweep
//   fig13/...  against PD-Jacobi with Chebyshev weights [Wang 2015], at three time steps and sizes
//
// A row of fig12 and fig13 runs all its methods in turns, so that their times may be compared; its
// counters are METHOD:NAME. Validation: the reference is stationary, and no method ends below it.
//
// --traces=FILE leaves what every method reached after each iteration, --maps=FILE.png pictures of
// the residuals of fig7.

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <piecework/baselines/pd_jacobi.hpp>
#include <piecework/baselines/vanilla_pd.hpp>
#include <piecework/core/atomic_file.hpp>
#include <piecework/core/clock.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/core/statistics.hpp>
#include <piecework/local/gauss_seidel.hpp>
#include <piecework/local/jacobi.hpp>
#include <piecework/pd/dd_pd.hpp>
#include <piecework/runner/methods.hpp>
#include <renderer/png.hpp>
#include <renderer/renderer.hpp>

#include "bench.hpp"
#include "hanging_sheet.hpp"
#include "residual_pattern.hpp"
#include "traces.hpp"

namespace piecework::bench {
namespace {

constexpr std::size_t kCotton = 1;  // of kCloths
constexpr double kNotReached = -1;
constexpr double kGravity = 9.81;
constexpr model::StopOptions kNeverStop{model::StopRule::Gradient, 1e-14, 1000000, 1};

const Option traces_option("--traces", "file for what was reached after each iteration, as JSON");
const Option maps_option("--maps", "file for pictures of the residuals of fig7, as PNG");

struct Level {
  const char* name;
  double error;
};
constexpr std::array<Level, 6> kLevels{{{"1e-1", 1e-1},
                                        {"1e-2", 1e-2},
                                        {"1e-3", 1e-3},
                                        {"1e-4", 1e-4},
                                        {"1e-5", 1e-5},
                                        {"1e-6", 1e-6}}};

// Problems

/// A step of the sheet, and its cuts into domains.
class Study {
 public:
  Study(int side, const Instant& instant) : sheet(kCloths[kCotton], side, instant) {}

  const decomposition::Decomposition& domains(int count) {
    auto& cut = cuts_[count];
    if (!cut)
      cut = std::make_unique<decomposition::Decomposition>(
          decomposition::decompose(sheet.world().elements(), {.domains = count}));
    return *cut;
  }
  [[nodiscard]] double h() { return sheet.world().scene.step.h; }

  HangingSheet sheet;

 private:
  std::map<int, std::unique_ptr<decomposition::Decomposition>> cuts_;
};

/// The same moment of the motion for every time step.
Instant instant_of(int steps_per_second) {
  return {.h = 1.0 / steps_per_second, .step = steps_per_second / 6};
}

/// Made once for all rows: a trajectory takes its time.
Study& study_of(int side, int steps_per_second) {
  static std::map<std::pair<int, int>, std::unique_ptr<Study>> all;
  auto& study = all[{side, steps_per_second}];
  if (!study) study = std::make_unique<Study>(side, instant_of(steps_per_second));
  return *study;
}

// Methods

enum class Kind { DdPd, Default, VanillaPd, PdJacobi };

struct Method {
  const char* name;
  Kind kind = Kind::DdPd;
  std::optional<local::SweepOptions> sweeps = std::nullopt;
  pd::AccelerationKind acceleration = pd::AccelerationKind::None;
  int domains = 64;
};

constexpr local::SweepOptions kCorrected{};
constexpr local::SweepOptions kCorrectedFixed{.fixed_order = true};
constexpr local::SweepOptions kLiteral{.form = local::SweepForm::LiteralEq12};
constexpr local::SweepOptions kLiteralFixed{.form = local::SweepForm::LiteralEq12,
                                            .fixed_order = true};

/// The first one is the baseline.
const std::vector<Method> kFig12{
    {"jacobi"},
    {"gauss_seidel", Kind::DdPd, kCorrected},
    {"gauss_seidel_fixed", Kind::DdPd, kCorrectedFixed},
    {"gauss_seidel_one_domain", Kind::DdPd, kCorrected, pd::AccelerationKind::None, 1},
    {"literal_eq12", Kind::DdPd, kLiteral},
    {"literal_eq12_fixed", Kind::DdPd, kLiteralFixed},
    {"jacobi_anderson", Kind::DdPd, std::nullopt, pd::AccelerationKind::Anderson},
    {"gauss_seidel_anderson", Kind::DdPd, kCorrected, pd::AccelerationKind::Anderson}};
const std::vector<Method> kFig13{
    {"pd_jacobi", Kind::PdJacobi},
    {"vanilla_pd", Kind::VanillaPd},
    {"gauss_seidel", Kind::DdPd, kCorrected, pd::AccelerationKind::None, 32},
    {"default", Kind::Default}};

std::unique_ptr<model::Minimizer> make_dd_pd(const Method& method, Study& study) {
  const runner::World& world = study.sheet.world();
  return std::make_unique<pd::DdPd>(world.model,
                                    pd::DdPdOptions{.h = study.h(),
                                                    .gravity = kGravity,
                                                    .stop = kNeverStop,
                                                    .acceleration = {.kind = method.acceleration},
                                                    .normals = pd::NormalPart::Never,
                                                    .sweeps = method.sweeps},
                                    runner::make_exact_solver(world),
                                    &study.domains(method.domains));
}

std::unique_ptr<model::Minimizer> make_default(Study& study) {
  scene::Scene& scene = study.sheet.world().scene;
  const scene::Quality kept = std::exchange(scene.quality, {});
  scene.quality.stop = "gradient";
  scene.quality.tolerance = kNeverStop.tolerance;
  scene.quality.max_iterations = kNeverStop.max_iterations;
  auto minimizer = runner::make_minimizer(study.sheet.world());
  scene.quality = kept;
  return minimizer;
}

std::unique_ptr<model::Minimizer> make(const Method& method, Study& study) {
  const model::ClothModel& model = study.sheet.world().model;
  switch (method.kind) {
    case Kind::Default:
      return make_default(study);
    case Kind::VanillaPd:
      return std::make_unique<baselines::VanillaPd>(model, study.h(), kGravity, kNeverStop);
    case Kind::PdJacobi:
      return std::make_unique<baselines::PdJacobi>(model, study.h(), kGravity, kNeverStop);
    case Kind::DdPd:
      break;
  }
  return make_dd_pd(method, study);
}

// Runs

/// By counts, not by time: what was reached must not depend on the machine.
struct Limit {
  double energy_error;
  int iterations;
};

/// What a minimiser did on its way; -1 where it did not get.
struct Course {
  std::array<double, kLevels.size()> iterations, ms;
  double error = kNotReached, least_error = INFINITY, total_ms = 0;
  int count = 0;
  Series series;

  Course() {
    iterations.fill(kNotReached);
    ms.fill(kNotReached);
  }
  /// Writes down what is newly reached; true if anything is.
  bool note(const model::StepReport& report) {
    bool news = false;
    for (std::size_t i = 0; i < kLevels.size(); ++i)
      if (iterations[i] < 0 && error <= kLevels[i].error) {
        iterations[i] = report.iterations;
        ms[i] = total_ms;
        news = true;
      }
    return news;
  }
};

/// Runs a minimiser from the start of the step. The clock stands still while errors are measured.
Course follow(Study& study, const Method& method, model::Minimizer& minimizer, const Limit& limit) {
  Course course;
  model::StepProblem problem = study.sheet.problem();
  std::vector<double> memory = study.sheet.memory();
  if (method.kind == Kind::Default)
    problem.memory = &memory;
  else
    problem.extrapolated = nullptr;  // all of the paper's methods start from z
  Stopwatch watch;
  problem.observer = [&](const model::StepReport& report, const Positions& x) {
    course.total_ms += watch.lap();
    course.count = report.iterations;
    course.error = study.sheet.energy_error(report.energy);
    course.least_error = std::min(course.least_error, course.error);
    const bool news = course.note(report);
    course.series.add({report.iterations, course.total_ms, course.error,
                       study.sheet.position_error(x), report.gradient, report.dx_2},
                      news);
    watch.lap();
    return course.error > limit.energy_error && report.iterations < limit.iterations;
  };
  Positions x = study.sheet.start();
  watch.lap();
  (void)minimizer.minimize(problem, x);
  return course;
}

double median_or(const std::vector<double>& values) {
  return *std::min_element(values.begin(), values.end()) < 0 ? kNotReached
                                                             : median_interval(values).median;
}

void write(benchmark::State& state, const std::string& name, const std::vector<Course>& courses) {
  const auto set = [&](const std::string& counter, double value) {
    state.counters[name + ":" + counter] = value;
  };
  for (std::size_t i = 0; i < kLevels.size(); ++i) {
    std::vector<double> ms;
    for (const Course& course : courses) ms.push_back(course.ms[i]);
    set(std::string("iterations_") + kLevels[i].name, courses[0].iterations[i]);
    set(std::string("time_ms_") + kLevels[i].name, median_or(ms));
  }
  const auto [fastest, slowest] =
      std::minmax_element(courses.begin(), courses.end(),
                          [](const Course& a, const Course& b) { return a.total_ms < b.total_ms; });
  set("spread", slowest->total_ms / fastest->total_ms);
  set("iterations", courses[0].count);
  set("error", courses[0].error);
  set("least_error", courses[0].least_error);
}

/// The run of median duration: never the best one alone.
const Course& typical(const std::vector<Course>& courses) {
  std::vector<const Course*> sorted;
  for (const Course& course : courses) sorted.push_back(&course);
  std::sort(sorted.begin(), sorted.end(),
            [](const Course* a, const Course* b) { return a->total_ms < b->total_ms; });
  return *sorted[sorted.size() / 2];
}

/// Written anew after every row: a run that is broken off leaves what it had.
void keep_traces(std::vector<Trace> more) {
  static std::vector<Trace> all;
  std::move(more.begin(), more.end(), std::back_inserter(all));
  if (!traces_option.value().empty())
    write_file_atomically(traces_option.value(), traces_json(all));
}

struct Figure {
  const char* name;
  const std::vector<Method>* methods;
  Limit limit;
  int patience_of_jacobi;  ///< iterations of PD-Jacobi are cheap and many
};
const Figure kFigure12{"fig12", &kFig12, {1e-6, 3000}, 3000};
const Figure kFigure13{"fig13", &kFig13, {1e-4, 3000}, 30000};

void outer(benchmark::State& state, const Figure& figure, int steps_per_second) {
  const auto vertices = state.range(0);
  const int threads = std::min(static_cast<int>(state.range(1)), available_threads());
  Study& study = study_of(side_of(vertices), steps_per_second);
  ThreadPool pool(threads);
  std::vector<std::unique_ptr<model::Minimizer>> minimizers;
  for (const Method& method : *figure.methods) {
    minimizers.push_back(make(method, study));
    // In a simulation set-up is behind when a step begins.
    (void)pool.run([&] { return follow(study, method, *minimizers.back(), {-1, 1}); });
  }
  std::vector<std::vector<Course>> courses(minimizers.size());
  for (auto _ : state) {
    const Stopwatch watch;
    for (std::size_t i = 0; i < minimizers.size(); ++i) {
      const Method& method = (*figure.methods)[i];
      Limit limit = figure.limit;
      if (method.kind == Kind::PdJacobi) limit.iterations = figure.patience_of_jacobi;
      courses[i].push_back(pool.run([&] { return follow(study, method, *minimizers[i], limit); }));
      if (!(courses[i].back().error > -1e-7)) {
        fail(state, fmt::format("{} ends below the reference", method.name));
        return;
      }
    }
    state.SetIterationTime(1e-3 * watch.elapsed_ms());
  }
  if (!(study.sheet.reference_gradient() < 1e-6)) {
    fail(state, "the reference is no minimum");
    return;
  }
  std::vector<Trace> traces;
  for (std::size_t i = 0; i < minimizers.size(); ++i) {
    const char* name = (*figure.methods)[i].name;
    write(state, name, courses[i]);
    traces.push_back({figure.name, name, kCloths[kCotton].name, vertices, threads, study.h(),
                      typical(courses[i]).series});
  }
  keep_traces(std::move(traces));
}

// Fig. 7

constexpr int kSweeps = 16;
constexpr int kSettled = 5;  // from here on patterns are averaged

/// Patterns of the residual after each iteration or sweep.
struct Patterns {
  std::vector<Eigen::VectorXd> all;
  double rms = 0;  ///< of the last one, over the weight
};

struct Sweeping {
  const char* setting;  ///< sweeps: nothing else; local_global: the global step after each
  const char* form;
  const char* order;
  std::optional<local::SweepOptions> sweeps;
};
const std::vector<Sweeping> kSweeping{{"sweeps", "gauss_seidel", "fixed", kCorrectedFixed},
                                      {"sweeps", "gauss_seidel", "alternating", kCorrected},
                                      {"sweeps", "literal_eq12", "fixed", kLiteralFixed},
                                      {"sweeps", "literal_eq12", "alternating", kLiteral},
                                      {"local_global", "gauss_seidel", "fixed", kCorrectedFixed},
                                      {"local_global", "gauss_seidel", "alternating", kCorrected},
                                      {"local_global", "literal_eq12", "fixed", kLiteralFixed},
                                      {"local_global", "literal_eq12", "alternating", kLiteral},
                                      {"local_global", "jacobi", "none", std::nullopt}};

void add_pattern(Study& study, local::JacobiStep& local, const Positions& x, Patterns& patterns) {
  const model::ClothModel& model = study.sheet.world().model;
  Positions gradient;
  local.evaluate(x, study.sheet.problem(), gradient);
  patterns.all.push_back(residual_pattern(gradient, model.mass, study.sheet.fixed()));
  double sum = 0;
  for (Eigen::Index v = 0; v < gradient.rows(); ++v)
    sum += (gradient.row(v) / (kGravity * model.mass[v])).squaredNorm();
  patterns.rms = std::sqrt(sum / static_cast<double>(gradient.rows()));
}

/// One domain, as in the paper's figure.
Patterns patterns_of(Study& study, const Sweeping& sweeping) {
  Patterns patterns;
  local::JacobiStep local(study.sheet.world().model, study.h());
  model::StepProblem problem = study.sheet.problem();
  problem.extrapolated = nullptr;
  Positions x = study.sheet.start();
  if (std::string(sweeping.setting) == "sweeps") {
    local::GaussSeidel sweeps(study.sheet.world().model, study.domains(1), study.sheet.fixed(),
                              study.h(), *sweeping.sweeps);
    for (int k = 0; k < kSweeps; ++k) {
      sweeps.sweep(x, problem, k);
      add_pattern(study, local, x, patterns);
    }
    return patterns;
  }
  problem.observer = [&](const model::StepReport& report, const Positions& now) {
    if (report.iterations > 0) add_pattern(study, local, now, patterns);
    return report.iterations < kSweeps;
  };
  const Method method{.name = sweeping.form, .sweeps = sweeping.sweeps, .domains = 1};
  (void)make_dd_pd(method, study)->minimize(problem, x);
  return patterns;
}

/// The sheet at rest, flat on the ground.
Positions flat(const Positions& start) {
  const Vec3 extent = (start.colwise().maxCoeff() - start.colwise().minCoeff()).transpose();
  const int other = extent.y() > extent.z() ? 1 : 2;
  Positions result = Positions::Zero(start.rows(), 3);
  result.col(0) = start.col(0);
  result.col(2) = start.col(other);
  return result;
}

render::Image draw(Study& study, const Eigen::VectorXd& pattern) {
  constexpr int kWidth = 640;  // room for the colour bar beside the sheet
  constexpr int kHeight = 440;
  const model::ClothModel& model = study.sheet.world().model;
  const Positions x = flat(model.start);
  std::vector<float> values;
  for (const Triangle& t : model.triangles)
    values.push_back(static_cast<float>((pattern[t[0]] + pattern[t[1]] + pattern[t[2]]) / 3));
  render::Style style;
  style.color = render::ColorMode::Strain;
  style.borders = style.shadows = style.ground = style.ambient_occlusion = false;
  style.value_low = -1.5F;
  style.value_high = 0.5F;
  style.value_label = "lg r/rms";
  const Vec3 low = x.colwise().minCoeff().transpose();
  const Vec3 high = x.colwise().maxCoeff().transpose();
  render::Renderer renderer(render::Provider::Auto, kWidth, kHeight);
  return renderer.draw({.positions = &x, .triangles = model.triangles, .triangle_value = values},
                       render::frame_box(low, high, double{kWidth} / kHeight, 0, 90, 20), style);
}

/// Written anew after every row.
void keep_map(Study& study, const Sweeping& sweeping, const Eigen::VectorXd& pattern) {
  static std::vector<render::Image> images;
  static std::vector<std::string> captions;
  if (maps_option.value().empty()) return;
  images.push_back(draw(study, pattern));
  const std::string order =
      sweeping.sweeps ? fmt::format(", {} order", sweeping.order) : std::string();
  captions.push_back(fmt::format("{}: {}{}", sweeping.setting, sweeping.form, order));
  render::write_png(maps_option.value(), render::contact_sheet(images, captions, 4, 400));
}

void pattern(benchmark::State& state, const Sweeping& sweeping) {
  Study& study = study_of(side_of(state.range(0)), 120);
  const std::vector<char>& fixed = study.sheet.fixed();
  const Edges edges = edges_of(study.sheet.world().model.triangles);
  Patterns patterns;
  for (auto _ : state) patterns = patterns_of(study, sweeping);
  const auto count = static_cast<int>(patterns.all.size());
  if (count <= kSettled) {
    fail(state, fmt::format("only {} iterations", count));
    return;
  }
  double neighbours = 0;
  double persistence = 0;
  for (int k = kSettled; k < count; ++k) {
    const auto at = static_cast<std::size_t>(k);
    neighbours += moran(patterns.all[at], edges, fixed);
    persistence += correlation(patterns.all[at - 1], patterns.all[at], fixed);
  }
  state.counters["moran"] = neighbours / (count - kSettled);
  state.counters["moran_first"] = moran(patterns.all[0], edges, fixed);
  state.counters["persistence"] = persistence / (count - kSettled);
  state.counters["residual"] = patterns.rms;
  state.counters["sweeps"] = count;
  keep_map(study, sweeping, patterns.all.back());
}

// Rows

void register_outer(const Figure& figure, int steps_per_second, std::int64_t n) {
  auto* row =
      benchmark::RegisterBenchmark(fmt::format("{}/h:{}", figure.name, steps_per_second).c_str(),
                                   [&figure, steps_per_second](benchmark::State& state) {
                                     outer(state, figure, steps_per_second);
                                   });
  row->Unit(benchmark::kMillisecond)->UseManualTime()->ArgNames({"n", "threads"});
  row->Args({n, 2})->Iterations(quick() ? 1 : 3);
}

const Registration registration([] {
  for (const Sweeping& sweeping : kSweeping)
    benchmark::RegisterBenchmark(
        fmt::format("fig7/{}/{}/{}", sweeping.setting, sweeping.form, sweeping.order).c_str(),
        [&sweeping](benchmark::State& state) { pattern(state, sweeping); })
        ->Unit(benchmark::kMillisecond)
        ->ArgName("n")
        ->Arg(2500)
        ->Iterations(1);
  for (const std::int64_t n : {2500, 10000, 19881}) {
    if (quick() && n > 2500) continue;
    if (n != 10000) register_outer(kFigure12, 120, n);
    for (const int steps_per_second : {240, 120, 60})
      register_outer(kFigure13, steps_per_second, n);
  }
});

}  // namespace
}  // namespace piecework::bench
