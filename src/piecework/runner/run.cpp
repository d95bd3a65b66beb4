#include <piecework/runner/run.hpp>

#include <algorithm>

#include <fmt/format.h>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/clock.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/runner/checkpoint.hpp>
#include <piecework/runner/environment.hpp>
#include <piecework/runner/expectation.hpp>
#include <piecework/scene/scene_io.hpp>

namespace piecework::runner {
namespace {

namespace fs = std::filesystem;

constexpr const char* kResolvedScene = "scene.resolved.json";
constexpr const char* kRecord = "run.json";
constexpr const char* kCheckpoint = "checkpoint.bin";

bool is_run_file(const std::string& name) {
  return name.starts_with("frame_") || name == kResolvedScene || name == kRecord ||
         name == kCheckpoint || name == "timings.csv" || name == "summary.md" ||
         name == "contact_sheet.png";
}

/// Removes what an earlier run wrote, and nothing else.
void clear_run(const fs::path& directory) {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(directory, ignored))
    if (is_run_file(entry.path().filename().string())) fs::remove(entry.path(), ignored);
  for (const auto& entry : fs::directory_iterator(directory / "state", ignored))
    if (entry.path().filename().string().starts_with("frame_")) fs::remove(entry.path(), ignored);
}

/// Removes temporary files that a killed run could not rename: "frame_0003.ply.tmp4711".
void clear_temporaries(const fs::path& directory) {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(directory, ignored)) {
    const std::string name = entry.path().filename().string();
    const auto suffix = name.rfind(".tmp");
    if (suffix != std::string::npos && is_run_file(name.substr(0, suffix)) &&
        name.find_first_not_of("0123456789", suffix + 4) == std::string::npos)
      fs::remove(entry.path(), ignored);
  }
}

void refuse_other_scene(const fs::path& directory, const std::string& hash) {
  const fs::path path = directory / kResolvedScene;
  if (!fs::exists(path)) return;
  const scene::Scene other = scene::load_scene(path);
  if (motion_hash(other) == hash) return;
  throw InputError(
      fmt::format("{}: holds a run of another scene (\"{}\" or other values); choose another "
                  "directory with -o, or replace it with --overwrite",
                  directory.string(), other.name));
}

/// One run in progress.
class Run {
 public:
  Run(const scene::Scene& scene, const RunOptions& options, RunObserver& observer)
      : options_(options), observer_(observer), world_(build_world(scene)), expectations_(*world_) {
    record_.scene_hash = motion_hash(scene);
    record_.overrides = options.overrides;
    record_.environment_json = to_json(describe_environment());
    record_.load_before = load_average();
    frames_ = options.frames >= 0 ? options.frames : frame_count(scene);
  }

  RunOutcome execute(int threads) {
    record_.threads = threads;
    prepare_directory();
    Stopwatch watch;
    integrator_ = make_integrator(*world_);
    record_.setup_ms = watch.elapsed_ms();
    record_.method = integrator_->minimizer().description();
    load_or_start();
    observer_.started(*world_, frame_, frames_);
    if (frame_ == 0) {
      emit(nullptr);
      expectations_.observe(state_, record_.frames);
    }
    RunOutcome outcome;
    while (frame_ < frames_ && !outcome.stopped) {
      simulate_frame();
      if (options_.checkpoint_every > 0 && frame_ % options_.checkpoint_every == 0) save();
      outcome.stopped = observer_.should_stop();
    }
    if (!outcome.stopped) expectations_.finish(state_, record_.frames);
    record_.expectations = expectations_.results();
    // A run that was complete before keeps its reports; one that ends now gets its expectations.
    if (frame_ == 0 || simulated_) save();
    outcome.frames_done = frame_;
    outcome.record = record_;
    integrator_.reset();  // refers to the world
    outcome.world = std::move(world_);
    return outcome;
  }

 private:
  void prepare_directory() {
    ensure_directory(options_.directory);
    if (options_.overwrite)
      clear_run(options_.directory);
    else
      refuse_other_scene(options_.directory, record_.scene_hash);
    if (options_.save_states) ensure_directory(options_.directory / "state");
    clear_temporaries(options_.directory);
    clear_temporaries(options_.directory / "state");
    write_file_atomically(options_.directory / kResolvedScene, scene::resolved_json(world_->scene));
  }

  void load_or_start() {
    const fs::path checkpoint = options_.directory / kCheckpoint;
    state_ = integrator_->initial_state(world_->part_velocity);
    if (!fs::exists(checkpoint)) {
      if (options_.resume)
        world_->notes.push_back("no checkpoint to resume from: started at frame 0");
      return;
    }
    state_ = read_state(checkpoint, record_.scene_hash, world_->model.num_vertices());
    const fs::path path = options_.directory / kRecord;
    RecordedPart part = recorded_part(read_file(path), path.string(), state_.step);
    record_.frames = std::move(part.frames);
    expectations_.restore(part.expectations);
    frame_ = record_.frames.empty() ? 0 : record_.frames.back().frame;
    if ((record_.frames.empty() ? 0 : record_.frames.back().step) != state_.step)
      throw InputError(fmt::format(
          "{}: does not reach the checkpoint's step {}; run with --overwrite to start anew",
          path.string(), state_.step));
  }

  void simulate_frame() {
    FrameRecord frame;
    for (int i = 0; i < world_->scene.step.output_every; ++i) {
      try {
        frame.add(integrator_->step(state_));
      } catch (const SimulationError&) {
        save_failed();
        throw;
      }
      expectations_.observe(state_, record_.frames);
    }
    simulated_ = true;
    frame.finish(++frame_, state_);
    record_.frames.push_back(frame);
    emit(&record_.frames.back());
  }

  /// Writes the frame's files and shows it to the observer.
  void emit(const FrameRecord* frame) {
    if (options_.save_states)
      write_state(options_.directory / "state" / (frame_name(frame_) + ".bin"), state_,
                  record_.scene_hash);
    if (!options_.exports.empty()) export_frame();
    observer_.frame_done(*world_, state_, frame_, frame);
  }

  void export_frame() {
    std::vector<mesh::ExportPart> parts;
    for (std::size_t p = 0; p < world_->documents.size(); ++p) {
      const auto& range = world_->model.parts[p];
      const auto first = world_->domains.triangle_domain.begin() + range.first_triangle;
      parts.push_back({.document = &world_->documents[p],
                       .positions = state_.x.middleRows(range.first_vertex, range.num_vertices),
                       .name = range.name,
                       .triangle_domain = {first, first + range.num_triangles}});
    }
    for (const mesh::ExportFormat format : options_.exports)
      mesh::export_meshes(options_.directory / (frame_name(frame_) + "." + mesh::extension(format)),
                          format, parts);
  }

  void write_reports() {
    record_.load_after = load_average();
    record_.expectations = expectations_.results();
    write_file_atomically(options_.directory / kRecord, to_json(record_, *world_));
    write_file_atomically(options_.directory / "timings.csv", to_csv(record_));
    write_file_atomically(options_.directory / "summary.md", to_markdown(record_, *world_));
  }

  /// The record first, so that a checkpoint never knows more frames than the record.
  void save() {
    write_reports();
    write_state(options_.directory / kCheckpoint, state_, record_.scene_hash);
  }

  /// After a failed step: frames that are complete keep their record; the checkpoint stays where
  /// it was, since the frame in progress is incomplete.
  void save_failed() { write_reports(); }

  const RunOptions& options_;
  RunObserver& observer_;
  std::unique_ptr<World> world_;
  ExpectationChecker expectations_;
  std::unique_ptr<model::Integrator> integrator_;
  RunRecord record_;
  model::State state_;
  int frame_ = 0;
  int frames_ = 0;
  bool simulated_ = false;
};

}  // namespace

bool RunOutcome::expectations_hold() const {
  return std::all_of(record.expectations.begin(), record.expectations.end(),
                     [](const ExpectationResult& e) { return e.holds; });
}

int frame_count(const scene::Scene& scene) { return scene.step.steps / scene.step.output_every; }

std::string frame_name(int frame) { return fmt::format("frame_{:04}", frame); }

RunOutcome run(const scene::Scene& scene, const RunOptions& options, RunObserver& observer) {
  ThreadPool pool(options.threads > 0 ? options.threads : scene.solver.threads);
  return pool.run([&] { return Run(scene, options, observer).execute(pool.threads()); });
}

}  // namespace piecework::runner
