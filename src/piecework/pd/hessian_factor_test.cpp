#include <piecework/pd/hessian_factor.hpp>

#include <Eigen/Dense>
#include <Eigen/Eigenvalues>

#include <gtest/gtest.h>

#include <piecework/core/random.hpp>
#include <piecework/global/eigen_views.hpp>
#include <piecework/model/assembly.hpp>
#include <piecework/testing/jolted_cloth.hpp>

namespace piecework::pd {
namespace {

using testing::JoltedCloth;

/// Jolted cloth with contacts between any of its vertices.
struct Touching {
  JoltedCloth cloth{testing::grid_mesh(6, 5, 0.3), testing::cotton(1e-4), 0.01};
  model::Reduction reduction{cloth.model, cloth.fixed};
  model::HessianMatrix hessian{cloth.model};
  std::vector<model::ContactBlock> contacts;

  Touching() {
    hessian.set_pattern(reduction, reduction.system(assemble_system(cloth.model, JoltedCloth::kH)));
    hessian.evaluate(cloth.z, cloth.problem(), model::HessianForm::Projected);
    Random random(3);
    for (int c = 0; c < 40; ++c) {
      model::ContactBlock contact{{}, 4, {}, Mat3::Zero()};
      for (std::size_t k = 0; k < 4; ++k) {
        contact.vertices[k] =
            2 + static_cast<int>(random.uniform(0, cloth.model.num_vertices() - 2.001));
        contact.beta[k] = random.uniform(-1, 1);
      }
      const Vec3 n(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
      contact.stiffness = 1e3 * n * n.transpose();
      contacts.push_back(contact);
    }
  }

  /// The second derivative, contact with its exact coupling included.
  [[nodiscard]] Eigen::MatrixXd dense() {
    hessian.complete();
    Eigen::MatrixXd H = Eigen::MatrixXd(hessian.scalars()).selfadjointView<Eigen::Lower>();
    for (const model::ContactBlock& contact : contacts) {
      Eigen::MatrixXd B = Eigen::MatrixXd::Zero(3, H.cols());
      for (std::size_t k = 0; k < 4; ++k)
        B.block<3, 3>(0, 3 * reduction.number(contact.vertices[k])) +=
            contact.beta[k] * Mat3::Identity();
      H += B.transpose() * contact.stiffness * B;
    }
    return H;
  }

  /// What the factor applies, column by column.
  Eigen::MatrixXd applied(HessianFactor& factor) {
    const int size = 3 * reduction.count();
    Eigen::MatrixXd P(size, size);
    Positions g(reduction.count(), 3), d;
    for (int c = 0; c < size; ++c) {
      g.setZero();
      g.data()[c] = 1;
      factor.apply(g, d);
      P.col(c) = Eigen::Map<const Eigen::VectorXd>(d.data(), size);
    }
    return P;
  }
};

TEST(HessianFactor, InvertsTheSecondDerivativeWithoutContact) {
  Touching touching;
  touching.contacts.clear();
  HessianFactor factor;
  ASSERT_TRUE(
      factor.factor(touching.hessian, touching.contacts, touching.cloth.model, touching.reduction));
  const Eigen::MatrixXd H = touching.dense();
  const auto I = Eigen::MatrixXd::Identity(H.rows(), H.cols());
  EXPECT_LT((touching.applied(factor) * H - I).norm(), 1e-3 * std::sqrt(double(H.rows())));
}

TEST(HessianFactor, BoundsContactFromAbove) {
  Touching touching;
  HessianFactor factor;
  ASSERT_TRUE(
      factor.factor(touching.hessian, touching.contacts, touching.cloth.model, touching.reduction));
  const Eigen::MatrixXd H = touching.dense();
  const Eigen::MatrixXd bounded = touching.applied(factor).inverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> excess((bounded + bounded.transpose()) / 2 -
                                                              H);
  const double scale = H.diagonal().maxCoeff();
  EXPECT_GT(excess.eigenvalues().minCoeff(), -1e-3 * scale);
  EXPECT_GT(excess.eigenvalues().maxCoeff(), 1e-2 * scale);
  touching.contacts.clear();
  EXPECT_GT((H - touching.dense()).norm(), 0.1 * scale) << "contact was there";
}

TEST(HessianFactor, CostsMoreIterationsOfTheMetricOnFinerCloth) {
  const auto price = [](int side) {
    const JoltedCloth cloth{testing::grid_mesh(side, side, 1), testing::cotton(1e-4), 0};
    const model::Reduction reduction(cloth.model, cloth.fixed);
    model::HessianMatrix hessian(cloth.model);
    const SparseMatrix K = reduction.system(assemble_system(cloth.model, JoltedCloth::kH));
    hessian.set_pattern(reduction, K);
    global::TreeSolver tree;
    tree.analyze(global::pattern_of(K));
    EXPECT_EQ(tree.factor(global::values_of(K)), global::SolveStatus::Ok);
    HessianProduct product;
    product.set_pattern(hessian);
    return HessianFactor::price(tree.report(), product);
  };
  EXPECT_GT(price(20), 1);
  EXPECT_GT(price(60), 1.2 * price(20));
}

}  // namespace
}  // namespace piecework::pd
