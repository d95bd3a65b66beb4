#include <piecework/model/reduction.hpp>

#include <algorithm>

#include <piecework/core/parallel.hpp>

namespace piecework::model {
namespace {

/// Held vertices, and slaves, which have no unknown either.
std::vector<char> without_slaves(const ClothModel& model, std::vector<char> fixed) {
  for (const int v : model.sewing.map().slaves) fixed[static_cast<std::size_t>(v)] = 1;
  return fixed;
}

using Triplets = std::vector<Eigen::Triplet<double, int>>;

/// T_f^T e_row value e_column^T T_f.
void fold_entry(const Reduction& reduction, const mesh::SeamMap& seams, int row, int column,
                double value, Triplets& triplets) {
  seams.visit_carriers(column, [&](int c, double c_weight) {
    seams.visit_carriers(row, [&](int r, double r_weight) {
      if (reduction.number(c) >= 0 && reduction.number(r) >= 0)
        triplets.emplace_back(reduction.number(r), reduction.number(c),
                              r_weight * c_weight * value);
    });
  });
}

}  // namespace

Reduction::Reduction(const ClothModel& model, const std::vector<char>& fixed)
    : model_(&model), free_(without_slaves(model, fixed)) {}

SparseMatrix Reduction::system(const SparseMatrix& K) const {
  if (model_->sewing.empty()) return restrict_to_free(K, free_);
  Triplets triplets;
  triplets.reserve(static_cast<std::size_t>(K.nonZeros()));
  for (int column = 0; column < K.outerSize(); ++column)
    for (SparseMatrix::InnerIterator it(K, column); it; ++it)
      fold_entry(*this, model_->sewing.map(), static_cast<int>(it.row()), column, it.value(),
                 triplets);
  SparseMatrix reduced(count(), count());
  reduced.setFromTriplets(triplets.begin(), triplets.end());
  return reduced;
}

DomainMatrix Reduction::folded_share(const DomainMatrix& share) const {
  Triplets triplets;
  const auto vertex_of = [&](Eigen::Index i) { return share.rows[static_cast<std::size_t>(i)]; };
  for (int column = 0; column < share.K.outerSize(); ++column)
    for (SparseMatrix::InnerIterator it(share.K, column); it; ++it)
      fold_entry(*this, model_->sewing.map(), vertex_of(it.row()), vertex_of(column), it.value(),
                 triplets);
  DomainMatrix result;
  for (const auto& entry : triplets) result.rows.push_back(entry.row());
  std::sort(result.rows.begin(), result.rows.end());
  result.rows.erase(std::unique(result.rows.begin(), result.rows.end()), result.rows.end());
  const auto local = [&](int unknown) {
    return static_cast<int>(std::lower_bound(result.rows.begin(), result.rows.end(), unknown) -
                            result.rows.begin());
  };
  for (auto& entry : triplets) entry = {local(entry.row()), local(entry.col()), entry.value()};
  const auto size = static_cast<Eigen::Index>(result.rows.size());
  result.K.resize(size, size);
  result.K.setFromTriplets(triplets.begin(), triplets.end());
  return result;
}

std::vector<DomainMatrix> Reduction::systems(std::span<const DomainMatrix> shares) const {
  if (model_->sewing.empty()) return restrict_to_free(shares, free_);
  std::vector<DomainMatrix> result;
  result.reserve(shares.size());
  for (const DomainMatrix& share : shares) result.push_back(folded_share(share));
  return result;
}

template <class Increment>
void Reduction::advance_slaves(double step, const Increment& increment, Positions& x) const {
  const mesh::SeamMap& seams = model_->sewing.map();
  parallel_for(seams.slaves.size(), [&](std::size_t s) {
    Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
    seams.visit_carriers(seams.slaves[s], [&](int carrier, double weight) {
      if (number(carrier) >= 0) sum += weight * increment.row(number(carrier));
    });
    x.row(seams.slaves[s]) += step * sum;
  });
}

void Reduction::advance(const Unknowns& increment, Positions& x) const {
  parallel_for(static_cast<std::size_t>(count()), [&](std::size_t i) {
    x.row(free_.vertex[i]) += increment.row(static_cast<Eigen::Index>(i));
  });
  advance_slaves(1.0, increment, x);
}

void Reduction::advance(const Positions& x, double step, const Positions& increment,
                        Positions& out) const {
  out.resize(x.rows(), 3);
  parallel_for(free_.number.size(), [&](std::size_t v) {
    const auto row = static_cast<Eigen::Index>(v);
    const int unknown = free_.number[v];
    if (unknown < 0)
      out.row(row) = x.row(row);
    else
      out.row(row) = x.row(row) + step * increment.row(unknown);
  });
  advance_slaves(step, increment, out);
}

void Reduction::gather(const Positions& f, Positions& reduced) const {
  reduced.resize(count(), 3);
  parallel_for(static_cast<std::size_t>(count()), [&](std::size_t i) {
    reduced.row(static_cast<Eigen::Index>(i)) = row(f, static_cast<int>(i));
  });
}

}  // namespace piecework::model
