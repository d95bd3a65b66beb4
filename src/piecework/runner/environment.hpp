#pragma once

// Where a result was measured: machine, compiler, libraries. Printed with every table.

#include <string>
#include <utility>
#include <vector>

namespace piecework::runner {

/// Label and value, in the order in which they are shown.
using Environment = std::vector<std::pair<std::string, std::string>>;

/// CPU model, cores and kinds, hypervisor, kernel, memory, compiler, flags, revision, libraries.
Environment describe_environment();

/// As a JSON object.
std::string to_json(const Environment& environment);

/// 1-minute load average.
double load_average();

/// Processor time since the machine started, s: of everything (time that a hypervisor took away
/// included) and of this process.
struct CpuTime {
  double machine = 0;
  double process = 0;
};
CpuTime cpu_time();

}  // namespace piecework::runner
