#include <piecework/pd/dd_pd.hpp>

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include <piecework/core/parallel.hpp>
#include <piecework/model/integrator.hpp>
#include <piecework/testing/jolted_cloth.hpp>

namespace piecework::pd {
namespace {

using model::StopRule;
using testing::JoltedCloth;
using enum AccelerationKind;

const model::StopOptions kTight{StopRule::Gradient, 1e-9, 20000, 1};

std::unique_ptr<global::ExactSolver> tree(global::Precision precision = global::Precision::Single) {
  return global::make_tree_solver({}, {.precision = precision});
}

DdPdOptions options(AccelerationKind kind, NormalPart normals, model::StopOptions stop) {
  return {.h = JoltedCloth::kH,
          .gravity = JoltedCloth::kGravity,
          .stop = stop,
          .acceleration = {.kind = kind},
          .normals = normals};
}

DdPd engine(const JoltedCloth& cloth, model::StopOptions stop,
            NormalPart normals = NormalPart::Always) {
  return DdPd(cloth.model, options(Lbfgs, normals, stop), tree());
}

class DdPdAgainstNewton : public ::testing::TestWithParam<int> {};

// The energy is not convex, so Newton starts from our solution: if it is a minimum, Newton stays.
TEST_P(DdPdAgainstNewton, FindsAMinimumOfTheIncrementalPotential) {
  const int kind = GetParam();
  const JoltedCloth cloth(
      kind == 2 ? testing::sphere_mesh(1, 0.3) : testing::grid_mesh(5, 5, 0.3),
      {.density = 0.5, .stretching = 20, .bending = kind == 0 ? std::nullopt : std::optional(1e-3)},
      0.01);
  DdPd solver = engine(cloth, {StopRule::Gradient, 1e-10, 2000, 1});
  Positions x;
  const auto report = cloth.solve(solver, x);
  ASSERT_TRUE(report.converged) << report.gradient;
  EXPECT_LT(report.iterations, 60);
  const Positions newton = testing::oracle_minimize(cloth.oracle(), x);
  ASSERT_GT((x - cloth.z).cwiseAbs().maxCoeff(), 1e-4) << "nothing moved, nothing was tested";
  EXPECT_LT((x - newton).cwiseAbs().maxCoeff(), 1e-8 * 0.3);
}

INSTANTIATE_TEST_SUITE_P(MembraneBendingCurved, DdPdAgainstNewton, ::testing::Values(0, 1, 2));

struct Way {
  const char* name;
  AccelerationKind kind;
  NormalPart normals;
};

class EveryWay : public ::testing::TestWithParam<Way> {};

TEST_P(EveryWay, LeadsToTheSameMinimumAndEnergyNeverRises) {
  const JoltedCloth cloth(testing::grid_mesh(10, 10), {.stretching = 50, .bending = 1e-3}, 0.01);
  Positions expected;
  DdPd reference = engine(cloth, kTight);
  ASSERT_TRUE(cloth.solve(reference, expected).converged);

  DdPd solver(cloth.model, options(GetParam().kind, GetParam().normals, kTight), tree());
  double last = std::numeric_limits<double>::infinity();
  int calls = 0;
  model::StepProblem problem = cloth.problem();
  problem.observer = [&](const model::StepReport& report, const Positions& x) {
    EXPECT_LE(report.energy, last * (1 + 1e-12)) << report.iterations;
    EXPECT_EQ(report.iterations, calls);
    EXPECT_EQ(x.rows(), cloth.z.rows());
    last = report.energy;
    ++calls;
    return true;
  };
  Positions x = cloth.z;
  const auto report = solver.minimize(problem, x);
  EXPECT_TRUE(report.converged);
  EXPECT_EQ(calls, report.iterations + 1);
  EXPECT_EQ(report.normal_factors > 0, GetParam().normals == NormalPart::Always);
  EXPECT_LT((x - expected).cwiseAbs().maxCoeff(), 1e-8);
}

TEST_P(EveryWay, GivesTheSameBitsForEveryThreadCount) {
  const JoltedCloth cloth(testing::grid_mesh(50, 50), testing::cotton(), 0.01);
  const auto run = [&](int threads) {
    return ThreadPool(threads).run([&] {
      DdPd solver(cloth.model,
                  options(GetParam().kind, GetParam().normals, {StopRule::Iterations, 0, 8, 1}),
                  tree());
      Positions x;
      (void)cloth.solve(solver, x);
      return x;
    });
  };
  const Positions expected = run(1);
  for (const int threads : {2, 3, 8}) EXPECT_TRUE(run(threads) == expected) << threads;
}

INSTANTIATE_TEST_SUITE_P(All, EveryWay,
                         ::testing::Values(Way{"none", None, NormalPart::Never},
                                           Way{"chebyshev", Chebyshev, NormalPart::Never},
                                           Way{"anderson", Anderson, NormalPart::Never},
                                           Way{"lbfgs", Lbfgs, NormalPart::Never},
                                           Way{"lbfgs_kn", Lbfgs, NormalPart::Always}),
                         [](const auto& way) { return std::string(way.param.name); });

/// Steps of the falling, hanging sheet, and the problem of the last one.
struct HangingSheet {
  model::ClothModel model;
  model::ExternalForces forces{.gravity = Vec3(0, -9.81, 0)};
  model::State state;
  int iterations = 0;
  int normal_factors = 0;

  HangingSheet(int side, double stretching, std::optional<double> bending)
      : model(testing::cloth_model(testing::grid_mesh(side, side),
                                   {.stretching = stretching, .bending = bending})) {}
  void simulate(int steps, const DdPdOptions& dd_pd) {
    const int side = static_cast<int>(std::lround(std::sqrt(model.num_vertices())));
    model::Integrator integrator(model, forces, {{.vertices = {0, side - 1}}}, {.h = dd_pd.h},
                                 std::make_unique<DdPd>(model, dd_pd, tree()));
    state = integrator.initial_state({});
    for (int i = 0; i < steps; ++i) {
      const auto report = integrator.step(state);
      EXPECT_TRUE(report.converged) << i;
      iterations += report.iterations;
      normal_factors += report.normal_factors;
    }
  }
};

// The reason why this engine exists: vanilla PD's count grows with resolution and stiffness.
TEST(DdPd, IterationsGrowNeitherWithResolutionNorWithStiffness) {
  const auto iterations = [](int side, double stretching, std::optional<double> bending,
                             NormalPart normals) {
    HangingSheet sheet(side, stretching, bending);
    sheet.simulate(10, options(Lbfgs, normals, {StopRule::Gradient, 1e-3, 2000, 1}));
    return sheet.iterations / 10.0;
  };
  const double coarse = iterations(20, 261, 7e-6, NormalPart::Always);
  EXPECT_LT(coarse, 12);
  EXPECT_LT(iterations(60, 261, 7e-6, NormalPart::Always), 1.5 * coarse);
  EXPECT_LT(iterations(20, 2e4, 2e-2, NormalPart::Always), 25);
  EXPECT_GT(iterations(60, 261, 7e-6, NormalPart::Never), 4 * coarse) << "K alone";
}

TEST(DdPd, NormalsAreUsedWhereTheyPayAndRememberedAsCounts) {
  const model::StopOptions stop{StopRule::Error, 1e-2, 200, 1};
  HangingSheet stiff(40, 261, 7e-6);
  stiff.simulate(12, options(Lbfgs, NormalPart::Automatic, stop));
  EXPECT_GE(stiff.normal_factors, 8);
  EXPECT_EQ(stiff.state.memory.size(), 2U);
  HangingSheet soft(10, 1, std::nullopt);
  soft.simulate(12, options(Lbfgs, NormalPart::Automatic, stop));
  EXPECT_EQ(soft.normal_factors, 0) << "pays only for what it needs";
  EXPECT_TRUE(soft.state.memory.empty());
}

TEST(DdPd, StartsFromTheBetterOfPredictionAndExtrapolation) {
  const JoltedCloth cloth(testing::grid_mesh(10, 10), testing::cotton(1e-3), 0.01);
  DdPd solver = engine(cloth, kTight);
  Positions exact;
  ASSERT_TRUE(cloth.solve(solver, exact).converged);
  model::StepProblem problem = cloth.problem();
  const auto first_energy = [&](const Positions& extrapolated) {
    problem.extrapolated = &extrapolated;
    double energy = 0;
    problem.observer = [&](const model::StepReport& report, const Positions&) {
      if (report.iterations == 0) energy = report.energy;
      return true;
    };
    Positions x = cloth.z;
    EXPECT_TRUE(solver.minimize(problem, x).converged);
    EXPECT_LT((x - exact).cwiseAbs().maxCoeff(), 1e-8);
    return energy;
  };
  const double from_exact = first_energy(exact);
  const double from_nonsense = first_energy(3.0 * exact);
  EXPECT_LT(from_exact, from_nonsense);
}

TEST(DdPd, ErrorEstimateIsHonest) {
  const JoltedCloth cloth(testing::grid_mesh(20, 20), testing::cotton(1e-4), 0.002);
  Positions exact;
  DdPd reference = engine(cloth, kTight);
  ASSERT_TRUE(cloth.solve(reference, exact).converged);
  for (const double tolerance : {1e-1, 1e-2, 1e-3}) {
    DdPd solver = engine(cloth, {StopRule::Error, tolerance, 1000, 1});
    Positions x;
    const auto report = cloth.solve(solver, x);
    ASSERT_TRUE(report.converged);
    const double error = (x - exact).rowwise().norm().maxCoeff() / cloth.model.mean_edge;
    EXPECT_LT(error, 2 * tolerance) << tolerance;
    EXPECT_GT(report.iterations, 1);
  }
}

TEST(DdPd, FixedVerticesKeepTheirBits) {
  const JoltedCloth cloth(testing::grid_mesh(6, 6), testing::cotton(), 0.02);
  DdPd solver = engine(cloth, {StopRule::Iterations, 0, 10, 1});
  Positions x;
  (void)cloth.solve(solver, x);
  EXPECT_TRUE(x.row(0) == cloth.rest.positions.row(0));
  EXPECT_TRUE(x.row(1) == cloth.rest.positions.row(1));
  EXPECT_FALSE(x.row(2) == cloth.z.row(2));
}

TEST(DdPd, EverythingFixedOrNothing) {
  JoltedCloth cloth(testing::grid_mesh(5, 5), testing::cotton(), 0.01);
  DdPd solver = engine(cloth, kTight);
  Positions x;
  cloth.fixed.assign(25, 1);
  EXPECT_TRUE(cloth.solve(solver, x).converged);
  EXPECT_TRUE(x == cloth.z);
  cloth.fixed.assign(25, 0);
  EXPECT_TRUE(cloth.solve(solver, x).converged);
  // No external work: the centre of mass stays at that of z.
  EXPECT_LT((cloth.model.mass.transpose() * (x - cloth.z)).norm() / cloth.model.mass.sum(), 1e-10);
}

TEST(DdPd, FactorsKOnlyWhenTheFixedSetChanges) {
  JoltedCloth cloth(testing::grid_mesh(6, 6), testing::cotton(), 0.01);
  DdPd solver = engine(cloth, {StopRule::Iterations, 0, 3, 1}, NormalPart::Never);
  Positions x;
  EXPECT_GE(cloth.solve(solver, x).phases.refactor, 0);
  EXPECT_LT(cloth.solve(solver, x).phases.refactor, 0) << "must be off: '-'";
  cloth.fixed[1] = 0;
  EXPECT_GE(cloth.solve(solver, x).phases.refactor, 0);
}

TEST(DdPd, CrumpledStartsUnfold) {
  const JoltedCloth cloth(testing::grid_mesh(8, 8, 0.3), testing::cotton(1e-4), 0);
  Positions line = cloth.rest.positions;
  line.rightCols<2>().setZero();
  const Positions point = Positions::Zero(64, 3);
  for (const Positions& start : {line, point}) {
    DdPd solver = engine(cloth, {StopRule::Gradient, 1e-6, 2000, 1});
    Positions x = start;
    for (const int v : {0, 1}) x.row(v) = cloth.rest.positions.row(v);
    const auto report = solver.minimize(cloth.problem(), x);
    EXPECT_TRUE(x.allFinite());
    EXPECT_TRUE(report.converged) << report.gradient;
  }
}

TEST(DdPd, FarFromTheOriginTheSame) {
  const JoltedCloth near(testing::grid_mesh(8, 8), testing::cotton(1e-4), 0.01);
  JoltedCloth far = near;
  const Eigen::RowVector3d offset(1e6, -2e6, 5e5);
  far.model.start.rowwise() += offset;
  far.z.rowwise() += offset;
  const model::StopOptions stop{StopRule::Gradient, 1e-5, 2000, 1};
  DdPd a = engine(near, stop);
  DdPd b = engine(far, stop);
  Positions x;
  Positions y;
  ASSERT_TRUE(near.solve(a, x).converged);
  ASSERT_TRUE(far.solve(b, y).converged);
  EXPECT_LT((y.rowwise() - offset - x).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(DdPd, StopsWhereRoundingIsAllThatIsLeft) {
  const JoltedCloth cloth(testing::grid_mesh(12, 12), testing::cotton(), 0.01);
  DdPd solver = engine(cloth, {StopRule::Gradient, 1e-30, 100000, 1});
  Positions x;
  const auto report = cloth.solve(solver, x);
  EXPECT_FALSE(report.converged);
  EXPECT_TRUE(report.stalled);
  EXPECT_LT(report.iterations, 500);
  EXPECT_LT(report.gradient, 1e-8);
}

/// A global step that leads nowhere: what a factor beyond its precision does.
class BrokenSolver final : public global::ExactSolver {
 public:
  explicit BrokenSolver(double factor) : factor_(factor) {}
  global::SolveStatus factor(const SparseMatrix&, std::span<const int>) override {
    return global::SolveStatus::Ok;
  }
  global::SolveStatus solve(global::RightHandSides& b) override {
    b *= factor_;
    return global::SolveStatus::Ok;
  }
  [[nodiscard]] const global::FactorReport& report() const override { return report_; }
  [[nodiscard]] std::string description() const override { return "broken"; }

 private:
  double factor_;
  global::FactorReport report_;
};

// That no direction leads down is no reason to call the start a solution.
TEST(DdPd, AStepThatCannotBeginHasNotConverged) {
  const JoltedCloth cloth(testing::grid_mesh(6, 6), testing::cotton(), 0.01);
  for (const double factor : {std::numeric_limits<double>::quiet_NaN(), -1.0})
    for (const StopRule rule : {StopRule::Error, StopRule::DxInf, StopRule::Gradient}) {
      DdPd solver(cloth.model, options(Lbfgs, NormalPart::Never, {rule, 1e-3, 50, 1}),
                  std::make_unique<BrokenSolver>(factor));
      Positions x;
      const auto report = cloth.solve(solver, x);
      EXPECT_FALSE(report.converged);
      EXPECT_TRUE(report.stalled);
      EXPECT_TRUE(x.allFinite());
    }
}

/// A stiff sheet that a free fall of many edges would tear off its two pins: it has to swing.
JoltedCloth swinging_plate() {
  JoltedCloth cloth(testing::grid_mesh(10, 10, 1e-3),
                    {.density = 0.2, .stretching = 1e3, .bending = 1e-5}, 0);
  for (int v = 0; v < cloth.rest.num_vertices(); ++v)
    if (cloth.fixed[static_cast<std::size_t>(v)] == 0)
      cloth.z(v, 1) -= JoltedCloth::kGravity * JoltedCloth::kH * JoltedCloth::kH;
  return cloth;
}

// Increments are small there from the first iteration on, in the metric K^-1 at least.
TEST(DdPd, AStiffPlateThatHasYetToSwingHasNotConverged) {
  const JoltedCloth cloth = swinging_plate();
  DdPd solver(cloth.model, options(Lbfgs, NormalPart::Automatic, {}), tree());
  Positions x;
  const auto report = cloth.solve(solver, x);
  DdPd reference = engine(cloth, {StopRule::Gradient, 1e-6, 20000, 1});
  Positions expected = x;
  const auto exact = reference.minimize(cloth.problem(), expected);
  ASSERT_TRUE(exact.converged || exact.stalled);
  if (report.converged) {
    EXPECT_LT((x - expected).rowwise().norm().maxCoeff(), 0.1 * cloth.model.mean_edge);
  }
}

}  // namespace
}  // namespace piecework::pd
