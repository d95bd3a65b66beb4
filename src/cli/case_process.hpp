#pragma once

// This program as a child of itself: a case of a sweep that crashes or runs out of memory takes
// nothing with it, and finds no memory warmed or cut up by the cases before it.

#include <filesystem>
#include <string>
#include <vector>

namespace piecework::cli {

struct ChildEnd {
  int exit_code = 0;     ///< 128 + signal if a signal killed it
  bool stopped = false;  ///< it ended because it was told to stop
};

/// Runs `piecework <arguments>`; what it prints goes into `log`. A stop_signal() is passed on once.
/// The child stops at its next frame if this process dies.
/// \throws OutputError if the child cannot be started.
ChildEnd run_piecework(const std::vector<std::string>& arguments, const std::filesystem::path& log);

}  // namespace piecework::cli
