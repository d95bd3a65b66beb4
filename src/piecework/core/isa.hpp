#pragma once

// Instruction sets that hot kernels are built for, one source file each; chosen at run time.

#include <string>
#include <vector>

namespace piecework {

enum class Isa { Portable, Avx2, Avx512 };

/// The best one that this processor (and operating system) runs.
Isa best_isa();

/// True if this processor runs it.
bool runs(Isa isa);

/// All that this processor runs, best first.
std::vector<Isa> available_isas();

/// "AVX-512", "AVX2", "portable".
std::string to_string(Isa isa);

}  // namespace piecework
