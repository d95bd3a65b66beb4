#pragma once

// The paper's primal-dual global solve for cloth: domains share out the constraints.

#include <memory>

#include <piecework/decomposition/decomposition.hpp>
#include <piecework/global/exact_solver.hpp>
#include <piecework/global/primal_dual.hpp>
#include <piecework/model/constraints.hpp>

namespace piecework::pd {

struct PrimalDualStepOptions {
  /// Share of the two-domain vertices that become corners; 0.5 in all rows of [Lu25, Table 1].
  double corner_fraction = 0.5;
  global::PrimalDualOptions solver;
};

/// Solves K~ dx = b by domains: every constraint counts in the domain that owns it, mass is shared
/// by multiplicity (docs/architecture.md, D11), held vertices and slaves of seams are eliminated in
/// each share. The matrix given to factor() must be that of the model and step.
/// \param model    must outlive the solver
/// \param domains  of the model's elements
/// \param h        time step, s
/// \throws InputError from factor() if the interface is too large; see PrimalDual::factor().
std::unique_ptr<global::ExactSolver> make_primal_dual_solver(
    const model::ClothModel& model, const decomposition::Decomposition& domains, double h,
    const PrimalDualStepOptions& options);

}  // namespace piecework::pd
