#include <piecework/pd/acceleration.hpp>

#include <vector>

#include <gtest/gtest.h>

#include <piecework/model/assembly.hpp>
#include <piecework/testing/jolted_cloth.hpp>

namespace piecework::pd {
namespace {

using testing::JoltedCloth;

Eigen::VectorXd flat(const Positions& x) {
  return Eigen::Map<const Eigen::VectorXd>(x.data(), x.size());
}

struct Setting {
  JoltedCloth cloth{testing::grid_mesh(6, 6), testing::cotton(1e-3), 0.01};
  Metric metric{cloth.model, model::assemble_system(cloth.model, JoltedCloth::kH),
                global::make_tree_solver({}, {})};
  Setting() { metric.prepare(cloth.fixed); }
  [[nodiscard]] int count() const { return metric.reduction().count(); }
  Positions descend(const Positions& g) {
    Positions d;
    metric.apply(g, d);
    return -d;
  }
};

// The textbook: H_{k+1} = (I - rho s y^T) H_k (I - rho y s^T) + rho s s^T, H_0 = P, as a matrix.
TEST(Lbfgs, IsTheBfgsUpdateOfTheMetric) {
  Setting s;
  const Eigen::Index size = 3 * s.count();
  Eigen::MatrixXd P(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    Positions unit = Positions::Zero(s.count(), 3);
    unit.data()[i] = 1;
    P.col(i) = -flat(s.descend(unit));
  }
  constexpr int kWindow = 3;
  const auto acceleration = make_acceleration({.kind = AccelerationKind::Lbfgs, .window = kWindow});
  std::vector<std::pair<Eigen::VectorXd, Eigen::VectorXd>> pairs;
  Positions g = testing::random_positions(s.count(), 1, 1);
  for (int k = 0; k < 8; ++k) {
    Positions d;
    acceleration->propose(g, s.metric, d);
    Eigen::MatrixXd H = P;
    const int first = std::max(0, static_cast<int>(pairs.size()) - kWindow);
    for (std::size_t i = static_cast<std::size_t>(first); i < pairs.size(); ++i) {
      const auto& [ds, dy] = pairs[i];
      const double rho = 1 / ds.dot(dy);
      const Eigen::MatrixXd V = Eigen::MatrixXd::Identity(size, size) - rho * dy * ds.transpose();
      H = V.transpose() * H * V + rho * ds * ds.transpose();
    }
    const Eigen::VectorXd expected = -H * flat(g);
    EXPECT_LT((flat(d) - expected).norm(), 2e-5 * expected.norm()) << k << " (32-bit pairs)";
    EXPECT_EQ(acceleration->fresh(), k == 0);
    // Any change of the gradient will do, as long as s . y is mostly positive.
    const double step = 0.5;
    Positions after = g + 3e3 * step * d + 0.1 * testing::random_positions(s.count(), 1, 10 + k);
    if (k == 4) after = g - 3e3 * step * d;  // curvature below zero: left out
    acceleration->accept(step, d, g, after);
    const double curvature = step * flat(d).dot(flat(Positions(after - g)));
    ASSERT_EQ(curvature > 0, k != 4);
    if (curvature > 0) pairs.emplace_back(step * flat(d), flat(Positions(after - g)));
    g = after;
  }
}

// On a linear problem of few dimensions Anderson's mixing with enough memory is exact.
TEST(Anderson, SolvesLinearProblemsInAsManyStepsAsTheyHaveDimensions) {
  Setting s;
  // Gradient of a quadratic whose Hessian is K times 1, 2, 3 or 4 on four groups of directions.
  constexpr int kGroups = 4;
  const Eigen::Index size = 3 * s.count();
  Eigen::MatrixXd groups = Eigen::MatrixXd::Random(size, kGroups);
  const SparseMatrix K =
      s.metric.reduction().system(model::assemble_system(s.cloth.model, JoltedCloth::kH));
  const auto K_times = [&](const Eigen::VectorXd& u) {
    const Positions rows = Eigen::Map<const Positions>(u.data(), s.count(), 3);
    return flat(Positions(K * rows));
  };
  // K-orthonormal.
  for (int i = 0; i < kGroups; ++i) {
    for (int j = 0; j < i; ++j)
      groups.col(i) -= groups.col(j).dot(K_times(groups.col(i))) * groups.col(j);
    groups.col(i) /= std::sqrt(groups.col(i).dot(K_times(groups.col(i))));
  }
  const auto gradient = [&](const Eigen::VectorXd& u) {
    Eigen::VectorXd g = Eigen::VectorXd::Zero(size);
    for (int i = 0; i < kGroups; ++i) {
      const Eigen::VectorXd Kg = K_times(groups.col(i));
      g += (0.2 + 0.2 * i) * (u.dot(Kg) - 1) * Kg;
    }
    const Positions rows = Eigen::Map<const Positions>(g.data(), s.count(), 3);
    return rows;
  };
  const auto acceleration = make_acceleration({.kind = AccelerationKind::Anderson, .window = 5});
  Eigen::VectorXd u = Eigen::VectorXd::Zero(size);
  Positions g = gradient(u);
  const double first = g.norm();
  for (int k = 0; k < kGroups + 2; ++k) {
    Positions d;
    acceleration->propose(g, s.metric, d);
    u += flat(d);
    const Positions after = gradient(u);
    acceleration->accept(1, d, g, after);
    g = after;
  }
  EXPECT_LT(g.norm(), 1e-8 * first);
}

}  // namespace
}  // namespace piecework::pd
