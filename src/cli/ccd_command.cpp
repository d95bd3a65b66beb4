// piecework ccd: continuous collision detection on a file of queries with known answers.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <piecework/collision/ccd_query_file.hpp>
#include <piecework/core/error.hpp>

#include "commands.hpp"
#include "console.hpp"

namespace piecework::cli {
namespace {

using collision::CcdMethod;
using collision::CcdOptions;
using collision::CcdQuery;
using collision::PairKind;

constexpr const char* kExamples =
    "Put a file of queries with known answers through continuous collision detection. Exit code 5 "
    "if a meeting was missed; false positives are allowed and counted.\n\n"
    "A query is eight lines of x_num,x_den,y_num,y_den,z_num,z_den,truth (integers; truth 0 or 1): "
    "the four vertices at the start, then at the end.\n\n"
    "Examples:\n"
    "  piecework ccd edge-edge/0001.csv                kind from the name\n"
    "  piecework ccd queries.csv --kind vf --json      vertex and face\n"
    "  piecework ccd queries.csv --kind ee --method newton";

struct CcdArguments {
  std::string file, kind, method = "halley";
  double min_separation = 0;
  bool json = false;
};

struct Summary {
  std::size_t queries = 0, hits = 0, missed = 0, false_positives = 0, rounded = 0;
  double median_ns = 0, p99_ns = 0;
};

PairKind kind_of(const CcdArguments& arguments) {
  const auto named = [&](const char* part) {
    return arguments.kind.empty() && arguments.file.find(part) != std::string::npos;
  };
  const bool vf = arguments.kind == "vf" || named("vertex-face");
  const bool ee = arguments.kind == "ee" || named("edge-edge");
  if (vf == ee)
    throw Error(ExitCode::Usage, fmt::format("{}: the name does not tell what the pairs are; add "
                                             "--kind vf or --kind ee",
                                             arguments.file));
  return vf ? PairKind::VertexTriangle : PairKind::EdgeEdge;
}

CcdMethod method_of(const std::string& name) {
  if (name == "newton") return CcdMethod::Newton;
  return name == "additive" ? CcdMethod::Additive : CcdMethod::Halley;
}

/// Time of one query, ns: many calls in a row, as reading the clock takes longer than one.
double time_of(const CcdQuery& q, const CcdOptions& options) {
  constexpr int kCalls = 64;
  using Clock = std::chrono::steady_clock;
  double sum = 0;
  const auto start = Clock::now();
  for (int i = 0; i < kCalls; ++i) sum += first_contact(q.kind, q.start, q.end, options).time;
  const std::chrono::duration<double, std::nano> elapsed = Clock::now() - start;
  asm volatile("" : : "m"(sum));  // or the calls might be left out
  return elapsed.count() / kCalls;
}

/// The smallest element that at least the given part of all does not exceed.
double quantile(std::vector<double> values, double part) {
  const auto rank =
      static_cast<std::ptrdiff_t>(std::ceil(part * static_cast<double>(values.size())) - 1);
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[static_cast<std::size_t>(rank)];
}

Summary run_queries(const collision::CcdQueryFile& file, const CcdOptions& options) {
  Summary s{.queries = file.queries.size(), .rounded = file.rounded_coordinates};
  std::vector<double> times;
  for (std::size_t i = 0; i < file.queries.size(); ++i) {
    const CcdQuery& q = file.queries[i];
    const bool truth = file.truth[i] != 0;
    const bool found = first_contact(q.kind, q.start, q.end, options).hit;
    s.hits += truth ? 1 : 0;
    s.missed += truth && !found ? 1 : 0;
    s.false_positives += found && !truth ? 1 : 0;
    times.push_back(time_of(q, options));
  }
  s.median_ns = quantile(times, 0.5);
  s.p99_ns = quantile(times, 0.99);
  return s;
}

void print(const Summary& s, const CcdArguments& arguments, PairKind kind) {
  if (arguments.json) {
    const nlohmann::ordered_json json{
        {"file", arguments.file},
        {"kind", kind == PairKind::VertexTriangle ? "vf" : "ee"},
        {"method", arguments.method},
        {"min_separation", arguments.min_separation},
        {"queries", s.queries},
        {"hits", s.hits},
        {"missed", s.missed},
        {"false_positives", s.false_positives},
        {"rounded_coordinates", s.rounded},
        {"median_ns", s.median_ns},
        {"p99_ns", s.p99_ns},
    };
    fmt::print("{}\n", json.dump(2));
    return;
  }
  fmt::print(
      "queries          {}\nhits             {}  by the file\nmissed           {}\n"
      "false positives  {}\nmedian           {:.0f} ns\np99              {:.0f} ns\n",
      s.queries, s.hits, s.missed, s.false_positives, s.median_ns, s.p99_ns);
  if (s.rounded > 0)
    say("piecework: {} coordinates are no doubles and were rounded; the file's answers may not be "
        "theirs\n",
        s.rounded);
}

int ccd(const CcdArguments& arguments) {
  const PairKind kind = kind_of(arguments);
  const CcdOptions options{.method = method_of(arguments.method),
                           .min_separation = arguments.min_separation};
  const Summary s = run_queries(collision::read_ccd_queries(arguments.file, kind), options);
  print(s, arguments, kind);
  if (s.missed == 0) return 0;
  say("piecework: {} of {} meetings were missed\n", s.missed, s.hits);
  return static_cast<int>(ExitCode::CheckFailed);
}

}  // namespace

void add_ccd(CLI::App& program, Action& action) {
  auto arguments = std::make_shared<CcdArguments>();
  CLI::App* app = program.add_subcommand("ccd", kExamples);
  app->add_option("queries", arguments->file, "CSV file")->required();
  app->add_option("--kind", arguments->kind,
                  "vf or ee; without, by vertex-face or edge-edge in the name")
      ->check(CLI::IsMember({"vf", "ee"}));
  app->add_option("--min-separation", arguments->min_separation, "A pair this close has met, m")
      ->check(CLI::NonNegativeNumber);
  app->add_option("--method", arguments->method, "halley, newton or additive")
      ->check(CLI::IsMember({"halley", "newton", "additive"}))
      ->capture_default_str();
  app->add_flag("--json", arguments->json, "Print JSON");
  app->callback([arguments, &action] { action = [arguments] { return ccd(*arguments); }; });
}

}  // namespace piecework::cli
