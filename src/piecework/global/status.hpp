#pragma once

// What every exact solver says about its work.

#include <cstddef>
#include <string>

namespace piecework::global {

/// Outcome of factor() and solve().
enum class SolveStatus {
  Ok,
  NotPositiveDefinite,  ///< no factor is kept
  OutOfMemory,          ///< no factor is kept
  NotFactored,          ///< solve() came without a successful factor(); output not written
};

struct FactorReport {
  double analyze_ms = 0;            ///< ordering and symbolic analysis; 0 if the pattern was known
  double factor_ms = 0;             ///< numeric factorisation
  double nonzeros = 0;              ///< nnz(L), structural
  double flops = 0;                 ///< of one numeric factorisation
  std::size_t bytes = 0;            ///< of the stored factor
  double reciprocal_condition = 0;  ///< crude estimate: (smallest / largest pivot of L)^2
};

}  // namespace piecework::global
