#include <piecework/model/hessian_matrix.hpp>

#include <algorithm>
#include <numeric>
#include <utility>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/model/projection.hpp>

namespace piecework::model {

HessianMatrix::HessianMatrix(const ClothModel& model)
    : model_(model), stretch_(model.stretch.size()) {
  for (std::size_t i = 0; i < model.bend.size(); ++i)
    if (model.bend[i].rest_length > 0) curved_.push_back(static_cast<int>(i));
  bend_.resize(curved_.size());
}

int HessianMatrix::entry(int row, int column) const {
  const int* first = system_.innerIndexPtr() + system_.outerIndexPtr()[column];
  const int* last = system_.innerIndexPtr() + system_.outerIndexPtr()[column + 1];
  const int* found = std::lower_bound(first, last, row);
  PIECEWORK_ASSERT(found != last && *found == row);
  return static_cast<int>(found - system_.innerIndexPtr());
}

void HessianMatrix::add_pair(const Reduction& reduction, int row_vertex, int column_vertex, Use use,
                             std::vector<Addition>& additions) const {
  const mesh::SeamMap& seams = model_.sewing.map();
  seams.visit_carriers(column_vertex, [&](int c, double c_weight) {
    seams.visit_carriers(row_vertex, [&](int r, double r_weight) {
      if (reduction.number(r) >= 0 && reduction.number(c) >= 0)
        additions.push_back({entry(reduction.number(r), reduction.number(c)),
                             {use.source, use.factor * r_weight * c_weight}});
    });
  });
}

HessianMatrix::Uses HessianMatrix::sorted(const std::vector<Addition>& additions) const {
  Uses uses;
  uses.begin.assign(static_cast<std::size_t>(system_.nonZeros()) + 1, 0);
  for (const Addition& addition : additions)
    ++uses.begin[static_cast<std::size_t>(addition.entry) + 1];
  std::partial_sum(uses.begin.begin(), uses.begin.end(), uses.begin.begin());
  uses.use.resize(additions.size());
  std::vector<std::int64_t> cursor(uses.begin.begin(), uses.begin.end() - 1);
  for (const Addition& addition : additions)
    uses.use[static_cast<std::size_t>(cursor[static_cast<std::size_t>(addition.entry)]++)] =
        addition.use;
  return uses;
}

void HessianMatrix::set_pattern(const Reduction& reduction, SparseMatrix system) {
  system_ = std::move(system);
  system_.makeCompressed();
  std::vector<Addition> additions;
  additions.reserve(9 * model_.stretch.size());
  for (std::size_t t = 0; t < model_.stretch.size(); ++t)
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t b = 0; b < 3; ++b)
        add_pair(reduction, model_.stretch[t].vertices[a], model_.stretch[t].vertices[b],
                 {static_cast<std::int64_t>(9 * t + 3 * a + b), 1.0}, additions);
  triangle_uses_ = sorted(additions);
  additions.clear();
  for (std::size_t i = 0; i < curved_.size(); ++i) {
    const auto& c = model_.bend[static_cast<std::size_t>(curved_[i])];
    for (std::size_t a = 0; a < 4; ++a)
      for (std::size_t b = 0; b < 4; ++b)
        add_pair(reduction, c.vertices[a], c.vertices[b],
                 {static_cast<std::int64_t>(i), c.coefficient[a] * c.coefficient[b]}, additions);
  }
  hinge_uses_ = sorted(additions);
  scalars_.resize(0, 0);
}

bool HessianMatrix::is_scalar(int entry) const {
  const auto k = static_cast<std::size_t>(entry);
  return triangle_uses_.begin[k] == triangle_uses_.begin[k + 1] &&
         hinge_uses_.begin[k] == hinge_uses_.begin[k + 1];
}

Mat3 HessianMatrix::gathered(int entry) const {
  const auto k = static_cast<std::size_t>(entry);
  Mat3 block = system_.valuePtr()[k] * Mat3::Identity();
  for (auto u = triangle_uses_.begin[k]; u < triangle_uses_.begin[k + 1]; ++u) {
    const Use& use = triangle_uses_.use[static_cast<std::size_t>(u)];
    const auto pair = static_cast<int>(use.source % 9);
    block -=
        use.factor * stretch_[static_cast<std::size_t>(use.source / 9)].block(pair / 3, pair % 3);
  }
  for (auto u = hinge_uses_.begin[k]; u < hinge_uses_.begin[k + 1]; ++u) {
    const Use& use = hinge_uses_.use[static_cast<std::size_t>(u)];
    block -= use.factor * bend_[static_cast<std::size_t>(use.source)];
  }
  return block;
}

void HessianMatrix::evaluate(const Positions& x, const StepProblem& problem, HessianForm form) {
  parallel_for(stretch_.size(), [&](std::size_t t) {
    const StretchConstraint& c = model_.stretch[t];
    const Mat32 F = deformation_gradient(c, x);
    Mat32 R;
    project_stretch(c, F, *problem.previous, model_.start, R);
    stretch_[t] = stretch_softening(c, F, R, form);
  });
  parallel_for(bend_.size(), [&](std::size_t i) {
    const auto& c = model_.bend[static_cast<std::size_t>(curved_[i])];
    bend_[i] = bend_softening(c, x, form);
  });
}

void HessianMatrix::assemble(const Positions& x, const StepProblem& problem, HessianForm form) {
  evaluate(x, problem, form);
  complete();
}

void HessianMatrix::complete() {
  blocks_.resize(static_cast<std::size_t>(system_.nonZeros()));
  parallel_for(blocks_.size(), [&](std::size_t k) { blocks_[k] = gathered(static_cast<int>(k)); });
}

void HessianMatrix::multiply(const Positions& x, Positions& y) const {
  y.resize(count(), 3);
  const int* begin = system_.outerIndexPtr();
  const int* row = system_.innerIndexPtr();
  parallel_for(static_cast<std::size_t>(count()), [&](std::size_t column) {
    Vec3 sum = Vec3::Zero();
    // H is symmetric: row `column` of H is its column, transposed.
    for (int k = begin[column]; k < begin[column + 1]; ++k)
      sum += block(k).transpose() * x.row(row[k]).transpose();
    y.row(static_cast<Eigen::Index>(column)) = sum.transpose();
  });
}

void HessianMatrix::make_scalar_pattern() {
  std::vector<int> begin{0};
  std::vector<int> rows;
  for (int column = 0; column < 3 * count(); ++column) {
    for (SparseMatrix::InnerIterator it(system_, column / 3); it; ++it)
      for (int c = 0; c < 3; ++c)
        if (3 * static_cast<int>(it.row()) + c >= column)
          rows.push_back(3 * static_cast<int>(it.row()) + c);
    begin.push_back(static_cast<int>(rows.size()));
  }
  scalars_.resize(3 * count(), 3 * count());
  scalars_.resizeNonZeros(static_cast<Eigen::Index>(rows.size()));
  std::copy(begin.begin(), begin.end(), scalars_.outerIndexPtr());
  std::copy(rows.begin(), rows.end(), scalars_.innerIndexPtr());
}

const SparseMatrix& HessianMatrix::scalars() {
  blocks_.resize(static_cast<std::size_t>(system_.nonZeros()));  // the pattern alone may be wanted
  if (scalars_.rows() == 0) make_scalar_pattern();
  const int* begin = system_.outerIndexPtr();
  const int* row = system_.innerIndexPtr();
  parallel_for(static_cast<std::size_t>(count()), [&](std::size_t column) {
    for (int j = 0; j < 3; ++j) {
      double* out = scalars_.valuePtr() + scalars_.outerIndexPtr()[3 * column + j];
      for (int k = begin[column]; k < begin[column + 1]; ++k) {
        if (row[k] < static_cast<int>(column)) continue;
        for (int i = row[k] == static_cast<int>(column) ? j : 0; i < 3; ++i)
          *out++ = block(k)(i, j);
      }
    }
  });
  return scalars_;
}

}  // namespace piecework::model
