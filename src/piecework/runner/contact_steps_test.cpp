// The engine with contact against mechanics that can be written down.

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include <piecework/contact/contact.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/model/integrator.hpp>
#include <piecework/pd/dd_pd.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::runner {
namespace {

using model::StopRule;

constexpr double kH = 0.01, kGravity = 9.81;

struct Trial {
  mesh::TriangleMesh cloth = testing::grid_mesh(6, 6, 0.2);
  model::Material material{.density = 0.3, .stretching = 500, .bending = 1e-4};
  Vec3 gravity{0, -kGravity, 0};
  std::vector<colliders::AnalyticCollider> bodies;
  bool self = false;
  std::optional<colliders::Friction> friction;
  double stiffness = 0;  ///< 0: from the cloth
  contact::Barrier barrier = contact::Barrier::TwoStage;
  model::StopOptions stop{StopRule::Gradient, 1e-4, 500, 1};
  pd::NewtonUse newton = pd::NewtonUse::Touching;
};

colliders::AnalyticCollider body(colliders::Shape shape, colliders::RigidMotion motion = {}) {
  return {{"body", {}, {}}, std::move(shape), Eigen::Isometry3d::Identity(), motion};
}

struct Engine {
  static constexpr double kDistance = 4e-3;
  Trial trial;
  model::ClothModel model;
  contact::Contact* contact = nullptr;
  std::unique_ptr<model::Integrator> integrator;
  model::State state;

  explicit Engine(Trial given, bool with_contact = true)
      : trial(std::move(given)), model(testing::cloth_model(trial.cloth, trial.material)) {
    contact::ContactOptions options{.h = kH, .self = trial.self};
    options.activation = {
        trial.barrier, kDistance,
        trial.stiffness > 0 ? trial.stiffness : contact::default_stiffness(model, kH)};
    options.friction = trial.friction;
    auto terms =
        std::make_unique<contact::Contact>(model, options, contact::Colliders{trial.bodies, {}});
    contact = terms.get();
    integrator = std::make_unique<model::Integrator>(
        model, model::ExternalForces{.gravity = trial.gravity}, std::vector<model::Pin>{},
        model::IntegratorOptions{.h = kH},
        std::make_unique<pd::DdPd>(
            model,
            pd::DdPdOptions{
                .h = kH, .gravity = kGravity, .stop = trial.stop, .newton = trial.newton},
            global::make_tree_solver({}, {})),
        with_contact ? std::move(terms) : nullptr);
    state = integrator->initial_state({});
  }
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  void run(int steps) {
    for (int k = 0; k < steps; ++k) {
      const auto report = integrator->step(state);
      EXPECT_TRUE(report.converged) << "step " << state.step << ": gradient " << report.gradient;
      EXPECT_EQ(report.contact->interpenetrations, 0);
    }
  }
  [[nodiscard]] Vec3 momentum() const { return state.v.transpose() * model.mass; }
  [[nodiscard]] Vec3 velocity() const { return momentum() / model.mass.sum(); }
  [[nodiscard]] Vec3 center() const { return state.x.transpose() * model.mass / model.mass.sum(); }
};

/// A sheet just above the half-space y < 0, gravity turned by `angle` about z.
Trial on_plane(double angle, std::optional<colliders::Friction> friction) {
  Trial trial;
  trial.cloth.positions.col(1).array() += 0.7 * Engine::kDistance;
  trial.gravity = kGravity * Vec3(std::sin(angle), -std::cos(angle), 0);
  trial.bodies.push_back(body(colliders::Plane{}));
  trial.friction = friction;
  return trial;
}

TEST(ContactSteps, SheetAtRestIsCarriedByAsMuchAsItWeighs) {
  Engine engine(on_plane(0, std::nullopt));
  engine.run(60);
  EXPECT_LT(engine.state.v.cwiseAbs().maxCoeff(), 1e-3);
  EXPECT_GT(engine.state.x.col(1).minCoeff(), 0);
  EXPECT_LT(engine.state.x.col(1).maxCoeff(), Engine::kDistance);
  double carried = 0;
  for (const auto& pair : engine.contact->active()) carried += pair.pressure;
  const double weight = kGravity * engine.model.mass.sum();
  EXPECT_NEAR(carried, weight, 0.01 * weight);
}

TEST(ContactSteps, SheetSticksToAGentleSlope) {
  Engine engine(on_plane(20 * std::numbers::pi / 180, colliders::Friction{0.5}));
  engine.run(40);
  const Vec3 before = engine.center();
  engine.run(20);
  const double speed = (engine.center() - before).norm() / (20 * kH);
  EXPECT_LT(speed, 1e-3) << "creeps no faster than slip_speed";
}

TEST(ContactSteps, SheetSlidesDownASteepSlopeAsCoulombSays) {
  const double angle = 40 * std::numbers::pi / 180;
  Engine engine(on_plane(angle, colliders::Friction{0.5}));
  engine.run(20);
  const double before = engine.velocity().x();
  engine.run(20);
  const double acceleration = (engine.velocity().x() - before) / (20 * kH);
  const double expected = kGravity * (std::sin(angle) - 0.5 * std::cos(angle));
  EXPECT_NEAR(acceleration, expected, 0.05 * expected);
}

TEST(ContactSteps, SheetThatSticksHoldsWhereOneThatSlidesGoesOn) {
  const colliders::Friction friction{0.6, 0.3};
  Engine level(on_plane(0, friction));
  level.run(60);
  const double angle = 25 * std::numbers::pi / 180;  // tan = 0.466
  Engine engine(on_plane(angle, friction));
  engine.state = level.state;  // a floor that is tilted: what falls on a slope has a speed already
  engine.run(10);
  const Vec3 before = engine.center();
  engine.run(30);
  EXPECT_LT((engine.center() - before).norm() / (30 * kH), 1e-3) << "no faster than slip_speed";
  engine.state.v.col(0).array() += 0.2;
  engine.state.previous_v = engine.state.v;
  engine.run(20);
  const double speed = engine.velocity().x();
  engine.run(20);
  const double expected = kGravity * (std::sin(angle) - 0.3 * std::cos(angle));
  EXPECT_NEAR((engine.velocity().x() - speed) / (20 * kH), expected, 0.03 * expected);
}

TEST(ContactSteps, SheetSlidesDownASlopeAsFarAsKineticFrictionLetsIt) {
  const double angle = 40 * std::numbers::pi / 180;  // tan = 0.839
  Engine engine(on_plane(angle, colliders::Friction{0.7, 0.3}));
  engine.run(20);
  const double speed = engine.velocity().x(), begin = engine.center().x();
  engine.run(20);
  const double time = 20 * kH;
  const double acceleration = kGravity * (std::sin(angle) - 0.3 * std::cos(angle));
  // Implicit Euler is ahead by a h t / 2.
  const double expected = speed * time + 0.5 * acceleration * time * (time + kH);
  EXPECT_NEAR(engine.center().x() - begin, expected, 0.02 * expected);
}

TEST(ContactSteps, KineticFrictionAsLargeAsStaticChangesNoBit) {
  Engine one(on_plane(0.7, colliders::Friction{0.5})),
      two(on_plane(0.7, colliders::Friction{0.5, 0.5}));
  one.run(20);
  two.run(20);
  EXPECT_GT(one.velocity().norm(), 0.1) << "it slides";
  EXPECT_TRUE(one.state.x == two.state.x);
}

TEST(ContactSteps, ThrownSheetStopsAfterTheDistanceThatFrictionAllows) {
  Engine engine(on_plane(0, colliders::Friction{0.4}));
  engine.run(20);
  const double begin = engine.center().x();
  engine.state.v.col(0).array() += 1;
  engine.state.previous_v = engine.state.v;
  engine.run(60);
  const double expected = 1 / (2 * 0.4 * kGravity);
  // Implicit Euler stops early by v h / 2.
  EXPECT_NEAR(engine.center().x() - begin, expected - 0.5 * kH, 0.05 * expected);
  EXPECT_LT(engine.velocity().norm(), 2e-3);
}

TEST(ContactSteps, MovingBodyTakesClothAlong) {
  Trial trial = on_plane(0, colliders::Friction{0.5});
  trial.bodies = {body(colliders::Plane{}, {.velocity = Vec3(0.3, 0.2, 0), .rate = 0})};
  Engine engine(std::move(trial));
  engine.run(40);
  EXPECT_NEAR(engine.velocity().x(), 0.3, 0.01);
  EXPECT_NEAR(engine.velocity().y(), 0.2, 0.01);
  EXPECT_GT(engine.state.x.col(1).minCoeff(), 0.2 * 40 * kH);
}

TEST(ContactSteps, CollidingSheetsKeepTheirMomentum) {
  Trial trial;
  mesh::TriangleMesh above = testing::grid_mesh(5, 5, 0.15);
  above.positions.rowwise() += Eigen::RowVector3d(0.02, 0.02, 0.03);
  trial.cloth = testing::disjoint_union(trial.cloth, above);
  trial.gravity.setZero();
  trial.self = true;
  trial.friction = colliders::Friction{0.3};
  Engine engine(std::move(trial));
  engine.state.v.bottomRows(25).rowwise() += Eigen::RowVector3d(0.2, -1, 0);
  const Vec3 before = engine.momentum();
  const double other = engine.state.v.topRows(36).cwiseAbs().maxCoeff();
  engine.run(15);
  EXPECT_EQ(other, 0);
  EXPECT_GT(engine.state.v.topRows(36).cwiseAbs().maxCoeff(), 0.1) << "it was hit";
  EXPECT_LT((engine.momentum() - before).norm(), 1e-3 * before.norm());
}

/// A sheet with self-contact and friction falls onto a ball.
Trial drape() {
  Trial trial;
  trial.cloth = testing::grid_mesh(14, 14, 0.3);
  trial.cloth.positions.rowwise() -= Eigen::RowVector3d(0.15, -0.103, 0.15);
  trial.bodies.push_back(body(colliders::Sphere{Vec3::Zero(), 0.1}));
  trial.self = true;
  trial.friction = colliders::Friction{0.3};
  trial.stop = {StopRule::Gradient, 1e-2, 200, 1};
  return trial;
}

TEST(ContactSteps, SameBitsForEveryThreadCount) {
  const auto run = [](int threads) {
    return ThreadPool(threads).run([] {
      Engine engine(drape());
      for (int k = 0; k < 12; ++k) (void)engine.integrator->step(engine.state);
      EXPECT_TRUE(engine.contact->touching());
      return engine.state.x;
    });
  };
  const Positions expected = run(1);
  for (const int threads : {2, 3, 8}) EXPECT_TRUE(run(threads) == expected) << threads;
}

TEST(ContactSteps, AnotherObjectGoesOnFromAStateWithTheSameBits) {
  Engine whole(drape()), second(drape());
  for (int k = 0; k < 8; ++k) (void)whole.integrator->step(whole.state);
  second.state = whole.state;
  for (int k = 0; k < 5; ++k) {
    (void)whole.integrator->step(whole.state);
    (void)second.integrator->step(second.state);
  }
  EXPECT_TRUE(whole.state.x == second.state.x);
}

TEST(ContactSteps, EnergyNeverRisesWithinAStep) {
  Trial trial = drape();
  trial.friction.reset();  // its renewal changes what energy is
  Engine engine(std::move(trial));
  double last = 0;
  int calls = 0;
  engine.integrator->observe_iterations(
      [&](int, const model::StepReport& report, const Positions&) {
        if (report.iterations > 0) {
          EXPECT_LE(report.energy, last + 1e-12 * std::abs(last)) << report.iterations;
          ++calls;
        }
        last = report.energy;
        return true;
      });
  engine.run(12);
  EXPECT_GT(calls, 20);
}

TEST(ContactSteps, TwoWaysLeadToTheSameMinimum) {
  const auto end = [](pd::NewtonUse newton) {
    Trial trial = on_plane(0.3, std::nullopt);
    trial.newton = newton;
    trial.stop = {StopRule::Gradient, 1e-7, 5000, 1};
    Engine engine(std::move(trial));
    engine.run(3);
    EXPECT_TRUE(engine.contact->touching());
    return engine.state.x;
  };
  const Positions newton = end(pd::NewtonUse::Touching), lbfgs = end(pd::NewtonUse::Never);
  EXPECT_LT((newton - lbfgs).cwiseAbs().maxCoeff(), 1e-8);
}

TEST(ContactSteps, NothingNearChangesNoBit) {
  Trial trial;
  trial.cloth.positions.col(1) = 0.02 * (20 * trial.cloth.positions.col(0)).array().sin();
  trial.self = true;
  trial.bodies.push_back(body(colliders::Plane{Vec3(0, -5, 0), Vec3::UnitY()}));
  Engine with(trial), without(trial, false);
  for (int k = 0; k < 10; ++k) {
    EXPECT_TRUE(with.integrator->step(with.state).contact);
    EXPECT_FALSE(without.integrator->step(without.state).contact);
  }
  EXPECT_TRUE(with.state.x == without.state.x);
}

struct Extreme {
  const char* name;
  double stiffness, density, friction;
  contact::Barrier barrier;
};

class Extremes : public ::testing::TestWithParam<Extreme> {};

TEST_P(Extremes, StayFiniteAndOutside) {
  const Extreme& extreme = GetParam();
  Trial trial = on_plane(0, colliders::Friction{extreme.friction});
  trial.material.density = extreme.density;
  trial.stiffness = extreme.stiffness;
  trial.barrier = extreme.barrier;
  trial.stop = {StopRule::Gradient, 1e-2, 100, 1};
  Engine engine(std::move(trial));
  engine.state.v.col(1).setConstant(-20);
  for (int k = 0; k < 10; ++k) {
    const auto report = engine.integrator->step(engine.state);
    ASSERT_TRUE(engine.state.x.allFinite());
    EXPECT_GT(engine.state.x.col(1).minCoeff(), 0) << "step " << k;
    EXPECT_EQ(report.contact->interpenetrations, 0);
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, Extremes,
    ::testing::Values(Extreme{"soft", 1e-3, 0.3, 0.5, contact::Barrier::TwoStage},
                      Extreme{"hard", 1e8, 0.3, 0.5, contact::Barrier::TwoStage},
                      Extreme{"light", 10, 1e-3, 0.5, contact::Barrier::TwoStage},
                      Extreme{"sticky", 10, 0.3, 10, contact::Barrier::TwoStage},
                      Extreme{"ipc", 1e-3, 0.3, 0.5, contact::Barrier::Ipc},
                      Extreme{"exponential", 1e-3, 0.3, 0.5, contact::Barrier::Exponential},
                      Extreme{"penalty", 1e-3, 0.3, 0.5, contact::Barrier::None}),
    [](const auto& extreme) { return std::string(extreme.param.name); });

}  // namespace
}  // namespace piecework::runner
