#pragma once

// The paper's primal-dual global solve for cloth: domains share out the constraints.

#include <memory>

#include <piecework/decomposition/decomposition.hpp>
#include <piecework/global/exact_solver.hpp>
#include <piecework/global/primal_dual.hpp>
#include <piecework/model/constraints.hpp>

namespace piecework::pd {

/// How seams enter the primal-dual solve.
enum class SeamForm {
  Elimination,  ///< slaves are eliminated in every domain's share (docs/architecture.md, D17)
  Dual,         ///< slaves stay, tied to what carries them by multipliers [Lu25, Sec. 4.4] (D18)
};

struct PrimalDualStepOptions {
  /// Share of the two-domain vertices that become corners; 0.5 in all rows of [Lu25, Table 1].
  double corner_fraction = 0.5;
  SeamForm seams = SeamForm::Elimination;
  global::PrimalDualOptions solver;
};

/// Solves K~ dx = b by domains: every constraint counts in the domain that owns it, mass is shared
/// by multiplicity (docs/architecture.md, D11), held vertices and, with SeamForm::Elimination,
/// slaves of seams are eliminated in each share. With SeamForm::Dual the unknowns stay those of K~;
/// inside, every slave that can move is one more, its share of the right-hand side already with its
/// carriers. The matrix given to factor() must be that of the model and step.
/// \param model    must outlive the solver
/// \param domains  of the model's elements, the seams included
/// \param h        time step, s
/// \throws InputError from factor() if the interface is too large; see PrimalDual::factor().
std::unique_ptr<global::ExactSolver> make_primal_dual_solver(
    const model::ClothModel& model, const decomposition::Decomposition& domains, double h,
    const PrimalDualStepOptions& options);

}  // namespace piecework::pd
