#pragma once

// An independent minimiser of the incremental potential for small cloths. Shares no formula code
// with the solvers: energies from singular values in extended precision, derivatives by central
// differences, dense Newton.

#include <piecework/core/types.hpp>
#include <piecework/mesh/triangle_mesh.hpp>
#include <piecework/model/constraints.hpp>

namespace piecework::testing {

struct OracleProblem {
  const mesh::TriangleMesh* rest = nullptr;  ///< rest shape, m
  model::Material material;
  double h = 0;             ///< s
  Positions predicted;      ///< z, m
  std::vector<char> fixed;  ///< per vertex
};

/// E(x), J (inertia of fixed vertices left out).
double oracle_energy(const OracleProblem& problem, const Positions& x);

/// dE/dx at free vertices, N; zero at fixed ones.
Positions oracle_gradient(const OracleProblem& problem, const Positions& x);

/// Newton's method from x; returns the stationary point.
/// \throws std::runtime_error if it does not converge in 50 iterations.
Positions oracle_minimize(const OracleProblem& problem, Positions x);

}  // namespace piecework::testing
