#pragma once

// The solver that a scene names, made for its world.

#include <memory>

#include <piecework/global/exact_solver.hpp>
#include <piecework/model/integrator.hpp>
#include <piecework/runner/world.hpp>

namespace piecework::runner {

/// The exact global solve that the scene asks for, not yet factored. \pre `world` outlives it.
std::unique_ptr<global::ExactSolver> make_exact_solver(const World& world);

/// The method that the scene asks for. \pre `world` outlives it.
std::unique_ptr<model::Minimizer> make_minimizer(const World& world);

/// Distance at which contact begins, m: the scene's, or one that suits the mesh.
/// \throws InputError if the mesh is too fine for it: neighbours would touch.
double contact_distance(const World& world);

/// The scene lets anything touch.
bool may_touch(const World& world);

/// \throws InputError if something may touch, but not with this method or this distance.
void require_contact(const World& world);

/// What the scene lets touch, or null. \pre `world` outlives it.
std::unique_ptr<model::ContactTerms> make_contact(const World& world);

/// The integrator that the scene asks for. \pre `world` outlives it.
std::unique_ptr<model::Integrator> make_integrator(const World& world);

}  // namespace piecework::runner
