#include <piecework/model/assembly.hpp>

namespace piecework::model {
namespace {

using Triplets = std::vector<Eigen::Triplet<double, int>>;

/// Adds w c c^T for a constraint that sees its vertices through one row c of A.
template <std::size_t N>
void add_row(const std::array<int, N>& vertices, const std::array<double, N>& c, double weight,
             Triplets& triplets) {
  for (std::size_t a = 0; a < N; ++a)
    for (std::size_t b = 0; b < N; ++b)
      triplets.emplace_back(vertices[a], vertices[b], weight * c[a] * c[b]);
}

}  // namespace

SparseMatrix assemble_system(const ClothModel& model, double h) {
  Triplets triplets;
  triplets.reserve(static_cast<std::size_t>(model.num_vertices()) + 18 * model.stretch.size() +
                   16 * model.bend.size());
  for (int v = 0; v < model.num_vertices(); ++v)
    triplets.emplace_back(v, v, model.mass[v] / (h * h));
  for (const StretchConstraint& c : model.stretch)
    for (int k = 0; k < 2; ++k) {  // column k of F = sum_a x_a g_a
      const double g1 = c.rest_inverse(0, k);
      const double g2 = c.rest_inverse(1, k);
      add_row<3>(c.vertices, {-(g1 + g2), g1, g2}, c.weight, triplets);
    }
  for (const BendConstraint& c : model.bend)
    add_row<4>(c.vertices, c.coefficient, c.weight, triplets);
  SparseMatrix K(model.num_vertices(), model.num_vertices());
  K.setFromTriplets(triplets.begin(), triplets.end());
  return K;
}

FreeVertices::FreeVertices(const std::vector<char>& fixed) : number(fixed.size(), -1) {
  for (std::size_t v = 0; v < fixed.size(); ++v) {
    if (fixed[v]) continue;
    number[v] = static_cast<int>(vertex.size());
    vertex.push_back(static_cast<int>(v));
  }
}

SparseMatrix restrict_to_free(const SparseMatrix& K, const FreeVertices& free) {
  Triplets triplets;
  triplets.reserve(static_cast<std::size_t>(K.nonZeros()));
  for (int column = 0; column < K.outerSize(); ++column) {
    const int free_column = free.number[static_cast<std::size_t>(column)];
    if (free_column < 0) continue;
    for (SparseMatrix::InnerIterator it(K, column); it; ++it) {
      const int free_row = free.number[static_cast<std::size_t>(it.row())];
      if (free_row >= 0) triplets.emplace_back(free_row, free_column, it.value());
    }
  }
  SparseMatrix result(free.count(), free.count());
  result.setFromTriplets(triplets.begin(), triplets.end());
  return result;
}

}  // namespace piecework::model
