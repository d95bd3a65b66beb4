#pragma once

// Private to the module: whether a run had its processors to itself.

#include <piecework/runner/record.hpp>

namespace piecework::runner {

/// Other work took processors that this run wanted. Asked on the machine and right after the run.
bool is_disturbed(const RunRecord& record);

}  // namespace piecework::runner
