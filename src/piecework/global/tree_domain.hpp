#pragma once

// The tree as the engine of the primal-dual solver: factors of domains and of the interface.

#include <piecework/global/domain_factor.hpp>

namespace piecework::global {

/// TreeSolver, in 64 bits, for DomainFactor and CondensedDomain.
DomainBackend tree_backend();

}  // namespace piecework::global
