#include <piecework/pd/contact_product.hpp>

#include <Eigen/Dense>

#include <gtest/gtest.h>

#include <piecework/core/parallel.hpp>
#include <piecework/core/random.hpp>
#include <piecework/testing/patchwork.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::pd {
namespace {

/// Four patches sewn to each other, some vertices held, and contacts between any of the others.
struct SewnContacts {
  model::ClothModel model;
  std::vector<char> fixed;
  std::vector<model::ContactBlock> contacts;

  SewnContacts()
      : model(testing::cloth_model(testing::patchwork(testing::four_patches()),
                                   testing::cotton(1e-4))),
        fixed(static_cast<std::size_t>(model.num_vertices()), 0) {
    model.sewing =
        model::Sewing(mesh::resolve_seams(testing::geometric_stitches(testing::four_patches()),
                                          model.num_vertices(), testing::plain_names()),
                      model.start);
    fixed[0] = fixed[5] = 1;
    Random random(5);
    for (int c = 0; c < 3000; ++c) {
      model::ContactBlock& contact = contacts.emplace_back();
      contact.count = static_cast<int>(random.uniform(0, 4.999));  // 0: all of it is held
      for (std::size_t k = 0; k < static_cast<std::size_t>(contact.count); ++k) {
        contact.vertices[k] = 6 + static_cast<int>(random.uniform(0, model.num_vertices() - 6.001));
        contact.beta[k] = random.uniform(-1, 1);
      }
      const Vec3 n(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
      contact.stiffness = 1e3 * n * n.transpose();
    }
  }

  /// Sum of B^T C B by dense algebra.
  [[nodiscard]] Eigen::MatrixXd dense(const model::Reduction& reduction) const {
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(3 * reduction.count(), 3 * reduction.count());
    for (const model::ContactBlock& contact : contacts) {
      Eigen::MatrixXd B = Eigen::MatrixXd::Zero(3, H.cols());
      for (std::size_t k = 0; k < static_cast<std::size_t>(contact.count); ++k)
        model.sewing.map().visit_carriers(contact.vertices[k], [&](int carrier, double weight) {
          const int unknown = reduction.number(carrier);
          if (unknown >= 0)
            B.block<3, 3>(0, 3 * unknown) += weight * contact.beta[k] * Mat3::Identity();
        });
      H += B.transpose() * contact.stiffness * B;
    }
    return H;
  }
};

TEST(ContactProduct, IsTheDenseProductWithSeamsAndHeldVertices) {
  const SewnContacts sewn;
  const model::Reduction reduction(sewn.model, sewn.fixed);
  ASSERT_LT(reduction.count(), sewn.model.num_vertices() - 20);
  ContactProduct product;
  product.take(sewn.contacts, sewn.model, reduction);
  const Positions d = testing::random_positions(reduction.count(), 1, 3);
  const Positions before = testing::random_positions(reduction.count(), 1, 4);
  Positions got = before;
  product.add(d, got);
  const Eigen::VectorXd expected =
      sewn.dense(reduction) * Eigen::Map<const Eigen::VectorXd>(d.data(), d.size());
  got -= before;
  EXPECT_GT(expected.norm(), 1e3);
  EXPECT_LT((Eigen::Map<const Eigen::VectorXd>(got.data(), got.size()) - expected).norm(),
            1e-6 * expected.norm());
}

TEST(ContactProduct, ForgetsWhatItHadAndAddsNothingWithoutContacts) {
  const SewnContacts sewn;
  const model::Reduction reduction(sewn.model, sewn.fixed);
  ContactProduct product;
  product.take(sewn.contacts, sewn.model, reduction);
  product.take({}, sewn.model, reduction);
  const Positions d = testing::random_positions(reduction.count(), 1, 3);
  Positions got = d;
  product.add(d, got);
  EXPECT_TRUE(got == d);
}

TEST(ContactProduct, HasTheSameBitsForEveryNumberOfThreads) {
  const SewnContacts sewn;
  const model::Reduction reduction(sewn.model, sewn.fixed);
  const Positions d = testing::random_positions(reduction.count(), 1, 3);
  const auto run = [&](int threads) {
    ThreadPool pool(threads);
    return pool.run([&] {
      ContactProduct product;
      product.take(sewn.contacts, sewn.model, reduction);
      Positions got = Positions::Zero(reduction.count(), 3);
      product.add(d, got);
      return got;
    });
  };
  const Positions expected = run(1);
  for (const int threads : {2, 3, 8}) EXPECT_TRUE(run(threads) == expected) << threads;
}

}  // namespace
}  // namespace piecework::pd
