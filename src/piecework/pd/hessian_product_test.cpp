#include <piecework/pd/hessian_product.hpp>

#include <Eigen/Dense>

#include <gtest/gtest.h>

#include <piecework/core/isa.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/model/assembly.hpp>
#include <piecework/testing/jolted_cloth.hpp>
#include <piecework/testing/patchwork.hpp>

#include "kernels.hpp"

namespace piecework::pd {
namespace {

using testing::JoltedCloth;

/// H of a cloth that has left its rest shape.
struct Evaluated {
  JoltedCloth cloth;
  model::Reduction reduction;
  model::HessianMatrix hessian;
  int scalars = 0;  ///< blocks that are multiples of the identity

  Evaluated(const mesh::TriangleMesh& mesh, const model::Material& material)
      : Evaluated(JoltedCloth(mesh, material, 0.01)) {}
  explicit Evaluated(JoltedCloth jolted)
      : cloth(std::move(jolted)), reduction(cloth.model, cloth.fixed), hessian(cloth.model) {
    hessian.set_pattern(reduction, reduction.system(assemble_system(cloth.model, JoltedCloth::kH)));
    hessian.evaluate(cloth.z, cloth.problem(), model::HessianForm::Unprojected);
    for (int k = 0; k < hessian.system().nonZeros(); ++k) scalars += hessian.is_scalar(k) ? 1 : 0;
  }
  [[nodiscard]] Positions product(const Positions& d) const {
    HessianProduct H;
    H.set_pattern(hessian);
    H.take(hessian);
    Positions result;
    H.multiply(d, result);
    return result;
  }
  /// Relative to the product with the assembled scalars in 64 bits.
  [[nodiscard]] double error() {
    hessian.complete();
    const Eigen::MatrixXd H = Eigen::MatrixXd(hessian.scalars()).selfadjointView<Eigen::Lower>();
    const Positions d = testing::random_positions(hessian.count(), 1, 3);
    const Positions got = product(d);
    const Eigen::VectorXd expected = H * Eigen::Map<const Eigen::VectorXd>(d.data(), d.size());
    EXPECT_GT(expected.norm(), 0);
    return (Eigen::Map<const Eigen::VectorXd>(got.data(), got.size()) - expected).norm() /
           expected.norm();
  }
};

TEST(HessianProduct, IsTheProductWithTheAssembledMatrix) {
  Evaluated flat(testing::grid_mesh(7, 6, 0.3), testing::cotton(1e-4));
  EXPECT_GT(flat.scalars, flat.hessian.count()) << "pairs across a hinge";
  EXPECT_LT(flat.error(), 1e-6);
}

TEST(HessianProduct, KnowsClothWithoutBendingAndWithCurvedHinges) {
  Evaluated limp(testing::grid_mesh(7, 6, 0.3), testing::cotton(0));
  EXPECT_LT(limp.error(), 1e-6);
  mesh::TriangleMesh wavy = testing::grid_mesh(7, 6, 0.3);
  wavy.positions += testing::random_positions(wavy.num_vertices(), 0.02, 7);
  Evaluated curved(wavy, testing::cotton(1e-4));
  EXPECT_EQ(curved.scalars, 0);
  EXPECT_LT(curved.error(), 1e-6);
}

TEST(HessianProduct, KnowsSeams) {
  JoltedCloth cloth(testing::patchwork(testing::four_patches()), testing::cotton(1e-4), 0.01);
  cloth.model.sewing =
      model::Sewing(mesh::resolve_seams(testing::geometric_stitches(testing::four_patches()),
                                        cloth.model.num_vertices(), testing::plain_names()),
                    cloth.model.start);
  const int vertices = cloth.model.num_vertices();
  Evaluated sewn(std::move(cloth));
  ASSERT_LT(sewn.hessian.count(), vertices - 20);
  EXPECT_LT(sewn.error(), 1e-6);
}

TEST(HessianProduct, OfHeldClothIsEmpty) {
  JoltedCloth cloth(testing::grid_mesh(3, 3, 0.3), testing::cotton(1e-4), 0.01);
  std::fill(cloth.fixed.begin(), cloth.fixed.end(), 1);
  EXPECT_EQ(Evaluated(std::move(cloth)).product(Positions(0, 3)).rows(), 0);
}

TEST(HessianProduct, HasTheSameBitsForEveryNumberOfThreads) {
  const Evaluated cloth(testing::grid_mesh(40, 20, 0.3), testing::cotton(1e-4));  // several tasks
  const Positions d = testing::random_positions(cloth.hessian.count(), 1, 3);
  const auto run = [&](int threads) {
    ThreadPool pool(threads);
    return pool.run([&] { return cloth.product(d); });
  };
  const Positions expected = run(1);
  for (const int threads : {2, 3, 8}) EXPECT_TRUE(run(threads) == expected) << threads;
}

TEST(BlockProduct, IsRightForEveryInstructionSet) {
  // Row 0: blocks of columns 1 and 0; row 1: nothing; row 2: twice the identity of column 1.
  const int dense_begin[] = {0, 2, 2, 2};
  const int dense_offset[] = {3, 0};
  const float dense[] = {1, 2, 3, 4, 5, 6, 7, 8, 9, -1, 0, 0, 0, -1, 0, 0, 0, -1, 0};
  const int scalar_begin[] = {0, 0, 0, 1};
  const int scalar_offset[] = {3};
  const float scalar[] = {2};
  const double x[] = {100, 200, 300, 1, 10, 100};
  const double expected[] = {741 - 100, 852 - 200, 963 - 300, 0, 0, 0, 2, 20, 200};
  for (const Isa isa : available_isas()) {
    double y[10] = {9, 9, 9, 9, 9, 9, 9, 9, 9, 42};
    outer_kernels(isa).block_product(
        {{dense_begin, dense_offset, dense}, {scalar_begin, scalar_offset, scalar}}, x, 0, 3, y);
    for (int i = 0; i < 9; ++i) EXPECT_EQ(y[i], expected[i]) << to_string(isa) << i;
    EXPECT_EQ(y[9], 42) << "nothing is written behind the last row";
  }
}

}  // namespace
}  // namespace piecework::pd
