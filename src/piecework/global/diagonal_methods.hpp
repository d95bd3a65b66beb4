#pragma once

// Makers of the single methods behind make_diagonal_solver(). Private to the global module.

#include <memory>

#include <piecework/global/diagonal_update.hpp>

namespace piecework::global {

std::unique_ptr<DiagonalUpdateSolver> make_factor_update(DiagonalMethod method,
                                                         const DiagonalOptions& options);
std::unique_ptr<DiagonalUpdateSolver> make_low_rank_update(const DiagonalOptions& options);
std::unique_ptr<DiagonalUpdateSolver> make_frozen_schur(const DiagonalOptions& options);
std::unique_ptr<DiagonalUpdateSolver> make_inverse_k(bool steepest_descent,
                                                     const DiagonalOptions& options);
std::unique_ptr<DiagonalUpdateSolver> make_jacobi();
std::unique_ptr<DiagonalUpdateSolver> make_hybrid();
std::unique_ptr<DiagonalUpdateSolver> make_dual();

}  // namespace piecework::global
