// piecework compare: how far one run is from another, and how much faster.

#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <piecework/core/error.hpp>
#include <piecework/runner/compare.hpp>

#include "commands.hpp"
#include "console.hpp"

namespace piecework::cli {
namespace {

constexpr const char* kExamples =
    "Compare two run directories at their common times: position error of A against B, the "
    "reference, and the ratio of their times (not interleaved).\n\n"
    "  max       largest distance of a vertex from its place in B, m\n"
    "  rms       root mean square of the distances over vertices and times, m\n"
    "  relative  max / largest displacement of a vertex of B since its start\n\n"
    "Examples:\n"
    "  piecework compare out/fast out/reference\n"
    "  piecework compare out/fast out/reference --json\n"
    "  piecework compare out/new out/old --max 1e-9        exit code 5 if they differ by more";

struct CompareArguments {
  std::string a, b;
  bool json = false;
  double max = std::numeric_limits<double>::infinity();
  double rms = std::numeric_limits<double>::infinity();
};

/// Says so if a limit is exceeded.
bool holds(const char* name, double value, double limit) {
  if (value <= limit) return true;
  say("piecework: {} {:.6g} m exceeds --{} {:g}\n", name, value, name, limit);
  return false;
}

int compare(const CompareArguments& arguments) {
  const runner::Comparison comparison = runner::compare_runs(arguments.a, arguments.b);
  fmt::print("{}", arguments.json ? to_json(comparison) : to_markdown(comparison));
  const bool max_holds = holds("max", comparison.max, arguments.max);
  const bool rms_holds = holds("rms", comparison.rms, arguments.rms);
  return static_cast<int>(max_holds && rms_holds ? ExitCode::Ok : ExitCode::CheckFailed);
}

}  // namespace

void add_compare(CLI::App& program, Action& action) {
  auto arguments = std::make_shared<CompareArguments>();
  CLI::App* app = program.add_subcommand("compare", kExamples);
  app->add_option("a", arguments->a, "Run directory")->required();
  app->add_option("b", arguments->b, "Run directory of the reference")->required();
  app->add_flag("--json", arguments->json, "Print JSON instead of a table");
  app->add_option("--max", arguments->max, "Exit with 5 if max is larger, m")
      ->check(CLI::NonNegativeNumber);
  app->add_option("--rms", arguments->rms, "Exit with 5 if rms is larger, m")
      ->check(CLI::NonNegativeNumber);
  app->callback([arguments, &action] { action = [arguments] { return compare(*arguments); }; });
}

}  // namespace piecework::cli
