#pragma once

// The subcommands of `piecework`, one file each. Every function adds its options to the program
// and leaves behind what to do; main() runs it and turns exceptions into exit codes.

#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace CLI {
class App;
}

namespace piecework::cli {

/// Set by main() from -q and -v.
struct Verbosity {
  bool quiet = false;
  bool verbose = false;
};

/// What the chosen subcommand does; returns the exit code.
using Action = std::function<int()>;

void add_run(CLI::App& program, Action& action, const Verbosity& verbosity);
void add_render(CLI::App& program, Action& action, const Verbosity& verbosity);
void add_partition(CLI::App& program, Action& action, const Verbosity& verbosity);
void add_tune(CLI::App& program, Action& action, const Verbosity& verbosity);
void add_compare(CLI::App& program, Action& action);
void add_sweep(CLI::App& program, Action& action, const Verbosity& verbosity);
void add_ccd(CLI::App& program, Action& action);
void add_check(CLI::App& program, Action& action);
void add_env(CLI::App& program, Action& action);
void add_schema(CLI::App& program, Action& action);
void add_doctor(CLI::App& program, Action& action);
void add_scenes(CLI::App& program, Action& action);

/// Parses "key=value" as --set takes it. \throws Error (Usage).
std::pair<std::string, std::string> parse_override(const std::string& text);

/// Parses "1280x720". \throws Error (Usage).
std::pair<int, int> parse_size(const std::string& text);

}  // namespace piecework::cli
