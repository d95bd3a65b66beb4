#pragma once

// The second derivative of the cloth's own energy, to be multiplied with many vectors.

#include <vector>

#include <piecework/model/hessian_matrix.hpp>

namespace piecework::pd {

/// H as model::HessianMatrix has evaluated it, rounded to 32 bits, on the n_f unknowns. Pairs that
/// only a flat hinge couples have a multiple of the identity there, whatever the positions: they
/// are kept as one number (in a regular mesh 6 of a row's 13 blocks). Same bits for every number of
/// threads.
class HessianProduct {
 public:
  /// Takes the pattern and what does not change with the positions.
  void set_pattern(const model::HessianMatrix& hessian);

  /// Takes the rest. \pre hessian.evaluate(), and set_pattern() since its last set_pattern()
  void take(const model::HessianMatrix& hessian);

  /// product = H d, sums in 64 bits; both n_f x 3, m -> N.
  void multiply(const Positions& d, Positions& product) const;

  /// Number of block rows, n_f.
  [[nodiscard]] int count() const { return static_cast<int>(dense_.begin.size()) - 1; }

  /// What a product reads of the matrix.
  [[nodiscard]] double bytes() const;

 private:
  /// Entries of H row by row, each with where the d starts that it is multiplied with.
  struct Rows {
    std::vector<int> begin;
    std::vector<int> offset;
    std::vector<float> numbers;
  };
  /// A block of the matrix and where it and its mirror image belong in dense_.
  struct Pair {
    int block, place, mirror;
  };

  Rows dense_{{0}, {}, {}};   ///< 9 numbers each, and one more at the end
  Rows scalar_{{0}, {}, {}};  ///< 1 number each
  std::vector<Pair> pairs_;
};

}  // namespace piecework::pd
