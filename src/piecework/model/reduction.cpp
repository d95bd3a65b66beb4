#include <piecework/model/reduction.hpp>

#include <piecework/core/parallel.hpp>

namespace piecework::model {
namespace {

/// Held vertices, and slaves, which have no unknown either.
std::vector<char> without_slaves(const ClothModel& model, std::vector<char> fixed) {
  for (const int v : model.sewing.map().slaves) fixed[static_cast<std::size_t>(v)] = 1;
  return fixed;
}

}  // namespace

Reduction::Reduction(const ClothModel& model, const std::vector<char>& fixed)
    : model_(&model), free_(without_slaves(model, fixed)) {}

SparseMatrix Reduction::system(const SparseMatrix& K) const {
  if (model_->sewing.empty()) return restrict_to_free(K, free_);
  const mesh::SeamMap& seams = model_->sewing.map();
  std::vector<Eigen::Triplet<double, int>> triplets;
  triplets.reserve(static_cast<std::size_t>(K.nonZeros()));
  for (int column = 0; column < K.outerSize(); ++column)
    for (SparseMatrix::InnerIterator it(K, column); it; ++it)
      seams.visit_carriers(column, [&](int c, double c_weight) {
        seams.visit_carriers(static_cast<int>(it.row()), [&](int r, double r_weight) {
          if (number(c) >= 0 && number(r) >= 0)
            triplets.emplace_back(number(r), number(c), r_weight * c_weight * it.value());
        });
      });
  SparseMatrix reduced(count(), count());
  reduced.setFromTriplets(triplets.begin(), triplets.end());
  return reduced;
}

void Reduction::advance(const Unknowns& increment, Positions& x) const {
  parallel_for(static_cast<std::size_t>(count()), [&](std::size_t i) {
    x.row(free_.vertex[i]) += increment.row(static_cast<Eigen::Index>(i));
  });
  const mesh::SeamMap& seams = model_->sewing.map();
  parallel_for(seams.slaves.size(), [&](std::size_t s) {
    Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
    seams.visit_carriers(seams.slaves[s], [&](int carrier, double weight) {
      if (number(carrier) >= 0) sum += weight * increment.row(number(carrier));
    });
    x.row(seams.slaves[s]) += sum;
  });
}

}  // namespace piecework::model
