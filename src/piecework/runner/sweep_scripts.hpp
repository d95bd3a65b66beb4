#pragma once

// A sweep as work for other programs: each runs `piecework sweep ... --shard i/n` once per case,
// and `piecework sweep` at the end, which writes the tables.

#include <string>
#include <vector>

#include <piecework/runner/sweep.hpp>

namespace piecework::runner {

struct ScriptOptions {
  std::string plan;       ///< as the script is to name it
  std::string directory;  ///< the same
};

/// For `make -k -j N`. \throws InputError if a name has characters that make cannot take.
std::string makefile(const std::vector<SweepJob>& jobs, const ScriptOptions& options);

/// For `sbatch`: an array with one task per case.
std::string slurm_script(const std::vector<SweepJob>& jobs, const ScriptOptions& options);

/// For `snakemake -k -j N`.
std::string snakefile(const std::vector<SweepJob>& jobs, const ScriptOptions& options);

}  // namespace piecework::runner
