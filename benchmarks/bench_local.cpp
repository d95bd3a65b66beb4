// The local step: nanoseconds per triangle, everything that an iteration needs included (energy,
// gradient, bending, inertia), beside the textbook loop with one Eigen JacobiSVD per triangle; and
// Gauss-Seidel sweeps, which come on top of an evaluation, beside the same. Validation: both agree;
// a sweep lowers the energy.

#include <cmath>
#include <vector>

#include <benchmark/benchmark.h>
#include <fmt/format.h>
#include <Eigen/SVD>

#include <piecework/core/parallel.hpp>
#include <piecework/decomposition/decomposition.hpp>
#include <piecework/local/gauss_seidel.hpp>
#include <piecework/local/jacobi.hpp>
#include <piecework/mesh/generate.hpp>
#include <piecework/testing/small_cloths.hpp>

#include "bench.hpp"
#include "interleaved.hpp"

namespace piecework::bench {
namespace {

constexpr double kH = 1.0 / 120.0;
constexpr int kDomains = 32;

/// A sheet whose triangles are strained by some per cent, and a prediction elsewhere.
struct Case {
  mesh::TriangleMesh mesh;
  model::ClothModel model;
  Positions x, z;
  std::vector<char> fixed;

  explicit Case(std::int64_t vertices)
      : mesh(mesh::generate(mesh::GeneratorKind::Sheet, {.columns = side_of(vertices),
                                                         .rows = side_of(vertices),
                                                         .pattern = mesh::SheetPattern::Delaunay})
                 .mesh),
        model(testing::cloth_model(mesh, testing::cotton())),
        fixed(static_cast<std::size_t>(mesh.num_vertices()), 0) {
    const double size = 0.05 / side_of(vertices);
    x = mesh.positions + testing::random_positions(mesh.num_vertices(), size, 1);
    z = mesh.positions + testing::random_positions(mesh.num_vertices(), size, 2);
    fixed.front() = 1;
  }
  [[nodiscard]] model::StepProblem problem() const { return {&z, &fixed, &z}; }
};

/// The textbook: an SVD per triangle, forces per element, vertices gather them.
class SvdStep {
 public:
  explicit SvdStep(const model::ClothModel& model)
      : model_(model), uses_(static_cast<std::size_t>(model.num_vertices())) {
    for (std::size_t t = 0; t < model.stretch.size(); ++t)
      for (std::size_t k = 0; k < 3; ++k)
        uses_[static_cast<std::size_t>(model.stretch[t].vertices[k])].push_back(3 * t + k);
    for (std::size_t i = 0; i < model.bend.size(); ++i)
      for (std::size_t k = 0; k < 4; ++k)
        uses_[static_cast<std::size_t>(model.bend[i].vertices[k])].push_back(
            3 * model.stretch.size() + 4 * i + k);
    force_.resize(3 * model.stretch.size() + 4 * model.bend.size());
  }

  double evaluate(const Positions& x, const model::StepProblem& problem, Positions& gradient) {
    gradient.resize(x.rows(), 3);
    return parallel_sum<double>(model_.stretch.size(),
                                [&](std::size_t t) { return stretch(t, x); }) +
           parallel_sum<double>(model_.bend.size(), [&](std::size_t i) { return bend(i, x); }) +
           parallel_sum<double>(uses_.size(),
                                [&](std::size_t v) { return gather(v, x, problem, gradient); });
  }

 private:
  double stretch(std::size_t t, const Positions& x) {
    const model::StretchConstraint& c = model_.stretch[t];
    Mat32 edges;
    edges.col(0) = (x.row(c.vertices[1]) - x.row(c.vertices[0])).transpose();
    edges.col(1) = (x.row(c.vertices[2]) - x.row(c.vertices[0])).transpose();
    const Mat32 F = edges * c.rest_inverse;
    const Eigen::JacobiSVD<Mat32> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Mat32 R = svd.matrixU().leftCols<2>() * svd.matrixV().transpose();
    const Mat32 f = c.weight * (F - R) * c.rest_inverse.transpose();
    force_[3 * t] = -f.col(0) - f.col(1);
    force_[3 * t + 1] = f.col(0);
    force_[3 * t + 2] = f.col(1);
    return 0.5 * c.weight * (F - R).squaredNorm();
  }

  double bend(std::size_t i, const Positions& x) {
    const model::BendConstraint& c = model_.bend[i];
    Vec3 value = Vec3::Zero();
    for (std::size_t k = 1; k < 4; ++k)
      value += c.coefficient[k] * (x.row(c.vertices[k]) - x.row(c.vertices[0])).transpose();
    for (std::size_t k = 0; k < 4; ++k)
      force_[3 * model_.stretch.size() + 4 * i + k] = c.weight * c.coefficient[k] * value;
    return 0.5 * c.weight * value.squaredNorm();
  }

  double gather(std::size_t v, const Positions& x, const model::StepProblem& problem,
                Positions& gradient) {
    const auto row = static_cast<Eigen::Index>(v);
    gradient.row(row).setZero();
    if ((*problem.fixed)[v] != 0) return 0;
    const Vec3 offset = (x.row(row) - problem.predicted->row(row)).transpose();
    const double inertia = model_.mass[row] / (kH * kH);
    Vec3 sum = inertia * offset;
    for (const std::size_t use : uses_[v]) sum += force_[use];
    gradient.row(row) = sum.transpose();
    return 0.5 * inertia * offset.squaredNorm();
  }

  const model::ClothModel& model_;
  std::vector<std::vector<std::size_t>> uses_;
  std::vector<Vec3> force_;
};

bool agree(double energy, double expected_energy, const Positions& gradient,
           const Positions& expected) {
  return std::abs(energy - expected_energy) <= 1e-12 * expected_energy &&
         (gradient - expected).norm() <= 1e-12 * expected.norm();
}

/// Ours and the textbook with the same threads, in turns. `valid` sees the last results of both.
template <class Ours, class Valid>
void measure(benchmark::State& state, const Case& cloth, const Ours& ours, const Valid& valid) {
  const auto threads = static_cast<int>(state.range(1));
  if (threads > available_threads()) {
    skip(state, fmt::format("{} threads on {} cores", threads, available_threads()));
    return;
  }
  SvdStep baseline(cloth.model);
  Positions expected;
  double expected_energy = 0;
  ThreadPool pool(threads);
  InterleavedTimer timer;
  const auto run_baseline = [&] {
    expected_energy = baseline.evaluate(cloth.x, cloth.problem(), expected);
  };
  pool.run([&] {
    ours();
    run_baseline();
    for (auto _ : state) {
      timer.sample_in_a_row(ours, run_baseline);
      state.SetIterationTime(timer.last_a());
    }
  });
  if (!valid(expected_energy, expected)) {
    fail(state, "the result differs from that with singular values");
    return;
  }
  timer.write(state.counters);
  state.counters["ns_per_triangle"] =
      1e9 * timer.a_seconds().median / static_cast<double>(cloth.model.stretch.size());
}

/// Energy and gradient against those of the textbook.
template <class Evaluate>
void measure_evaluation(benchmark::State& state, const Case& cloth, const Evaluate& evaluate) {
  Positions gradient;
  double energy = 0;
  measure(
      state, cloth, [&] { energy = evaluate(gradient); },
      [&](double expected_energy, const Positions& expected) {
        return agree(energy, expected_energy, gradient, expected);
      });
}

void jacobi(benchmark::State& state) {
  const Case cloth(state.range(0));
  local::JacobiStep step(cloth.model, kH);
  measure_evaluation(state, cloth, [&](Positions& gradient) {
    return step.evaluate(cloth.x, cloth.problem(), gradient).energy;
  });
}

void jacobi_svd(benchmark::State& state) {
  const Case cloth(state.range(0));
  SvdStep step(cloth.model);
  measure_evaluation(state, cloth, [&](Positions& gradient) {
    return step.evaluate(cloth.x, cloth.problem(), gradient);
  });
}

/// One sweep from the same x, without the evaluation that follows it. The energy must have fallen;
/// that of the literal form need not.
void sweep(benchmark::State& state, local::SweepForm form) {
  const Case cloth(state.range(0));
  const auto domains =
      decomposition::decompose({cloth.model.triangles, cloth.model.hinges, cloth.model.hinge_bends,
                                cloth.model.num_vertices()},
                               {.domains = kDomains});
  local::GaussSeidel sweeps(cloth.model, domains, cloth.fixed, kH, {.form = form});
  Positions x;
  int iteration = 0;
  measure(
      state, cloth,
      [&] {
        x = cloth.x;
        sweeps.sweep(x, cloth.problem(), iteration++);
      },
      [&](double energy_before, const Positions& /*gradient*/) {
        Positions gradient;
        const double energy =
            local::JacobiStep(cloth.model, kH).evaluate(x, cloth.problem(), gradient).energy;
        state.counters["energy"] = energy / energy_before;
        return form == local::SweepForm::LiteralEq12 ? std::isfinite(energy)
                                                     : energy < energy_before;
      });
}

void gauss_seidel(benchmark::State& state) { sweep(state, local::SweepForm::Corrected); }
void literal_eq12(benchmark::State& state) { sweep(state, local::SweepForm::LiteralEq12); }

const Registration registration([] {
  for (const auto& [name, function] :
       {std::pair{"local/jacobi", &jacobi}, std::pair{"local/jacobi_svd", &jacobi_svd},
        std::pair{"local/gauss_seidel", &gauss_seidel},
        std::pair{"local/literal_eq12", &literal_eq12}}) {
    auto* rows = benchmark::RegisterBenchmark(name, function);
    rows->Unit(benchmark::kMillisecond)->UseManualTime()->ArgNames({"n", "threads"});
    for (const std::int64_t n : {19881, 60025, 199809})
      for (const std::int64_t threads : {1, 2, 4})
        if (!quick() || n == 19881) rows->Args({n, threads})->Iterations(quick() ? 6 : 20);
  }
});

}  // namespace
}  // namespace piecework::bench
