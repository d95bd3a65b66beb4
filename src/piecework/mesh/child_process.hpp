#pragma once

// Work on hostile input in a forked child with limits. Internal to mesh/.

#include <cstddef>
#include <functional>
#include <string>

namespace piecework::mesh {

struct ChildLimits {
  /// Address space the child may take beyond what this process has, bytes. Not enforced under the
  /// address and thread sanitizers, which reserve terabytes.
  std::size_t memory_bytes = std::size_t{8} << 30;
  unsigned seconds = 120;  ///< wall-clock and CPU time
};

/// Runs `work` in a forked child and returns what it returned. The child has its own memory, no
/// terminal output and no core file, and ends with this process.
/// Thread behaviour: may be called from any thread; `work` must not need other threads.
/// \throws InputError "<name>: ..." if the child crashed, ran out of time or memory, or if `work`
///         threw (with the text it threw).
std::string run_in_child(const std::string& name, const std::function<std::string()>& work,
                         const ChildLimits& limits = {});

}  // namespace piecework::mesh
