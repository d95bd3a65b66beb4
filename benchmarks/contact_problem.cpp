#include "contact_problem.hpp"

#include <algorithm>
#include <stdexcept>

#include <piecework/core/random.hpp>
#include <piecework/global/cholmod_solver.hpp>
#include <piecework/global/eigen_views.hpp>
#include <piecework/mesh/generate.hpp>
#include <piecework/model/assembly.hpp>
#include <piecework/testing/small_cloths.hpp>

#include "bench.hpp"

namespace piecework::bench {
namespace {

constexpr double kH = 1.0 / 120;       // s
constexpr double kContactPart = 0.25;  // of the vertices, as in the paper's Fig. 8

void require(global::SolveStatus status) {
  if (status != global::SolveStatus::Ok) throw std::runtime_error("no factor");
}

}  // namespace

ContactSheet::ContactSheet(std::int64_t vertices)
    : tree({.precision = global::Precision::Single, .contraction_limit = 1}) {
  const auto mesh =
      mesh::generate(mesh::GeneratorKind::Sheet, {.columns = side_of(vertices),
                                                  .rows = side_of(vertices),
                                                  .pattern = mesh::SheetPattern::Delaunay})
          .mesh;
  X = mesh.positions;
  K = model::assemble_system(testing::cloth_model(mesh, testing::cotton()), kH);
  stretching = testing::cotton().stretching;
  tree.analyze(global::pattern_of(K));
  require(tree.factor(global::values_of(K)));
}

ContactProblem::ContactProblem(const ContactSheet& sheet, testing::ContactSet set, double ratio)
    : D(static_cast<std::size_t>(sheet.K.rows()), 0.0) {
  const int count = static_cast<int>(kContactPart * static_cast<double>(D.size()));
  for (const int v : testing::contact_vertices(sheet.X, set, count))
    D[static_cast<std::size_t>(v)] = ratio * sheet.stretching;
  b = testing::contact_forces(sheet.X, D);
  SparseMatrix A = sheet.K;
  for (int v = 0; v < A.cols(); ++v) A.coeffRef(v, v) += D[static_cast<std::size_t>(v)];
  global::CholmodSolver oracle;
  require(oracle.factor(A));
  exact = Positions::Zero(b.rows(), 3);
  for (int step = 0; step < 2; ++step) {
    global::RightHandSides change = b - A * exact;
    require(oracle.solve(change));
    exact += change;
  }
  largest = exact.lpNorm<Eigen::Infinity>();
}

double ContactProblem::error(const Positions& x) const {
  return (x - exact).lpNorm<Eigen::Infinity>() / largest;
}

std::vector<double> changed_contacts(const std::vector<double>& D, int count) {
  std::vector<int> in;
  std::vector<int> out;
  for (std::size_t v = 0; v < D.size(); ++v) (D[v] > 0 ? in : out).push_back(static_cast<int>(v));
  std::vector<double> result = D;
  const double weight = *std::max_element(D.begin(), D.end());
  Random random(2);
  const auto take = [&](std::vector<int>& from, int number, double value) {
    for (int k = 0; k < number && !from.empty(); ++k) {
      const auto at = static_cast<std::size_t>(random.next() % from.size());
      result[static_cast<std::size_t>(from[at])] = value;
      from[at] = from.back();
      from.pop_back();
    }
  };
  take(in, (count + 1) / 2, 0);
  take(out, count / 2, weight);
  return result;
}

}  // namespace piecework::bench
