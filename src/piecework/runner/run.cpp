#include <piecework/runner/run.hpp>

#include <fcntl.h>
#include <sys/file.h>

#include <algorithm>
#include <optional>
#include <string_view>

#include <fmt/format.h>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/clock.hpp>
#include <piecework/core/descriptor.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/runner/checkpoint.hpp>
#include <piecework/runner/environment.hpp>
#include <piecework/runner/expectation.hpp>
#include <piecework/runner/iteration_log.hpp>
#include <piecework/runner/methods.hpp>
#include <piecework/runner/start.hpp>
#include <piecework/scene/scene_io.hpp>

namespace piecework::runner {
namespace {

namespace fs = std::filesystem;

constexpr const char* kResolvedScene = "scene.resolved.json";
constexpr const char* kRecord = "run.json";
constexpr const char* kCheckpoint = "checkpoint.bin";

/// "frame_0007.ply" and the like: what a run or a drawing of it writes for each frame.
bool is_frame_file(const std::string& name) {
  constexpr std::string_view kPrefix = "frame_";
  if (!name.starts_with(kPrefix)) return false;
  const auto dot = name.find('.');
  if (dot == std::string::npos) return false;
  const std::string number = name.substr(kPrefix.size(), dot - kPrefix.size());
  const std::string kind = name.substr(dot + 1);
  return number.size() >= 4 && number.find_first_not_of("0123456789") == std::string::npos &&
         (kind == "png" || kind == "ply" || kind == "obj" || kind == "vtp" || kind == "bin");
}

bool is_run_file(const std::string& name) {
  return is_frame_file(name) || name == kResolvedScene || name == kRecord || name == kCheckpoint ||
         name == IterationLog::kFile || name == "timings.csv" || name == "summary.md" ||
         name == "contact_sheet.png";
}

/// Removes what an earlier run wrote, and nothing else.
void clear_run(const fs::path& directory) {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(directory, ignored))
    if (is_run_file(entry.path().filename().string())) fs::remove(entry.path(), ignored);
  for (const auto& entry : fs::directory_iterator(directory / "state", ignored))
    if (is_frame_file(entry.path().filename().string())) fs::remove(entry.path(), ignored);
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

/// A directory that is not a run of this scene must not become one by accident.
void refuse_other_scene(const fs::path& directory, const std::string& hash) {
  const fs::path path = directory / kResolvedScene;
  if (!fs::exists(path)) {
    for (const char* name : {kRecord, kCheckpoint, "timings.csv", "summary.md"})
      if (fs::exists(directory / name))
        throw InputError(
            fmt::format("{}: has a {} that no run of ours wrote; choose another "
                        "directory with -o, or replace it with --overwrite",
                        directory.string(), name));
    return;
  }
  const scene::Scene other = scene::load_scene(path);
  if (scene_hash(other) == hash) return;
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
    record_.motion_hash = motion_hash(*world_);
    record_.overrides = options.overrides;
    record_.environment_json = to_json(describe_environment());
    record_.load_before = load_average();
    cpu_before_ = cpu_time();
    frames_ = options.frames >= 0 ? options.frames : frame_count(scene);
  }

  RunOutcome execute(int threads) {
    record_.threads = threads;
    prepare_directory();
    integrator_ = make_integrator(*world_);
    load_or_start();
    if (options_.log_iterations)
      iterations_.emplace(options_.directory, state_.step).attach(*integrator_);
    integrator_->prepare(state_);
    record_.method = integrator_->minimizer().description();
    record_.setup = integrator_->minimizer().setup_report();
    observer_.started(*world_, frame_, frames_);
    if (frame_ == 0) {
      emit(nullptr);
      expectations_.observe(state_, record_.frames);
    }
    RunOutcome outcome;
    while (frame_ < frames_ && !outcome.stopped) {
      simulate_frame();
      if (options_.checkpoint_every > 0 && frame_ % options_.checkpoint_every == 0) save();
      outcome.stopped = frame_ < frames_ && observer_.should_stop();
    }
    // "At the end" is the scene's end: a shortened run does not reach it.
    if (state_.step >= world_->scene.step.steps) expectations_.finish(state_, record_.frames);
    record_.expectations = expectations_.results();
    // A run that was complete before keeps its reports, unless it was killed before their end.
    if (frame_ == 0 || simulated_ || !reports_complete_) save();
    outcome.simulated = simulated_;
    outcome.frames_done = frame_;
    outcome.record = record_;
    integrator_.reset();  // refers to the world
    outcome.world = std::move(world_);
    return outcome;
  }

 private:
  void prepare_directory() {
    ensure_directory(options_.directory);
    lock_directory();
    if (options_.overwrite)
      clear_run(options_.directory);
    else
      refuse_other_scene(options_.directory, scene_hash(world_->scene));
    if (options_.save_states) ensure_directory(options_.directory / "state");
    clear_temporaries(options_.directory);
    clear_temporaries(options_.directory / "state");
    write_file_atomically(options_.directory / kResolvedScene, scene::resolved_json(world_->scene));
  }

  /// One run at a time: the lock goes with the process, however it ends.
  void lock_directory() {
    lock_.emplace(::open(options_.directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (lock_->get() >= 0 && ::flock(lock_->get(), LOCK_EX | LOCK_NB) != 0)
      throw InputError(
          fmt::format("{}: another run is writing into it; wait for it, or choose "
                      "another directory with -o",
                      options_.directory.string()));
  }

  void load_or_start() {
    const fs::path checkpoint = options_.directory / kCheckpoint;
    state_ = start_state(*world_, *integrator_);
    if (!fs::exists(checkpoint)) {
      if (options_.resume)
        world_->notes.push_back("no checkpoint to resume from: started at frame 0");
      return;
    }
    state_ = read_state(checkpoint, record_.motion_hash, world_->model.num_vertices());
    const fs::path path = options_.directory / kRecord;
    RecordedPart part = recorded_part(read_file(path), path.string(), state_.step);
    record_.frames = std::move(part.frames);
    expectations_.restore(part.expectations);
    reports_complete_ = part.expectations.size() == world_->scene.expect.size();
    frame_ = record_.frames.empty() ? 0 : record_.frames.back().frame;
    if ((record_.frames.empty() ? 0 : record_.frames.back().step) != state_.step)
      throw InputError(fmt::format(
          "{}: does not reach the checkpoint's step {}; run with --overwrite to start anew",
          path.string(), state_.step));
    export_earlier_frames();
  }

  void simulate_frame() {
    FrameRecord frame;
    for (int i = 0; i < world_->scene.step.output_every; ++i) {
      try {
        frame.add(integrator_->step(state_));
      } catch (const SimulationError&) {
        // Complete frames keep their record; the checkpoint stays where it was, since the frame in
        // progress is incomplete.
        write_reports();
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
    if (options_.save_states) {
      // To look at, not to go on from: without what the next step would look back on.
      const model::State shown{
          .x = state_.x, .v = state_.v, .time = state_.time, .step = state_.step};
      write_state(state_file(options_.directory, frame_), shown, record_.motion_hash);
    }
    export_frame(frame_, state_.x);
    observer_.frame_done(*world_, state_, frame_, frame);
  }

  void export_frame(int frame, const Positions& x) {
    for (const mesh::ExportFormat format : options_.exports)
      mesh::export_meshes(export_path(frame, format), format, export_parts(x));
  }

  [[nodiscard]] fs::path export_path(int frame, mesh::ExportFormat format) const {
    return options_.directory / (frame_name(frame) + "." + mesh::extension(format));
  }

  [[nodiscard]] std::vector<mesh::ExportPart> export_parts(const Positions& x) const {
    std::vector<mesh::ExportPart> parts;
    for (std::size_t p = 0; p < world_->documents.size(); ++p) {
      const auto& range = world_->model.parts[p];
      const auto first = world_->domains.triangle_domain.begin() + range.first_triangle;
      parts.push_back({.document = &world_->documents[p],
                       .positions = x.middleRows(range.first_vertex, range.num_vertices),
                       .name = range.name,
                       .triangle_domain = {first, first + range.num_triangles}});
    }
    return parts;
  }

  /// A continued run may ask for formats that its first part did not: made from the saved states.
  void export_earlier_frames() {
    for (int frame = 0; frame <= frame_; ++frame) {
      const fs::path saved = state_file(options_.directory, frame);
      for (const mesh::ExportFormat format : options_.exports) {
        if (fs::exists(export_path(frame, format))) continue;
        if (!fs::exists(saved))
          throw InputError(
              fmt::format("{}: frame {} cannot be exported as {} any more, its state "
                          "was not kept; run with --overwrite to start anew",
                          options_.directory.string(), frame, mesh::extension(format)));
        const model::State state =
            read_state(saved, record_.motion_hash, world_->model.num_vertices());
        mesh::export_meshes(export_path(frame, format), format, export_parts(state.x));
      }
    }
  }

  void write_reports() {
    record_.load_after = load_average();
    const CpuTime now = cpu_time();
    const double seconds = 1e-3 * since_start_.elapsed_ms();
    constexpr double kMeasurable = 1.0;  // s; the machine counts in ticks of 10 ms
    if (seconds >= kMeasurable)
      record_.other_processors =
          ((now.machine - cpu_before_.machine) - (now.process - cpu_before_.process)) / seconds;
    record_.expectations = expectations_.results();
    write_file_atomically(options_.directory / kRecord, to_json(record_, *world_));
    write_file_atomically(options_.directory / "timings.csv", to_csv(record_));
    write_file_atomically(options_.directory / "summary.md", to_markdown(record_, *world_));
    if (iterations_) iterations_->save();
  }

  /// The record first, so that a checkpoint never knows more frames than the record.
  void save() {
    write_reports();
    write_state(options_.directory / kCheckpoint, state_, record_.motion_hash);
  }

  const RunOptions& options_;
  RunObserver& observer_;
  std::optional<Descriptor> lock_;
  Stopwatch since_start_;
  CpuTime cpu_before_;
  std::unique_ptr<World> world_;
  ExpectationChecker expectations_;
  std::optional<IterationLog> iterations_;
  std::unique_ptr<model::Integrator> integrator_;
  RunRecord record_;
  model::State state_;
  int frame_ = 0;
  int frames_ = 0;
  bool simulated_ = false;
  bool reports_complete_ = false;  ///< on disk, with every expectation
};

}  // namespace

bool RunOutcome::expectations_hold() const {
  return std::all_of(record.expectations.begin(), record.expectations.end(),
                     [](const ExpectationResult& e) { return e.holds; });
}

int frame_count(const scene::Scene& scene) { return scene.step.steps / scene.step.output_every; }

std::string frame_name(int frame) { return fmt::format("frame_{:04}", frame); }

fs::path state_file(const fs::path& directory, int frame) {
  return directory / "state" / (frame_name(frame) + ".bin");
}

RunOutcome run(const scene::Scene& scene, const RunOptions& options, RunObserver& observer) {
  ThreadPool pool(options.threads > 0 ? options.threads : scene.solver.threads);
  return pool.run([&] { return Run(scene, options, observer).execute(pool.threads()); });
}

}  // namespace piecework::runner
