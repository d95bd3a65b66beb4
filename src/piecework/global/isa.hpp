#pragma once

// Instruction sets that the kernels are built for.

#include <string>
#include <vector>

namespace piecework::global {

enum class Isa { Portable, Avx2, Avx512 };

/// The best one that this processor (and operating system) runs.
Isa best_isa();

/// All that this processor runs, best first.
std::vector<Isa> available_isas();

/// "AVX-512", "AVX2", "portable".
std::string to_string(Isa isa);

}  // namespace piecework::global
