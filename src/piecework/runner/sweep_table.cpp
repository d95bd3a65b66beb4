// The results of a sweep as Markdown, CSV and JSON.

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <piecework/core/error.hpp>
#include <piecework/runner/cells.hpp>
#include <piecework/runner/saved_run.hpp>
#include <piecework/runner/sweep.hpp>

namespace piecework::runner {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// The value that a case gives to a key, as JSON; nothing if it keeps the scene's.
std::optional<std::string> value_of(const SweepRow& row, const std::string& key) {
  std::optional<std::string> value;
  for (const scene::Setting& setting : row.job.settings)
    if (setting.key == key) value = setting.value;
  return value;
}

/// What the machine was, without what changes from run to run on one machine.
std::string machine_of(const std::string& environment_json) {
  Json json = Json::parse(environment_json);
  for (const char* key : {"load_before", "load_after", "other_processors", "disturbed", "threads"})
    json.erase(key);
  return json.dump();
}

void summarize(SweepRow& row, const SavedRun& run) {
  const Totals sum = totals(run.frames);
  row.steps = sum.steps;
  row.converged_steps = sum.converged_steps;
  row.iterations_per_step = sum.steps > 0 ? double(sum.iterations) / sum.steps : 0;
  std::vector<double> ms;
  for (const FrameRecord& frame : run.frames) {
    ms.push_back(frame.step_ms);
    row.worst_gradient = std::max(row.worst_gradient, frame.gradient);
    row.worst_error = std::max(row.worst_error, frame.error);
  }
  row.ms = median_interval(std::move(ms));
  row.disturbed = run.disturbed;
}

/// Errors are measured where that is possible; why they are not is a note, no failure.
void measure_error(SweepRow& row, const fs::path& directory, const SweepJob& reference) {
  if (row.job.reference || row.record.exit_code != 0) return;
  try {
    row.error = compare_runs(directory / row.job.name, directory / reference.name);
  } catch (const InputError& error) {
    row.note = error.what();
  }
}

constexpr const char* kColumns[] = {
    "ms per step [95 % interval]",        "iterations per step", "worst gradient",
    "worst estimated error (mean edges)", "converged steps",     "exit code"};

bool ok(const SweepRow& row) { return row.record.exit_code == 0; }

std::string error_cells(const SweepRow& row) {
  if (!row.error) return fmt::format(" {} | {} | {} |", kOff, kOff, kOff);
  return fmt::format(" {} | {} | {} |", three_digits(row.error->max), three_digits(row.error->rms),
                     three_digits(row.error->relative));
}

std::string result_cells(const SweepRow& row, bool has_reference) {
  if (!ok(row))
    return fmt::format(" FAIL | - | - | - |{} - | {} |\n", has_reference ? " - | - | - |" : "",
                       row.record.exit_code);
  return fmt::format(" {}{} | {} | {} | {} |{} {}/{} | {} |\n", median_cell(row.ms),
                     row.disturbed ? " †" : "", three_digits(row.iterations_per_step),
                     three_digits(row.worst_gradient), three_digits(row.worst_error),
                     has_reference ? error_cells(row) : "", row.converged_steps, row.steps,
                     row.record.exit_code);
}

std::string header(const SweepTable& table) {
  std::string names = "| case |", rules = "|:--|";
  const auto column = [&](const std::string& name) {
    names += " " + name + " |";
    rules += "--:|";
  };
  for (const std::string& key : table.keys) column("`" + plain_cell(key) + "`");
  for (const char* name : kColumns) {
    if (table.has_reference && std::string_view(name) == "converged steps")
      for (const char* error : {"error max (m)", "error RMS (m)", "error relative"}) column(error);
    column(name);
  }
  return names + "\n" + rules + "\n";
}

std::string notes(const SweepTable& table) {
  std::string text =
      "\nTimes are not interleaved: the cases ran one after another, and drift of the machine is "
      "in them. Intervals need 6 frames.\n";
  if (std::any_of(table.rows.begin(), table.rows.end(), [](const auto& r) { return r.disturbed; }))
    text += "† Disturbed: other work kept processors busy that the run wanted.\n";
  if (table.machines > 1)
    text += fmt::format(
        "**The cases ran on {} different machines or builds: their times do not compare.**\n",
        table.machines);
  if (!table.keys.empty()) text += "`-` under a key: as the scene says.\n";
  if (table.has_reference) text += "Errors are those of `piecework compare CASE REFERENCE`.\n";
  for (const SweepRow& row : table.rows) {
    if (row.job.reference && row.converged_steps < row.steps)
      text += fmt::format(
          "**{} of {} steps of the reference did not reach its stop rule: errors below its own "
          "mean "
          "little.**\n",
          row.steps - row.converged_steps, row.steps);
    if (!ok(row)) text += fmt::format("\n{}: {}\n", row.job.name, row.record.message);
    if (!row.note.empty()) text += fmt::format("\n{}: no error: {}\n", row.job.name, row.note);
  }
  return text;
}

std::string environment_list(const std::string& environment_json) {
  if (environment_json.empty()) return "";
  return "\n## Environment\n\n" + list_of(environment_json);
}

/// A field of RFC 4180.
std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string field = "\"";
  for (const char c : text) field += c == '"' ? std::string("\"\"") : std::string(1, c);
  return field + "\"";
}

Json error_json(const SweepRow& row) {
  if (!row.error) return nullptr;
  return {{"max_m", row.error->max},
          {"rms_m", row.error->rms},
          {"relative", row.error->relative},
          {"time_ratio", row.error->time_ratio}};
}

Json row_json(const SweepRow& row) {
  Json settings = Json::object();
  for (const scene::Setting& s : row.job.settings) settings[s.key] = Json::parse(s.value);
  Json json = {{"name", row.job.name},
               {"reference", row.job.reference},
               {"settings", settings},
               {"exit_code", row.record.exit_code}};
  if (!ok(row)) {
    json["message"] = row.record.message;
    return json;
  }
  json["steps"] = row.steps;
  json["converged_steps"] = row.converged_steps;
  json["ms_per_step"] = {
      {"median", row.ms.median}, {"low", row.ms.low}, {"high", row.ms.high}, {"n", row.ms.count}};
  json["disturbed"] = row.disturbed;
  json["iterations_per_step"] = row.iterations_per_step;
  json["worst_gradient"] = row.worst_gradient;
  json["worst_error_mean_edges"] = row.worst_error;
  json["position_error"] = error_json(row);
  if (!row.note.empty()) json["note"] = row.note;
  return json;
}

}  // namespace

SweepTable read_sweep(const scene::Plan& plan, const std::vector<SweepJob>& jobs,
                      const fs::path& directory) {
  SweepTable table;
  table.name = plan.name, table.description = plan.description;
  table.scene = plan.scene.filename().string();
  table.keys = plan.keys;
  std::set<std::string> machines;
  const SweepJob* reference = nullptr;
  for (const SweepJob& job : jobs) {
    if (job.reference) reference = &job;
    SweepRow& row = table.rows.emplace_back();
    row.job = job;
    row.record = read_case(directory / job.name).value_or(CaseRecord{-1, "not finished", false});
    if (!ok(row)) continue;
    const SavedRun run = read_saved_run(directory / job.name);
    summarize(row, run);
    if (table.environment_json.empty()) table.environment_json = run.environment_json;
    machines.insert(machine_of(run.environment_json));
  }
  table.has_reference = reference != nullptr;
  table.machines = static_cast<int>(machines.size());
  if (reference != nullptr)
    for (SweepRow& row : table.rows) measure_error(row, directory, *reference);
  return table;
}

std::string to_markdown(const SweepTable& table) {
  std::string text = fmt::format("# {}\n\n", table.name);
  if (!table.description.empty()) text += table.description + "\n\n";
  text += fmt::format("Scene {}, {} runs.\n\n", table.scene, table.rows.size());
  text += header(table);
  for (const SweepRow& row : table.rows) {
    text += fmt::format("| {} |", plain_cell(row.job.name));
    for (const std::string& key : table.keys) {
      const auto value = value_of(row, key);
      text += fmt::format(" {} |", value ? plain_cell(short_value(*value)) : kOff);
    }
    text += result_cells(row, table.has_reference);
  }
  return text + notes(table) + environment_list(table.environment_json);
}

std::string to_csv(const SweepTable& table) {
  std::string csv = "case,reference";
  for (const std::string& key : table.keys) csv += "," + csv_field(key);
  csv +=
      ",ms_per_step,ms_per_step_low,ms_per_step_high,frames,iterations_per_step,worst_gradient,"
      "worst_error_mean_edges,error_max_m,error_rms_m,error_relative,steps,converged_steps,"
      "exit_code\r\n";
  for (const SweepRow& row : table.rows) {
    csv += fmt::format("{},{}", row.job.name, row.job.reference);
    for (const std::string& key : table.keys)
      csv += "," + csv_field(plain_value(value_of(row, key).value_or("")));
    if (!ok(row)) {
      csv += fmt::format(",,,,,,,,,,,,,{}\r\n", row.record.exit_code);
      continue;
    }
    csv += fmt::format(",{},{},{},{},{},{},{}", csv_number(row.ms.median), csv_number(row.ms.low),
                       csv_number(row.ms.high), row.ms.count, csv_number(row.iterations_per_step),
                       csv_number(row.worst_gradient), csv_number(row.worst_error));
    csv += row.error ? fmt::format(",{},{},{}", csv_number(row.error->max),
                                   csv_number(row.error->rms), csv_number(row.error->relative))
                     : ",,,";
    csv += fmt::format(",{},{},{}\r\n", row.steps, row.converged_steps, row.record.exit_code);
  }
  return csv;
}

std::string to_json(const SweepTable& table) {
  Json json = {{"schema", "piecework.sweep/1"},
               {"name", table.name},
               {"description", table.description},
               {"scene", table.scene},
               {"interleaved", false},
               {"machines", table.machines},
               {"keys", table.keys},
               {"cases", Json::array()}};
  for (const SweepRow& row : table.rows) json["cases"].push_back(row_json(row));
  json["environment"] =
      table.environment_json.empty() ? Json() : Json::parse(table.environment_json);
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace piecework::runner
