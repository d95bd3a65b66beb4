#include <piecework/global/interface_dofs.hpp>

#include <set>

#include <gtest/gtest.h>

#include <piecework/core/error.hpp>

#include "decomposed_cloth_test_util.hpp"

namespace piecework::global {
namespace {

constexpr CornerOptions kNone{.corner_fraction = 0, .floating_corners = 0};

/// Classes by counting, and every table against every other.
void expect_consistent(const InterfaceDofs& dofs, std::span<const DomainMatrix> domains) {
  std::vector<int> count(static_cast<std::size_t>(dofs.num_rows), 0);
  for (const DomainMatrix& domain : domains)
    for (const int row : domain.rows) ++count[static_cast<std::size_t>(row)];
  int corners_of_two = 0;
  for (std::size_t r = 0; r < count.size(); ++r) {
    EXPECT_GT(count[r], 0);
    EXPECT_EQ(dofs.dof_class[r] == DofClass::Internal, count[r] == 1);
    EXPECT_TRUE(count[r] <= 2 || dofs.dof_class[r] == DofClass::Corner);
    corners_of_two += count[r] == 2 && dofs.dof_class[r] == DofClass::Corner;
  }
  EXPECT_EQ(corners_of_two, dofs.num_promoted + dofs.num_floating_promoted);

  ASSERT_EQ(dofs.domains.size(), domains.size());
  std::vector<double> sum_of_signs(dofs.duplicate_rows.size(), 0);
  for (std::size_t d = 0; d < domains.size(); ++d) {
    const DomainDofs& domain = dofs.domains[d];
    ASSERT_EQ(domain.size(), static_cast<int>(domains[d].rows.size()));
    EXPECT_EQ(std::set(domain.rows.begin(), domain.rows.end()),
              std::set(domains[d].rows.begin(), domains[d].rows.end()));
    for (int i = 0; i < domain.num_duplicates; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const auto m = static_cast<std::size_t>(domain.multiplier[k]);
      const int local = domain.num_internal + i;
      EXPECT_EQ(domain.rows[static_cast<std::size_t>(local)], dofs.duplicate_rows[m]);
      const DofCopy& copy = dofs.duplicate_copies[m][domain.sign[k] > 0 ? 0 : 1];
      EXPECT_EQ(copy.domain, static_cast<int>(d));
      EXPECT_EQ(copy.local, local);
      EXPECT_LT(dofs.duplicate_copies[m][0].domain, dofs.duplicate_copies[m][1].domain);
      sum_of_signs[m] += domain.sign[k];
    }
    for (int i = 0; i < domain.num_corners; ++i)
      EXPECT_EQ(
          domain.rows[static_cast<std::size_t>(domain.num_remainder() + i)],
          dofs.corner_rows[static_cast<std::size_t>(domain.corner[static_cast<std::size_t>(i)])]);
  }
  for (const double sum : sum_of_signs) EXPECT_EQ(sum, 0);
  for (int c = 0; c < dofs.num_corners(); ++c)
    for (int i = dofs.corner_copies_begin[static_cast<std::size_t>(c)];
         i < dofs.corner_copies_begin[static_cast<std::size_t>(c) + 1]; ++i) {
      const DofCopy& copy = dofs.corner_copies[static_cast<std::size_t>(i)];
      EXPECT_EQ(dofs.domains[static_cast<std::size_t>(copy.domain)]
                    .rows[static_cast<std::size_t>(copy.local)],
                dofs.corner_rows[static_cast<std::size_t>(c)]);
    }
}

TEST(InterfaceDofs, TablesAgree) {
  for (const double fraction : {0.0, 0.3, 0.5, 1.0}) {
    SCOPED_TRACE(fraction);
    for (const int domains : {1, 2, 4, 7, 16}) {
      const DecomposedCloth cloth = decompose_cloth(grid_cloth(20, 17), domains);
      const auto matrices = cloth.matrices();
      expect_consistent(classify_dofs(matrices, 20 * 17, {.corner_fraction = fraction}), matrices);
    }
    const DecomposedCloth random = random_cloth(12, 6, 3);
    const auto matrices = random.matrices();
    expect_consistent(classify_dofs(matrices, 144, {.corner_fraction = fraction}), matrices);
  }
}

// Without bending two slabs share one row of vertices; with it the ring beyond, on one side.
TEST(InterfaceDofs, SlabsShareOneRowOrTwo) {
  const auto plain = slab_cloth(9, 9, 2, std::nullopt).matrices();
  EXPECT_EQ(classify_dofs(plain, 81, kNone).num_multipliers(), 9);
  EXPECT_EQ(classify_dofs(plain, 81, kNone).num_corners(), 0);
  const auto bending = slab_cloth(9, 9, 2).matrices();
  EXPECT_GT(classify_dofs(bending, 81, kNone).num_multipliers(), 9);
}

TEST(InterfaceDofs, PromotionIsEvenAlongTheCurve) {
  const auto matrices = slab_cloth(17, 9, 2, std::nullopt).matrices();
  const InterfaceDofs half =
      classify_dofs(matrices, 153, {.corner_fraction = 0.5, .floating_corners = 0});
  EXPECT_EQ(half.num_corners(), 9);  // of 17, every second one: rows of one line ascend along it
  EXPECT_EQ(half.num_promoted, 9);
  for (std::size_t i = 1; i < half.corner_rows.size(); ++i)
    EXPECT_EQ(half.corner_rows[i] - half.corner_rows[i - 1], 2);
  const InterfaceDofs third =
      classify_dofs(matrices, 153, {.corner_fraction = 0.3, .floating_corners = 0});
  EXPECT_EQ(third.num_corners(), 5);
  for (std::size_t i = 1; i < third.corner_rows.size(); ++i) {
    EXPECT_GE(third.corner_rows[i] - third.corner_rows[i - 1], 3);
    EXPECT_LE(third.corner_rows[i] - third.corner_rows[i - 1], 4);
  }
  EXPECT_EQ(classify_dofs(matrices, 153, {.corner_fraction = 1}).num_multipliers(), 0);
}

TEST(InterfaceDofs, FloatingPartsGetCornersThatLieApart) {
  const auto matrices = slab_cloth(17, 16, 3, std::nullopt).matrices();
  EXPECT_EQ(classify_dofs(matrices, 272, kNone).num_corners(), 0);
  const InterfaceDofs one = classify_dofs(matrices, 272, {.floating_corners = 1});
  for (const DomainDofs& domain : one.domains) EXPECT_GE(domain.num_corners, 1);
  const InterfaceDofs three = classify_dofs(matrices, 272);
  for (const DomainDofs& domain : three.domains) EXPECT_GE(domain.num_corners, 1);
  EXPECT_GE(three.num_floating_promoted, 3);
  EXPECT_EQ(three.corner_rows[1] - three.corner_rows[0], 8);  // ends and middle of a 17-row line
  EXPECT_EQ(three.corner_rows[2] - three.corner_rows[1], 8);
}

TEST(InterfaceDofs, PartsOfADomainAreJudgedOneByOne) {
  // Domain 0 is the first and the last of three slabs: two parts that do not touch.
  DecomposedCloth cloth = slab_cloth(6, 13, 3, std::nullopt);
  for (int& domain : cloth.triangle_domain) domain = domain == 1 ? 1 : 0;
  cloth = assign_triangles(cloth.model, cloth.triangle_domain, 2);
  const InterfaceDofs dofs = classify_dofs(cloth.matrices(), 78, {.floating_corners = 1});
  EXPECT_EQ(dofs.num_corners(), 2);
  EXPECT_EQ(dofs.num_multipliers(), 10);
}

TEST(InterfaceDofs, PartsWithoutDuplicatesNeedNoCorner) {
  const auto mesh = testing::disjoint_union(testing::grid_mesh(4, 4), testing::grid_mesh(5, 3));
  const auto model = testing::cloth_model(mesh, testing::cotton());
  std::vector<int> owner(model.triangles.size(), 0);
  for (std::size_t t = 18; t < owner.size(); ++t) owner[t] = 1;
  const InterfaceDofs dofs = classify_dofs(assign_triangles(model, owner, 2).matrices(), 31);
  EXPECT_EQ(dofs.num_corners(), 0);
  EXPECT_EQ(dofs.num_multipliers(), 0);
}

TEST(InterfaceDofs, NothingAtAll) {
  const InterfaceDofs dofs = classify_dofs({}, 0);
  EXPECT_EQ(dofs.num_multipliers(), 0);
  EXPECT_EQ(dofs.num_corners(), 0);
  const std::vector<DomainMatrix> empty(2);  // domains without rows
  EXPECT_EQ(classify_dofs(empty, 0).domains.size(), 2U);
}

TEST(InterfaceDofs, RefusesWhatDoesNotFit) {
  auto domains = slab_cloth(4, 4, 2).matrices();
  EXPECT_THROW(classify_dofs(domains, 16, {.corner_fraction = 1.5}), InputError);
  EXPECT_THROW(classify_dofs(domains, 16, {.corner_fraction = std::nan("")}), InputError);
  EXPECT_THROW(classify_dofs(domains, 16, {.floating_corners = -1}), InputError);
  EXPECT_THROW(classify_dofs(domains, 17), InputError);  // row 16 has no domain
  EXPECT_THROW(classify_dofs(domains, 15), InputError);  // row 15 is out of range
  std::swap(domains[0].rows[0], domains[0].rows[1]);
  EXPECT_THROW(classify_dofs(domains, 16), InputError);
  std::swap(domains[0].rows[0], domains[0].rows[1]);
  domains[0].rows.pop_back();
  EXPECT_THROW(classify_dofs(domains, 16), InputError);
}

TEST(SplitMatrix, SumsToTheWholeInEqualParts) {
  const DecomposedCloth cloth = decompose_cloth(grid_cloth(9, 9), 5);
  const SparseMatrix K = cloth.K();
  const auto domains = split_matrix(K, cloth.row_domains(), 5);
  EXPECT_LT((sum_matrices(domains, 81) - K).norm(), 1e-15 * K.norm());
  expect_consistent(classify_dofs(domains, 81), domains);
  for (const DomainMatrix& domain : domains)
    for (std::size_t i = 0; i < domain.rows.size(); ++i) {
      const auto row = static_cast<std::size_t>(domain.rows[i]);
      const int copies = cloth.vertex_domains.begin[row + 1] - cloth.vertex_domains.begin[row];
      const auto k = static_cast<Eigen::Index>(i);
      EXPECT_EQ(domain.K.coeff(k, k), K.coeff(domain.rows[i], domain.rows[i]) / copies);
    }
}

TEST(SplitMatrix, RowWithoutDomainGoesToDomainZero) {
  SparseMatrix K(2, 2);
  K.insert(0, 0) = 1;
  K.insert(1, 1) = 2;
  const std::vector<int> begin{0, 1, 1};
  const std::vector<int> item{1};
  const auto domains = split_matrix(K, {begin, item}, 2);
  EXPECT_EQ(domains[0].rows, std::vector<int>{1});
  EXPECT_EQ(domains[1].rows, std::vector<int>{0});
}

TEST(SplitMatrix, RefusesEntriesBetweenDomains) {
  SparseMatrix K(2, 2);
  K.insert(0, 0) = K.insert(1, 1) = 2;
  K.insert(0, 1) = K.insert(1, 0) = 1;
  const std::vector<int> begin{0, 1, 2};
  EXPECT_THROW(split_matrix(K, {begin, std::vector<int>{0, 1}}, 2), InputError);
  EXPECT_THROW(split_matrix(K, {begin, std::vector<int>{0, 2}}, 2), InputError);
  EXPECT_THROW(split_matrix(K, {begin, std::vector<int>{0, 0}}, -1), InputError);
  EXPECT_THROW(split_matrix(K, {begin, std::vector<int>{0}}, 2), InputError);
  const std::vector<int> one{0, 1};
  EXPECT_THROW(split_matrix(K, {one, std::vector<int>{0}}, 1), InputError);
  const std::vector<int> two{0, 2, 3};
  EXPECT_THROW(split_matrix(K, {two, std::vector<int>{1, 0, 0}}, 2), InputError);
}

}  // namespace
}  // namespace piecework::global
