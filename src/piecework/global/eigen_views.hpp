#pragma once

// Eigen's matrices as the plain spans that the solvers take. The matrix must outlive the view.

#include <piecework/core/types.hpp>
#include <piecework/global/pattern.hpp>

namespace piecework::global {

/// \pre K is compressed.
inline SymmetricPattern pattern_of(const SparseMatrix& K) {
  return {{K.outerIndexPtr(), static_cast<std::size_t>(K.outerSize()) + 1},
          {K.innerIndexPtr(), static_cast<std::size_t>(K.nonZeros())}};
}

inline std::span<const double> values_of(const SparseMatrix& K) {
  return {K.valuePtr(), static_cast<std::size_t>(K.nonZeros())};
}

}  // namespace piecework::global
