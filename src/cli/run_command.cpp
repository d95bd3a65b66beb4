// piecework run: simulate a scene, draw its frames, write its tables.

#include <filesystem>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <piecework/core/error.hpp>
#include <piecework/runner/run.hpp>
#include <piecework/scene/scene_io.hpp>

#include "commands.hpp"
#include "console.hpp"
#include "pictures.hpp"
#include "progress.hpp"
#include "signals.hpp"

namespace piecework::cli {
namespace {

constexpr const char* kExamples =
    "Simulate a scene into a directory: frames, run.json, timings.csv, summary.md.\n\n"
    "Examples:\n"
    "  piecework run hanging_tablecloth -o out/cloth\n"
    "  piecework run scene.json -o out/a --frames 30 --threads 1 --set quality.tolerance=1e-3\n"
    "  piecework run scene.json -o out/b --no-images --export ply --export obj\n"
    "  piecework run scene.json -o out/c --checkpoint-every 10     # kill it at any time, then:\n"
    "  piecework run scene.json -o out/c --resume                  # same bits as unbroken";

struct RunArguments {
  std::string scene;
  std::string directory;
  int frames = -1;
  int threads = 0;
  std::vector<std::string> set;
  bool no_images = false;
  bool no_state = false;
  bool log_iterations = false;
  bool strict = false;
  bool fast_images = false;
  std::vector<std::string> exports;
  int checkpoint_every = 0;
  bool resume = false;
  bool overwrite = false;
  bool expect = false;
  std::string gl = "auto";
  std::string size;
  std::string color;
};

bool has_states(const std::filesystem::path& directory) {
  return std::filesystem::exists(runner::state_file(directory, 0));
}

class ConsoleObserver : public runner::RunObserver {
 public:
  /// \param pictures_from  the directory whose states will be drawn; empty: none will
  ConsoleObserver(const Verbosity& verbosity, std::filesystem::path pictures_from)
      : verbosity_(verbosity),
        pictures_from_(std::move(pictures_from)),
        progress_("simulating", verbosity.quiet) {}

  void started(const runner::World& world, int first_frame, int frames) override {
    if (!pictures_from_.empty() && first_frame > 0 && first_frame < frames &&
        !has_states(pictures_from_))
      throw InputError(
          fmt::format("{}: its first frames were run with --no-state and cannot be "
                      "drawn any more; use --no-images, or --overwrite to start anew",
                      pictures_from_.string()));
    if (!verbosity_.quiet) {
      const auto& s = world.domain_summary;
      say("{}: {} vertices, {} triangles, {} domains (C|B|R {}|{}|{}, balance {:.3f})\n",
          world.scene.name, world.model.num_vertices(), world.model.triangles.size(), s.domains,
          s.corner, s.boundary, s.remainder, s.balance);
      for (const std::string& note : world.notes) say("note: {}\n", note);
      if (first_frame > 0 && first_frame < frames) say("continuing after frame {}\n", first_frame);
      if (first_frame >= frames && first_frame > 0)
        say("all {} frames are there already; --overwrite runs them again\n", first_frame);
    }
    progress_.start(first_frame, frames);
  }

  void frame_done(const runner::World&, const model::State&, int frame,
                  const runner::FrameRecord* record) override {
    if (record == nullptr) return;
    progress_.update(frame,
                     fmt::format("{:.3g} ms/step, {:.3g} it, gradient {:.1e}", record->step_ms,
                                 double(record->iterations) / record->steps, record->gradient));
  }

  bool should_stop() override { return stop_signal() != 0; }

  void finish() { progress_.finish(); }

 private:
  const Verbosity& verbosity_;
  std::filesystem::path pictures_from_;
  Progress progress_;
};

mesh::ExportFormat export_format(const std::string& name) {
  return name == "obj"   ? mesh::ExportFormat::Obj
         : name == "vtp" ? mesh::ExportFormat::Vtp
                         : mesh::ExportFormat::Ply;
}

PictureOptions pictures_for(const scene::Scene& scene, const RunArguments& arguments) {
  PictureOptions options = picture_options(scene);
  options.gl = arguments.gl;
  options.fast = arguments.fast_images;
  if (!arguments.color.empty()) options.color = arguments.color;
  if (!arguments.size.empty()) std::tie(options.width, options.height) = parse_size(arguments.size);
  return options;
}

/// Removes the saved states, and their folder if nothing else is in it.
void remove_states(const std::filesystem::path& directory, int last_frame) {
  std::error_code ignored;
  for (int frame = 0; frame <= last_frame; ++frame)
    std::filesystem::remove(runner::state_file(directory, frame), ignored);
  std::filesystem::remove(directory / "state", ignored);
}

void draw(const runner::RunOutcome& outcome, const RunArguments& arguments,
          const Verbosity& verbosity) {
  const std::filesystem::path directory = arguments.directory;
  if (!outcome.simulated && !has_states(directory)) return;  // drawn before, with --no-state
  const auto shots =
      shots_of_run(*outcome.world, directory, 0, outcome.frames_done, "frame_{frame:04}.png");
  Progress progress("drawing", verbosity.quiet);
  take_pictures(*outcome.world, shots, pictures_for(outcome.world->scene, arguments), progress);
  write_contact_sheet(shots, directory / "contact_sheet.png");
  if (arguments.no_state) remove_states(directory, outcome.frames_done);
}

/// Says how many steps ended before their stop rule held.
void report_convergence(const runner::RunOutcome& outcome) {
  const runner::Totals sum = runner::totals(outcome.record.frames);
  const scene::Quality& quality = outcome.world->scene.quality;
  if (sum.converged_steps < sum.steps && quality.stop != "iterations")
    say("note: {} of {} steps ended (at most {} iterations) before `{}` reached {:g}\n",
        sum.steps - sum.converged_steps, sum.steps, quality.max_iterations, quality.stop,
        quality.tolerance);
}

/// Says what passed through what; false if strictness forbids it.
bool report_interpenetrations(const runner::RunOutcome& outcome, bool strict) {
  const int worst = runner::totals(outcome.record.frames).interpenetrations;
  if (worst > 0)
    say("{}: up to {} edges pass through triangles, or vertices are inside of bodies, after a step "
        "(run.json says when)\n",
        strict ? "interpenetration" : "note", worst);
  return worst == 0 || !strict;
}

int report(const runner::RunOutcome& outcome, const RunArguments& arguments) {
  for (const auto& e : outcome.record.expectations)
    if (e.reached && !e.holds)
      say("expectation fails: {}; found {:.6g}\n", e.text, e.value);
    else if (!e.reached && arguments.expect && !outcome.stopped)
      say("expectation not reached: {}; simulate more frames\n", e.text);
  if (outcome.stopped) {
    say("stopped after frame {}; continue with --resume\n", outcome.frames_done);
    return 128 + stop_signal();
  }
  fmt::print("{}\n", (std::filesystem::path(arguments.directory) / "summary.md").string());
  if (!report_interpenetrations(outcome, arguments.strict))
    return static_cast<int>(ExitCode::SimulationFailed);
  return static_cast<int>(arguments.expect && !outcome.expectations_hold() ? ExitCode::CheckFailed
                                                                           : ExitCode::Ok);
}

int run(const RunArguments& arguments, const Verbosity& verbosity) {
  runner::RunOptions options;
  for (const std::string& text : arguments.set) options.overrides.push_back(parse_override(text));
  const scene::Scene scene = scene::load_scene(arguments.scene, options.overrides);
  options.directory = arguments.directory.empty() ? "out/" + scene.name : arguments.directory;
  options.frames = arguments.frames;
  options.threads = arguments.threads;
  options.checkpoint_every = arguments.checkpoint_every;
  options.resume = arguments.resume;
  options.overwrite = arguments.overwrite;
  options.log_iterations = arguments.log_iterations;
  options.save_states = !arguments.no_state || !arguments.no_images;
  for (const std::string& name : arguments.exports) options.exports.push_back(export_format(name));
  // Without OpenGL a run with pictures would fail only at its end: find out now.
  if (!arguments.no_images) check_pictures(scene, pictures_for(scene, arguments));

  const runner::RunOutcome outcome = [&] {
    // Stops after the frame in progress, with a checkpoint. Only while it simulates: a signal while
    // it draws ends the program; the checkpoint is there.
    const SignalGuard guard;
    ConsoleObserver observer(verbosity, arguments.no_images ? "" : options.directory);
    runner::RunOutcome result = runner::run(scene, options, observer);
    observer.finish();
    return result;
  }();
  RunArguments resolved = arguments;
  resolved.directory = options.directory.string();
  if (!arguments.no_images && !outcome.stopped) draw(outcome, resolved, verbosity);
  if (!verbosity.quiet) report_convergence(outcome);
  return report(outcome, resolved);
}

}  // namespace

void add_run(CLI::App& program, Action& action, const Verbosity& verbosity) {
  auto arguments = std::make_shared<RunArguments>();
  CLI::App* app = program.add_subcommand("run", kExamples);
  app->add_option("scene", arguments->scene, "Scene file, or the name of a built-in scene")
      ->required();
  app->add_option("-o,--output", arguments->directory, "Directory [out/<scene name>]");
  app->add_option("--frames", arguments->frames, "Frames to simulate [as the scene says]")
      ->check(CLI::Range(0, 1'000'000'000));
  app->add_option("--threads", arguments->threads, "Threads [as the scene says, else all]")
      ->check(CLI::Range(1, 1024));
  app->add_option("--set", arguments->set,
                  "Override a scene key: key=value, e.g. solver.domains=16")
      ->allow_extra_args(false);
  app->add_flag("--no-images", arguments->no_images, "Draw nothing; needs no OpenGL");
  app->add_flag("--strict", arguments->strict,
                "Exit with 1 if anything passed through anything after any step");
  app->add_flag("--log-iterations", arguments->log_iterations,
                "Also write iterations.csv: energy, gradient, increments of every iteration");
  app->add_flag("--no-state", arguments->no_state,
                "Keep no state/ files (`piecework render` needs them)");
  app->add_flag("--fast-images", arguments->fast_images, "No shadows, no ambient occlusion");
  app->add_option("--color", arguments->color,
                  "domain, dof, strain, contact or shaded [as the scene says]")
      ->check(CLI::IsMember({"domain", "dof", "strain", "contact", "shaded"}));
  app->add_option("--size", arguments->size, "Picture size, e.g. 1920x1080 [as the scene says]");
  app->add_option("--export", arguments->exports, "Also write each frame's mesh: ply, obj or vtp")
      ->check(CLI::IsMember({"ply", "obj", "vtp"}))
      ->allow_extra_args(false);
  app->add_option("--checkpoint-every", arguments->checkpoint_every,
                  "Frames between checkpoints [at the end only]")
      ->check(CLI::Range(0, 1'000'000'000));
  app->add_flag("--resume", arguments->resume,
                "Continue from the checkpoint (the default); says so if there is none");
  app->add_flag("--overwrite", arguments->overwrite,
                "Replace what an earlier run left in the directory");
  app->add_flag("--expect", arguments->expect, "Exit with 5 if an expectation of the scene fails");
  app->add_option("--gl", arguments->gl, "OpenGL provider")
      ->check(CLI::IsMember({"auto", "osmesa", "egl"}));
  app->callback([arguments, &action, &verbosity] {
    action = [arguments, &verbosity] { return run(*arguments, verbosity); };
  });
}

}  // namespace piecework::cli
