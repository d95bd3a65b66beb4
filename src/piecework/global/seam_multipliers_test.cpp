// Seams with multipliers in the primal-dual solver [Lu25, Sec. 4.4, Eq. 11, corrected].

#include <algorithm>
#include <limits>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/global/primal_dual.hpp>
#include <piecework/testing/patchwork.hpp>

#include "decomposed_cloth_test_util.hpp"

namespace piecework::global {
namespace {

using Dense = Eigen::MatrixXd;

/// The four patches, shared out among domains as if nothing were sewn.
struct SewnCloth {
  explicit SewnCloth(int domains) {
    const auto patches = testing::four_patches();
    stitches = testing::geometric_stitches(patches);
    model::ClothModel model =
        testing::cloth_model(testing::patchwork(patches), testing::cotton(1e-3));
    seams = mesh::resolve_seams(stitches, model.num_vertices(), testing::plain_names());
    const auto neighbors = mesh::seam_neighbors(model.triangles, seams);
    decomposition::Elements elements{model.triangles,      model.hinges, model.hinge_bends,
                                     model.num_vertices(), &seams,       neighbors};
    auto decomposition = decomposition::decompose(elements, {.domains = domains});
    elements.seams = nullptr;
    cloth.vertex_domains = decomposition::constraint_domains(elements, decomposition);
    cloth.num_domains = decomposition.num_domains;
    cloth.triangle_domain = decomposition.triangle_domain;
    cloth.hinge_domain = decomposition.hinge_domain;
    cloth.model = std::move(model);
  }
  [[nodiscard]] int size() const { return cloth.model.num_vertices(); }
  /// By the stitches themselves, not by T.
  [[nodiscard]] Dense rows() const { return testing::constraint_rows(stitches, size()); }
  [[nodiscard]] InterfaceDofs dofs(double fraction) const {
    return classify_dofs(cloth.matrices(), size(), {.corner_fraction = fraction}, seams);
  }
  [[nodiscard]] Dense solution(const Dense& b) const {
    return testing::solve_with_multipliers(cloth.K().toDense(), b, rows());
  }

  std::vector<mesh::Stitch> stitches;
  mesh::SeamMap seams;
  DecomposedCloth cloth;
};

std::vector<PrimalDualOptions> all_options() {
  std::vector<PrimalDualOptions> options;
  for (const DomainForm form : {DomainForm::Literal, DomainForm::OneSweep})
    for (const InterfaceKind kind :
         {InterfaceKind::Dense, InterfaceKind::Sparse, InterfaceKind::Recursive})
      for (const bool tree : {false, true})
        options.push_back({.form = form,
                           .interface = kind,
                           .max_refinements = 0,
                           .backend = tree ? tree_backend() : reference_backend()});
  return options;
}

TEST(SeamMultipliers, MatchOneDenseSolveWithMultipliers) {
  double worst = 0;
  double worst_gap = 0;
  for (const int domains : {1, 2, 3, 8, 32}) {
    const SewnCloth sewn(domains);
    const auto matrices = sewn.cloth.matrices();
    const RightHandSides b = testing::random_positions(sewn.size(), 1, 7);  // also on slaves
    const RightHandSides expected = sewn.solution(b);
    for (const double fraction : {0.0, 0.5, 1.0}) {
      const InterfaceDofs dofs = sewn.dofs(fraction);
      for (const PrimalDualOptions& options : all_options()) {
        SCOPED_TRACE(::testing::Message() << domains << " domains, fraction " << fraction << ", "
                                          << static_cast<int>(options.form) << " "
                                          << static_cast<int>(options.interface));
        PrimalDual solver;
        RightHandSides x = b;
        ASSERT_EQ(solver.factor(matrices, dofs, options), SolveStatus::Ok);
        ASSERT_EQ(solver.solve(x), SolveStatus::Ok);
        EXPECT_LT(relative_error(x, expected), 1e-10);
        EXPECT_LT((sewn.rows() * x).cwiseAbs().maxCoeff(), 1e-10 * x.cwiseAbs().maxCoeff());
        EXPECT_EQ(solver.report().num_seam_multipliers,
                  sewn.seams.num_slaves() - static_cast<int>(dofs.condensed_slaves.size()));
        EXPECT_LT(solver.last_times().error, 1e-12);
        worst = std::max(worst, relative_error(x, expected));
        worst_gap =
            std::max(worst_gap, (sewn.rows() * x).cwiseAbs().maxCoeff() / x.cwiseAbs().maxCoeff());
      }
    }
  }
  RecordProperty("error", ::testing::PrintToString(worst));
  RecordProperty("gap", ::testing::PrintToString(worst_gap));
}

/// Every row of a seam is in the tables once, its slave has a dual row to itself, and what carries
/// a condensed slave are corners.
TEST(SeamMultipliers, TablesAgree) {
  for (const int domains : {1, 2, 8, 32})
    for (const double fraction : {0.0, 0.5, 1.0}) {
      SCOPED_TRACE(::testing::Message() << domains << " domains, fraction " << fraction);
      const SewnCloth sewn(domains);
      const InterfaceDofs dofs = sewn.dofs(fraction);
      Dense found = Dense::Zero(dofs.num_multipliers(), sewn.size());
      Dense by_domain = found;  // the same from the domains' own tables
      for (int m = 0; m < dofs.num_multipliers(); ++m)
        dofs.visit_copies(m, [&](const DofCopy& copy, double coefficient) {
          const DomainDofs& domain = dofs.domains[static_cast<std::size_t>(copy.domain)];
          EXPECT_GE(copy.local, domain.num_internal);
          EXPECT_LT(copy.local, domain.num_remainder());
          found(m, domain.rows[static_cast<std::size_t>(copy.local)]) += coefficient;
        });
      for (const DomainDofs& domain : dofs.domains) {
        int last = -1;
        domain.visit_entries([&](int multiplier, int dual, double coefficient) {
          EXPECT_GE(multiplier, last);
          last = multiplier;
          by_domain(multiplier,
                    domain.rows[static_cast<std::size_t>(domain.num_internal + dual)]) +=
              coefficient;
        });
      }
      EXPECT_TRUE(found == by_domain);
      const int first = dofs.num_duplicates();
      for (std::size_t i = 0; i < dofs.seam_slaves.size(); ++i)
        EXPECT_EQ(found(first + static_cast<int>(i), dofs.seam_slaves[i]), 1);
      for (const SeamCorner& e : dofs.seam_corners)
        found(e.multiplier, dofs.corner_rows[static_cast<std::size_t>(e.corner)]) += e.coefficient;
      const Dense all = testing::constraint_rows(sewn.seams);
      for (std::size_t i = 0; i < dofs.seam_slaves.size(); ++i) {
        const int s = sewn.seams.row[static_cast<std::size_t>(dofs.seam_slaves[i])];
        EXPECT_TRUE(found.row(first + static_cast<int>(i)) == all.row(s));
      }
      EXPECT_TRUE(found.topRows(first) == Dense::Zero(first, sewn.size())) << "+1 and -1";
      for (const int slave : dofs.condensed_slaves) {
        EXPECT_EQ(std::count(dofs.corner_rows.begin(), dofs.corner_rows.end(), slave), 0);
        sewn.seams.visit_carriers(slave, [&](int carrier, double) {
          EXPECT_TRUE(
              std::binary_search(dofs.corner_rows.begin(), dofs.corner_rows.end(), carrier));
        });
      }
      EXPECT_EQ(dofs.seam_slaves.size() + dofs.condensed_slaves.size(), sewn.seams.slaves.size());
    }
}

TEST(SeamMultipliers, NoSeamsAllocateNothing) {
  const DecomposedCloth cloth = decompose_cloth(grid_cloth(9, 9), 4);
  const InterfaceDofs dofs = classify_dofs(cloth.matrices(), 81);
  EXPECT_EQ(dofs.seams.row.capacity(), 0U);
  EXPECT_EQ(dofs.seam_slaves.capacity(), 0U);
  EXPECT_EQ(dofs.seam_copies.capacity(), 0U);
  EXPECT_EQ(dofs.seam_copies_begin.capacity(), 0U);
  EXPECT_EQ(dofs.seam_corners.capacity(), 0U);
  for (const DomainDofs& domain : dofs.domains) EXPECT_EQ(domain.seam_entries.capacity(), 0U);
}

/// [Lu25, Eq. 11] dense and from its definition, with E apart.
struct Equation11 {
  Equation11(const SewnCloth& sewn, const InterfaceDofs& dofs, const Dense& b) {
    const Eigen::Index corners = dofs.num_corners();
    const Dense all = testing::constraint_rows(sewn.seams);
    std::vector<Eigen::Index> kept;
    for (const int slave : dofs.seam_slaves)
      kept.push_back(sewn.seams.row[static_cast<std::size_t>(slave)]);
    const auto seam_rows = static_cast<Eigen::Index>(kept.size());
    const Eigen::Index multipliers = dofs.num_duplicates() + seam_rows;
    std::vector<int> corner_of(static_cast<std::size_t>(sewn.size()), -1);
    for (Eigen::Index c = 0; c < corners; ++c)
      corner_of[static_cast<std::size_t>(dofs.corner_rows[static_cast<std::size_t>(c)])] =
          static_cast<int>(c);
    const auto is_corner = [&](int row) {
      return dofs.dof_class[static_cast<std::size_t>(row)] == DofClass::Corner;
    };

    G_RR = Dense::Zero(multipliers, multipliers);
    G_RC = E = Dense::Zero(multipliers, corners);
    G_CC = Dense::Zero(corners, corners);
    b_R = Dense::Zero(multipliers, 3);
    b_C = Dense::Zero(corners, 3);
    const auto add_B = [&](int row, auto&& target) {  // a row of B_C
      sewn.seams.visit_carriers(row, [&](int carrier, double weight) {
        target[corner_of[static_cast<std::size_t>(carrier)]] += weight;
      });
    };
    for (int row = 0; row < sewn.size(); ++row) {
      if (!is_corner(row)) continue;
      Eigen::VectorXd B = Eigen::VectorXd::Zero(corners);
      add_B(row, B);
      EXPECT_NEAR(B.sum(), 1, 1e-14);
      b_C += B * b.row(row);
      for (Eigen::Index i = 0; i < seam_rows; ++i)
        E.row(dofs.num_duplicates() + i) +=
            all(kept[static_cast<std::size_t>(i)], row) * B.transpose();
    }
    const auto domains = sewn.cloth.matrices();
    std::vector<char> placed(static_cast<std::size_t>(sewn.size()), 0);  // in the row of a seam
    for (std::size_t d = 0; d < domains.size(); ++d) {
      std::vector<int> R;
      std::vector<int> C;
      for (std::size_t i = 0; i < domains[d].rows.size(); ++i)
        (is_corner(domains[d].rows[i]) ? C : R).push_back(static_cast<int>(i));
      const Dense K = domains[d].K.toDense();
      const auto n_R = static_cast<Eigen::Index>(R.size());
      Dense S_D = Dense::Zero(multipliers, n_R);
      Dense b_d = Dense::Zero(n_R, 3);
      for (Eigen::Index i = 0; i < n_R; ++i) {
        const int row = domains[d].rows[static_cast<std::size_t>(R[static_cast<std::size_t>(i)])];
        const bool is_first = !placed[static_cast<std::size_t>(row)];
        placed[static_cast<std::size_t>(row)] = 1;
        if (is_first)
          for (Eigen::Index k = 0; k < seam_rows; ++k)
            S_D(dofs.num_duplicates() + k, i) = all(kept[static_cast<std::size_t>(k)], row);
        const auto duplicate =
            std::lower_bound(dofs.duplicate_rows.begin(), dofs.duplicate_rows.end(), row);
        const bool is_duplicate = duplicate != dofs.duplicate_rows.end() && *duplicate == row;
        if (is_duplicate) S_D(duplicate - dofs.duplicate_rows.begin(), i) = is_first ? 1 : -1;
        b_d.row(i) = b.row(row) * (is_duplicate ? 0.5 : 1);
      }
      Dense S_C = Dense::Zero(static_cast<Eigen::Index>(C.size()), corners);  // S_C^j B_C^j
      for (std::size_t i = 0; i < C.size(); ++i)
        add_B(domains[d].rows[static_cast<std::size_t>(C[i])],
              S_C.row(static_cast<Eigen::Index>(i)));
      const Dense inverse = Dense(K(R, R)).inverse();
      const Dense K_RC = Dense(K(R, C)) * S_C;
      G_RR += S_D * inverse * S_D.transpose();
      G_RC += S_D * inverse * K_RC;
      G_CC += S_C.transpose() * Dense(K(C, C)) * S_C - K_RC.transpose() * inverse * K_RC;
      b_R += S_D * inverse * b_d;
      b_C -= K_RC.transpose() * inverse * b_d;
    }
  }
  /// (G_CC + G^T G_RR^-1 G) x~_C = b_C* + G^T G_RR^-1 b_R*.
  [[nodiscard]] Dense corrected(const Dense& G) const {
    const Dense W = G_RR.inverse() * G;
    return (G_CC + G.transpose() * W).inverse() * (b_C + W.transpose() * b_R);
  }
  Dense G_RR, G_RC, G_CC, E, b_R, b_C;
};

// D18: as printed it misses by more than a tenth, and so does the corrected form without E.
TEST(SeamMultipliers, Equation11AsPrintedIsWrong) {
  for (const int domains : {2, 8}) {
    SCOPED_TRACE(domains);
    const SewnCloth sewn(domains);
    const InterfaceDofs dofs = sewn.dofs(0);
    ASSERT_GT(dofs.seam_corners.size(), 0U);
    const RightHandSides b = testing::random_positions(sewn.size(), 1, 5);
    const Dense expected = sewn.solution(b)(dofs.corner_rows, Eigen::all);
    const auto error = [&](const Dense& x) { return (x - expected).norm() / expected.norm(); };
    const Equation11 s(sewn, dofs, b);
    EXPECT_LT(error(s.corrected(s.G_RC - s.E)), 1e-10);
    EXPECT_GT(error(s.corrected(s.G_RC)), 0.1);
    const Dense printed =
        s.G_CC.inverse() * (s.b_C - s.G_RC.transpose() * s.G_RR.inverse() * s.b_R);
    EXPECT_GT(error(printed), 0.1);
  }
}

// It is G_RR that becomes singular, by rows all of whose entries are corners; these are condensed.
TEST(SeamMultipliers, RowsOfCornersAloneAreCondensed) {
  const SewnCloth sewn(8);
  const InterfaceDofs dofs = sewn.dofs(0.5);
  ASSERT_GT(dofs.condensed_slaves.size(), 0U);
  const Dense all = testing::constraint_rows(sewn.seams);
  int rows_of_corners = 0;
  for (Eigen::Index s = 0; s < all.rows(); ++s) {
    double outside = 0;
    for (int row = 0; row < sewn.size(); ++row)
      if (dofs.dof_class[static_cast<std::size_t>(row)] != DofClass::Corner)
        outside += std::abs(all(s, row));
    rows_of_corners += outside == 0;
  }
  EXPECT_EQ(rows_of_corners, static_cast<int>(dofs.condensed_slaves.size()));
  const Equation11 s(sewn, dofs, Dense::Zero(sewn.size(), 3));
  for (const Dense& G : {s.G_RR, s.G_CC}) {
    const Eigen::VectorXd eigenvalues = Eigen::SelfAdjointEigenSolver<Dense>(G).eigenvalues();
    EXPECT_GT(eigenvalues[0], 1e-6 * eigenvalues[eigenvalues.size() - 1]);
  }
}

TEST(SeamMultipliers, SameBitsForEveryNumberOfThreads) {
  const SewnCloth sewn(8);
  const auto matrices = sewn.cloth.matrices();
  for (const double fraction : {0.0, 0.5})
    for (PrimalDualOptions options : all_options()) {
      options.max_refinements = 1;
      options.refine_tolerance = 0;
      const auto solve = [&] {
        PrimalDual solver;
        RightHandSides x = testing::random_positions(sewn.size(), 1, 3);
        EXPECT_EQ(solver.factor(matrices, sewn.dofs(fraction), options), SolveStatus::Ok);
        EXPECT_EQ(solver.solve(x), SolveStatus::Ok);
        EXPECT_EQ(solver.refactor(matrices), SolveStatus::Ok);
        EXPECT_EQ(solver.solve(x), SolveStatus::Ok);
        return x;
      };
      const RightHandSides reference = ThreadPool(1).run(solve);
      for (const int threads : {2, 3, 8})
        EXPECT_TRUE(ThreadPool(threads).run(solve) == reference) << threads << " threads";
    }
}

TEST(SeamMultipliers, RefinementKeepsTheSeamsClosed) {
  SewnCloth sewn(8);
  for (std::size_t t = 0; t < sewn.cloth.model.stretch.size(); t += 2)
    sewn.cloth.model.stretch[t].weight *= 1e6;
  const RightHandSides b = testing::random_positions(sewn.size(), 1, 9);
  PrimalDual solver;
  RightHandSides x = b;
  ASSERT_EQ(solver.factor(sewn.cloth.matrices(), sewn.dofs(0), {.refine_tolerance = 1e-15}),
            SolveStatus::Ok);
  ASSERT_EQ(solver.solve(x), SolveStatus::Ok);
  EXPECT_GT(solver.last_times().refinements, 0);
  EXPECT_LT(solver.last_times().error, solver.last_times().first_error);
  EXPECT_LT((sewn.rows() * x).cwiseAbs().maxCoeff(), 1e-9 * x.cwiseAbs().maxCoeff());
}

TEST(SeamMultipliers, BadMatricesAreAStatus) {
  const SewnCloth sewn(8);
  const InterfaceDofs dofs = sewn.dofs(0.5);
  SewnCloth negative(8);  // at a slave with a multiplier, at a condensed one, at a corner
  const int rows[] = {dofs.seam_slaves[0], dofs.condensed_slaves[0], dofs.corner_rows[0]};
  SewnCloth nothing(8);
  for (auto& stretch : nothing.cloth.model.stretch) stretch.weight = 0;
  for (auto& bend : nothing.cloth.model.bend) bend.weight = 0;
  nothing.cloth.model.mass.setZero();
  for (const PrimalDualOptions& options : all_options()) {
    PrimalDual solver;
    RightHandSides b = RightHandSides::Constant(sewn.size(), 3, 42);
    const auto expect_refused = [&](std::span<const DomainMatrix> bad) {
      ASSERT_EQ(solver.factor(sewn.cloth.matrices(), dofs, options), SolveStatus::Ok);
      EXPECT_EQ(solver.refactor(bad), SolveStatus::NotPositiveDefinite);
      EXPECT_EQ(solver.solve(b), SolveStatus::NotFactored);
      EXPECT_EQ(solver.factor(bad, dofs, options), SolveStatus::NotPositiveDefinite);
      EXPECT_EQ(solver.solve(b), SolveStatus::NotFactored);
      EXPECT_TRUE(b == RightHandSides::Constant(sewn.size(), 3, 42));
    };
    for (const int row : rows) {
      negative.cloth.model.mass = sewn.cloth.model.mass;
      negative.cloth.model.mass[row] = -50;
      expect_refused(negative.cloth.matrices());
    }
    expect_refused(nothing.cloth.matrices());
    auto nan = sewn.cloth.matrices();
    nan[3].K.valuePtr()[20] = std::numeric_limits<double>::quiet_NaN();
    expect_refused(nan);
  }
}

TEST(SeamMultipliers, RefusesSeamsOfOtherRows) {
  const SewnCloth sewn(4);
  const auto matrices = sewn.cloth.matrices();
  const auto refused = [&](const mesh::SeamMap& seams) {
    EXPECT_THROW(static_cast<void>(classify_dofs(matrices, sewn.size(), {}, seams)), InputError);
  };
  mesh::SeamMap bad = sewn.seams;
  bad.row.pop_back();
  refused(bad);
  bad = sewn.seams;
  bad.carrier[0] = sewn.size();
  refused(bad);
  bad = sewn.seams;
  bad.carrier[0] = bad.slaves[1];
  refused(bad);
  bad = sewn.seams;
  bad.slaves[0] = -1;
  refused(bad);
  bad = sewn.seams;
  bad.weight.pop_back();
  refused(bad);
}

}  // namespace
}  // namespace piecework::global
