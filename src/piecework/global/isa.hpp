#pragma once

// Instruction sets under the names by which users of the solvers know them.

#include <piecework/core/isa.hpp>

namespace piecework::global {

using piecework::available_isas;
using piecework::best_isa;
using piecework::Isa;
using piecework::to_string;

}  // namespace piecework::global
