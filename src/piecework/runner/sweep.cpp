#include <piecework/runner/sweep.hpp>

#include <fcntl.h>
#include <sys/file.h>

#include <algorithm>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/descriptor.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/hash.hpp>
#include <piecework/runner/checkpoint.hpp>

namespace piecework::runner {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kCaseFile = "case.json";
constexpr const char* kCaseSchema = "piecework.sweep-case/1";

/// `text` fit for names of files in every shell and Makefile.
std::string file_word(const std::string& text, std::size_t max_length) {
  std::string word;
  for (const char c : text) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '.' || c == '+' || c == '_' || c == '-';
    if (plain)
      word += c;
    else if (!word.empty() && word.back() != '-')
      word += '-';
  }
  while (!word.empty() && word.back() == '-') word.pop_back();
  return word.substr(0, max_length);
}

std::string last_step(const std::string& key) { return key.substr(key.find_last_of("./") + 1); }

/// Keys by their last step, unless two keys of the sweep share it.
std::string short_key(const std::string& key, const std::vector<std::string>& keys) {
  const std::string step = last_step(key);
  for (const std::string& other : keys)
    if (other != key && last_step(other) == step) return key;
  return step;
}

std::string label_of(const SweepJob& job, const std::vector<std::string>& keys) {
  constexpr std::size_t kMaxWord = 24, kMaxLabel = 100;
  if (job.reference) return "reference";
  std::string label;
  for (const scene::Setting& setting : job.own)
    label += fmt::format("{}{}-{}", label.empty() ? "" : "_",
                         file_word(short_key(setting.key, keys), kMaxWord),
                         file_word(short_value(setting.value), kMaxWord));
  label = label.substr(0, kMaxLabel);
  while (label.starts_with('.') || label.starts_with('-')) label.erase(0, 1);
  return label.empty() ? "case" : label;
}

/// What is simulated, length and threads included, wherever its files lie.
std::string job_hash(const SweepJob& job, const scene::Scene& scene) {
  constexpr std::size_t kDigits = 8;
  Hash hash;
  hash.add(scene_hash(scene));
  hash.add(fmt::format("\n{} {}\n", scene.step.steps, scene.solver.threads));
  for (const scene::Setting& s : job.own) hash.add(s.key + "=" + s.value + "\n");
  return hash.hex().substr(0, kDigits);
}

Json settings_json(const SweepJob& job) {
  Json json = Json::object();
  for (const scene::Setting& s : job.settings) json[s.key] = Json::parse(s.value);
  return json;
}

void write_case(const fs::path& directory, const SweepJob& job, const CaseRecord& record) {
  const Json json = {{"schema", kCaseSchema},
                     {"name", job.name},
                     {"settings", settings_json(job)},
                     {"exit_code", record.exit_code},
                     {"message", record.message}};
  ensure_directory(directory);
  write_file_atomically(directory / kCaseFile,
                        json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

/// True while a run writes into the directory: it holds the lock that this tries.
bool is_locked(const fs::path& directory) {
  const Descriptor folder(::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  return folder.get() >= 0 && ::flock(folder.get(), LOCK_EX | LOCK_NB) != 0;
}

void write_tables(const scene::Plan& plan, const std::vector<SweepJob>& jobs,
                  const fs::path& directory) {
  const SweepTable table = read_sweep(plan, jobs, directory);
  write_file_atomically(directory / "sweep.json", to_json(table));
  write_file_atomically(directory / "sweep.csv", to_csv(table));
  write_file_atomically(directory / "sweep.md", to_markdown(table));
}

}  // namespace

std::string plain_value(const std::string& json) {
  const Json value = Json::parse(json, nullptr, /*allow_exceptions=*/false);
  return value.is_string() ? value.get<std::string>() : json;
}

std::string short_value(const std::string& json) {
  const Json value = Json::parse(json, nullptr, /*allow_exceptions=*/false);
  return value.is_number_float() ? fmt::format("{:.6g}", value.get<double>()) : plain_value(json);
}

std::vector<SweepJob> sweep_jobs(const scene::Plan& plan) {
  std::vector<SweepJob> jobs;
  std::map<std::string, std::size_t> known;
  const auto add = [&](const scene::Case& own, bool reference) {
    SweepJob job;
    job.reference = reference;
    job.own = own;
    job.settings = plan.common;
    job.settings.insert(job.settings.end(), own.begin(), own.end());
    const scene::Scene scene = scene::load_scene_with(plan.scene, job.settings);
    job.name = fmt::format("{}_{}", label_of(job, plan.keys), job_hash(job, scene));
    if (!known.emplace(job.name, jobs.size()).second)
      throw InputError(fmt::format("{}: the case {} is there twice; remove one",
                                   own.empty() ? plan.source.string() : own.front().source,
                                   job.name));
    jobs.push_back(std::move(job));
  };
  if (plan.reference) add(*plan.reference, true);
  for (const scene::Case& settings : plan.cases) add(settings, false);
  return jobs;
}

std::optional<CaseRecord> read_case(const fs::path& directory) {
  std::error_code ignored;
  const fs::path path = directory / kCaseFile;
  if (!fs::is_regular_file(path, ignored)) return std::nullopt;
  const Json json = Json::parse(read_file(path), nullptr, /*allow_exceptions=*/false);
  if (!json.is_object() || json.value("schema", "") != kCaseSchema || !json.contains("exit_code") ||
      !json["exit_code"].is_number_integer())
    return std::nullopt;
  CaseRecord record;
  record.exit_code = json["exit_code"];
  record.message = json.value("message", "");
  // A run that was deleted is not finished, whatever was noted about it.
  if (record.exit_code == 0 && !fs::exists(directory / "run.json", ignored)) return std::nullopt;
  return record;
}

SweepOutcome run_sweep(const scene::Plan& plan, const std::vector<SweepJob>& jobs,
                       const SweepOptions& options, const CaseRunner& run_case,
                       SweepObserver& observer) {
  SweepOutcome outcome;
  ensure_directory(options.directory);
  for (std::size_t i = 0; i < jobs.size() && !outcome.stopped; ++i) {
    if (!options.shard.has(i)) continue;
    const SweepJob& job = jobs[i];
    const fs::path directory = options.directory / job.name;
    std::optional<CaseRecord> record = read_case(directory);
    const bool again = !record || (options.retry && record->exit_code != 0);
    if (again && is_locked(directory)) {
      observer.busy(job, i + 1);
      ++outcome.busy;
      continue;
    }
    if (again) {
      observer.started(job, i + 1);
      record = run_case(job, directory);
      outcome.stopped = record->stopped;
      if (outcome.stopped) break;
      write_case(directory, job, *record);
    }
    observer.finished(job, i + 1, *record, again);
    outcome.failed += record->exit_code != 0;
    outcome.stopped = observer.should_stop();
  }
  for (const SweepJob& job : jobs) outcome.missing += !read_case(options.directory / job.name);
  if (outcome.missing == 0) write_tables(plan, jobs, options.directory);
  return outcome;
}

}  // namespace piecework::runner
