// piecework tune: how many domains, and of which sizes, suit this processor. Asked for only: what
// other commands compute never depends on the machine.

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/runner/topology.hpp>
#include <piecework/runner/tune.hpp>
#include <piecework/scene/scene_io.hpp>

#include "commands.hpp"
#include "console.hpp"

namespace piecework::cli {
namespace {

namespace fs = std::filesystem;

constexpr const char* kExamples =
    "Propose domains for this processor: time a scene's first global solve with several numbers of "
    "domains, sized by the speed of the cores, and write the best into a scene file.\n\n"
    "Examples:\n"
    "  piecework tune scene.json -o tuned.json\n"
    "  piecework tune hanging_tablecloth --threads 8\n"
    "  piecework tune scene.json --topology laptop.json -o tuned.json    nothing is measured";

struct TuneArguments {
  std::string scene;
  std::string output;
  std::string topology;
  int threads = 0;
  bool overwrite = false;
  std::vector<std::string> set;
};

/// Writing over the scene that is read needs a word of its own.
void refuse_input(const TuneArguments& arguments, const scene::Scene& scene) {
  std::error_code ignored;
  if (arguments.output.empty() || arguments.overwrite) return;
  if (fs::equivalent(arguments.output, scene.source, ignored))
    throw Error(ExitCode::Usage,
                fmt::format("-o {}: is the scene itself, whose comments and unset keys would be "
                            "lost; choose another name, or add --overwrite",
                            arguments.output));
}

int count_workers(const TuneArguments& arguments, const scene::Scene& scene,
                  const runner::Topology& topology) {
  if (arguments.threads > 0) return arguments.threads;
  if (scene.solver.threads > 0) return scene.solver.threads;
  const int cores = topology.cores();
  return arguments.topology.empty() ? std::min(cores, available_threads()) : cores;
}

void print_topology(const runner::Topology& topology, int workers) {
  fmt::print("{}: ", topology.source);
  for (std::size_t k = 0; k < topology.kinds.size(); ++k) {
    const runner::CoreKind& kind = topology.kinds[k];
    fmt::print("{}{} cores, {} (speed {})", k == 0 ? "" : "; ", kind.cores, kind.name, kind.speed);
  }
  fmt::print("; {} workers\n\n", workers);
}

using Table = std::vector<std::vector<std::string>>;

/// As Markdown; numbers and texts alike are padded, the first row is the header.
void print_table(const Table& table) {
  std::vector<std::size_t> width(table.front().size(), 3);
  for (const auto& row : table)
    for (std::size_t c = 0; c < row.size(); ++c) width[c] = std::max(width[c], row[c].size());
  for (std::size_t r = 0; r < table.size(); ++r) {
    for (std::size_t c = 0; c < table[r].size(); ++c)
      c == 1 ? fmt::print("| {:<{}} ", table[r][c], width[c])
             : fmt::print("| {:>{}} ", table[r][c], width[c]);
    fmt::print("|\n");
    if (r > 0) continue;
    for (std::size_t c = 0; c < width.size(); ++c)
      fmt::print("|{:-<{}}{}", "", width[c] + 1, c == 1 ? '-' : ':');
    fmt::print("|\n");
  }
  fmt::print("\n");
}

std::string ratio_text(const runner::Timing& timing, bool present) {
  if (std::isnan(timing.ratio.median)) return "-";
  if (present) return "1";
  return fmt::format("{}{:.3f}", timing.significant() ? "" : "~", timing.ratio.median);
}

void print_candidates(const runner::Measurements& measured) {
  Table table = {{"domains", "sizes"}};
  for (const std::string& solver : measured.solvers) {
    table.front().push_back(solver + " ms");
    table.front().emplace_back("ratio");
  }
  for (std::size_t r = 0; r < measured.rows.size(); ++r) {
    const runner::CandidateRow& row = measured.rows[r];
    table.push_back({fmt::format("{}{}", r == 0 ? "now: " : "", row.setting.domains),
                     runner::weights_text(row.setting.weights)});
    for (std::size_t s = 0; s < measured.solvers.size(); ++s) {
      const runner::Timing timing = s < row.timings.size() ? row.timings[s] : runner::Timing{};
      table.back().push_back(
          std::isnan(timing.ms.median) ? "-" : fmt::format("{:.3f}", timing.ms.median));
      table.back().push_back(ratio_text(timing, r == 0));
    }
  }
  print_table(table);
  for (const runner::CandidateRow& row : measured.rows)
    if (!row.refusal.empty())
      fmt::print("{} domains are refused: {}\n", row.setting.domains, row.refusal);
}

/// All candidates with their times, or without if the processor is simulated.
runner::Measurements list_candidates(const TuneArguments& arguments, runner::World& world,
                                     const runner::Topology& topology, int workers) {
  const auto candidates = runner::candidate_settings(topology, workers, world.model.num_vertices());
  if (arguments.topology.empty())
    return ThreadPool(workers).run([&] { return runner::measure_settings(world, candidates); });
  runner::Measurements unmeasured;
  unmeasured.solvers = {world.scene.solver.global};
  const runner::DomainSetting present = runner::present_setting(world.scene);
  unmeasured.rows.push_back({.setting = present, .timings = {}, .refusal = {}});
  for (const runner::DomainSetting& candidate : candidates)
    if (candidate != present)
      unmeasured.rows.push_back({.setting = candidate, .timings = {}, .refusal = {}});
  return unmeasured;
}

void print_legend(const runner::Measurements& measured, const scene::Scene& scene) {
  fmt::print(
      "Milliseconds of one global solve, medians of {} samples of {}; ratio: to the present "
      "setting (now), sample by sample; ~: the 95 % interval of the ratio holds 1.\n",
      runner::kTunePairs, runner::kTuneSolves);
  if (measured.solvers.back() != scene.solver.global)
    fmt::print("`global: {}` does not use domains; `{}` was measured instead.\n",
               scene.solver.global, measured.solvers.back());
}

void write_scene(const std::string& path, const scene::Scene& scene,
                 const runner::DomainSetting& chosen) {
  write_file_atomically(path, scene::resolved_json(runner::with_setting(scene, chosen)));
  fmt::print(
      "written: {}, with every default filled in, file names made absolute, and without "
      "comments\n",
      path);
}

int tune(const TuneArguments& arguments, const Verbosity& verbosity) {
  std::vector<scene::Override> overrides;
  for (const std::string& text : arguments.set) overrides.push_back(parse_override(text));
  const scene::Scene scene = scene::load_scene(arguments.scene, overrides);
  refuse_input(arguments, scene);
  const bool simulated = !arguments.topology.empty();
  runner::Topology topology =
      simulated ? runner::load_topology(arguments.topology) : runner::machine_topology();
  const auto world = runner::build_world(scene);
  for (const std::string& note : world->notes)
    if (!verbosity.quiet) say("note: {}\n", note);
  if (!simulated && topology.kinds.size() > 1 && !runner::measure_speeds(topology))
    say("note: the speeds of the {} kinds of cores cannot be measured: all taken as 1\n",
        topology.kinds.size());
  const int workers = count_workers(arguments, scene, topology);
  const runner::Measurements candidates = list_candidates(arguments, *world, topology, workers);
  print_topology(topology, workers);
  print_candidates(candidates);
  if (!simulated) print_legend(candidates, scene);
  const runner::Proposal proposal =
      simulated ? runner::propose_unmeasured(topology, workers, world->model.num_vertices())
                : runner::propose_measured(candidates.rows);
  fmt::print("chosen: {} domains, {} sizes: {}\n", proposal.chosen.domains,
             runner::weights_text(proposal.chosen.weights), proposal.reason);
  if (!arguments.output.empty()) write_scene(arguments.output, scene, proposal.chosen);
  return 0;
}

}  // namespace

void add_tune(CLI::App& program, Action& action, const Verbosity& verbosity) {
  auto arguments = std::make_shared<TuneArguments>();
  CLI::App* app = program.add_subcommand("tune", kExamples);
  app->add_option("scene", arguments->scene, "Scene file, or the name of a built-in scene")
      ->required();
  app->add_option("-o,--output", arguments->output, "Scene file to write; none: only say");
  app->add_option("--threads", arguments->threads,
                  "Worker threads [the scene's, else one per core that may be used]")
      ->check(CLI::Range(1, 1024));
  app->add_option("--topology", arguments->topology,
                  "JSON file of a processor's cores to propose for, without measuring");
  app->add_flag("--overwrite", arguments->overwrite, "-o may be the scene itself");
  app->add_option("--set", arguments->set, "Override a scene key: key=value")
      ->allow_extra_args(false);
  app->callback([arguments, &action, &verbosity] {
    action = [arguments, &verbosity] { return tune(*arguments, verbosity); };
  });
}

}  // namespace piecework::cli
