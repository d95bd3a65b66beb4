#include <piecework/runner/record.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <span>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <piecework/core/error.hpp>
#include <piecework/core/hash.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/runner/disturbance.hpp>
#include <piecework/scene/scene_io.hpp>

namespace piecework::runner {
namespace {

using Json = nlohmann::ordered_json;

struct PhaseColumn {
  const char* key;
  double model::PhaseTimes::*member;
};
constexpr PhaseColumn kPhases[] = {
    {"cull", &model::PhaseTimes::cull},         {"narrow", &model::PhaseTimes::narrow},
    {"local", &model::PhaseTimes::local},       {"global", &model::PhaseTimes::global},
    {"refactor", &model::PhaseTimes::refactor}, {"misc", &model::PhaseTimes::misc},
    {"check", &model::PhaseTimes::check}};

struct ContactCounter {
  const char* key;
  int model::ContactReport::*member;
};
constexpr ContactCounter kContactCounters[] = {
    {"contact_pairs", &model::ContactReport::pairs},
    {"candidate_pairs", &model::ContactReport::candidates},
    {"shortened_moves", &model::ContactReport::shortened},
    {"interpenetrations", &model::ContactReport::interpenetrations}};

void add_phase(double& sum, double value) {
  if (value >= 0) sum = std::max(sum, 0.0) + value;
}

Json counters_json(const FrameRecord& frame) {
  Json counters = {{"iterations", frame.iterations},
                   {"global_solves", frame.global_solves},
                   {"converged_steps", frame.converged_steps},
                   {"degenerate_projections", frame.degenerate_projections}};
  if (!frame.contact) return counters;
  for (const auto& [key, member] : kContactCounters) counters[key] = *frame.contact.*member;
  return counters;
}

/// \param counters  as counters_json() writes them
void read_counters(const Json& counters, FrameRecord& frame) {
  frame.iterations = counters.at("iterations");
  frame.global_solves = counters.at("global_solves");
  frame.converged_steps = counters.at("converged_steps");
  frame.degenerate_projections = counters.at("degenerate_projections");
  if (!counters.contains(kContactCounters[0].key)) return;
  frame.contact.emplace();
  for (const auto& [key, member] : kContactCounters) *frame.contact.*member = counters.at(key);
}

Json frame_json(const FrameRecord& frame) {
  Json phases;
  for (const auto& [key, member] : kPhases)
    if (frame.phases.*member >= 0) phases[key] = frame.phases.*member;  // what is off has no key
  phases["other"] = frame.other_ms();
  return {{"frame", frame.frame},
          {"step", frame.step},
          {"time_s", frame.time},
          {"steps", frame.steps},
          {"step_ms", frame.step_ms},
          {"step_ms_min", frame.step_min_ms},
          {"step_ms_max", frame.step_max_ms},
          {"phases_ms", phases},
          {"counters", counters_json(frame)},
          {"gradient", frame.gradient},
          {"error_mean_edges", frame.error},
          {"energy_j", frame.energy},
          {"dx_unit_box", {{"norm_2", frame.dx_2}, {"rms", frame.dx_rms}, {"inf", frame.dx_inf}}}};
}

FrameRecord frame_from_json(const Json& json) {
  FrameRecord frame;
  frame.frame = json.at("frame");
  frame.step = json.at("step");
  frame.time = json.at("time_s");
  frame.steps = json.at("steps");
  frame.step_ms = json.at("step_ms");
  frame.step_min_ms = json.at("step_ms_min");
  frame.step_max_ms = json.at("step_ms_max");
  for (const auto& [key, member] : kPhases)
    if (json.at("phases_ms").contains(key)) frame.phases.*member = json.at("phases_ms").at(key);
  read_counters(json.at("counters"), frame);
  frame.gradient = json.at("gradient");
  // JSON has no infinity: an estimate that does not exist yet is null.
  const auto number = [](const Json& value) {
    return value.is_null() ? std::numeric_limits<double>::infinity() : value.get<double>();
  };
  frame.error = number(json.at("error_mean_edges"));
  frame.energy = json.at("energy_j");
  frame.dx_2 = json.at("dx_unit_box").at("norm_2");
  frame.dx_rms = json.at("dx_unit_box").at("rms");
  frame.dx_inf = json.at("dx_unit_box").at("inf");
  return frame;
}

Json domains_json(const World& world) {
  const decomposition::Summary& s = world.domain_summary;
  return {{"domains", s.domains},      {"corner", s.corner},     {"boundary", s.boundary},
          {"remainder", s.remainder},  {"edge_cut", s.edge_cut}, {"balance", s.balance},
          {"seed", world.domains.seed}};
}

Json scene_json(const RunRecord& record, const World& world) {
  Json overrides = Json::object();
  for (const auto& [key, value] : record.overrides) overrides[key] = value;
  Json json = {{"name", world.scene.name},
               {"motion_hash", record.motion_hash},
               {"overrides", overrides},
               {"vertices", world.model.num_vertices()},
               {"dof", 3 * world.model.num_vertices()},
               {"triangles", world.model.triangles.size()},
               {"triangles_hash", Hash().add(std::span(world.model.triangles)).hex()},
               {"bending_hinges", world.model.bend.size()},
               {"h_s", world.scene.step.h},
               {"mean_edge_m", world.model.mean_edge},
               {"domains", domains_json(world)}};
  if (!world.model.sewing.empty())  // what is off has no key
    json["sewn_vertices"] = world.model.sewing.map().num_slaves();
  if (world.untangling) {
    const untangle::UntangleReport& r = *world.untangling;
    json["untangling"] = {
        {"edges_through_triangles", {{"before", r.before.edges}, {"after", r.after.edges}}},
        {"vertices_inside", {{"before", r.before.inside}, {"after", r.after.inside}}},
        {"rounds", r.rounds},
        {"largest_move_m", r.largest_move}};
  }
  json["resolved"] = Json::parse(scene::resolved_json(world.scene));
  return json;
}

}  // namespace

void FrameRecord::add(const model::StepReport& report) {
  step_min_ms = steps == 0 ? report.step_ms : std::min(step_min_ms, report.step_ms);
  step_max_ms = std::max(step_max_ms, report.step_ms);
  ++steps;
  step_ms += report.step_ms;
  for (const auto& [key, member] : kPhases) add_phase(phases.*member, report.phases.*member);
  iterations += report.iterations;
  global_solves += report.global_solves;
  converged_steps += report.converged;
  degenerate_projections += report.degenerate_projections;
  if (report.contact) add_contact(*report.contact);
  gradient = std::max(gradient, report.gradient);
  error = std::max(error, report.error);
  energy = report.energy;
  dx_2 = report.dx_2;
  dx_rms = report.dx_rms;
  dx_inf = report.dx_inf;
}

void FrameRecord::add_contact(const model::ContactReport& report) {
  if (!contact) contact.emplace();
  for (const auto& [key, member] : kContactCounters) {
    int& value = *contact.*member;
    value = member == &model::ContactReport::shortened ? value + report.*member
                                                       : std::max(value, report.*member);
  }
}

void FrameRecord::finish(int frame_number, const model::State& state) {
  frame = frame_number;
  step = state.step;
  time = state.time;
  step_ms /= steps;
  for (const auto& [key, member] : kPhases)
    if (phases.*member >= 0) phases.*member /= steps;
}

double FrameRecord::other_ms() const {
  double sum = 0;
  for (const auto& [key, member] : kPhases) sum += std::max(0.0, phases.*member);
  return step_ms - sum;
}

Totals totals(const std::vector<FrameRecord>& frames) {
  Totals sum;
  for (const FrameRecord& frame : frames) {
    sum.steps += frame.steps;
    sum.converged_steps += frame.converged_steps;
    sum.iterations += frame.iterations;
    if (frame.contact)
      sum.interpenetrations = std::max(sum.interpenetrations, frame.contact->interpenetrations);
  }
  return sum;
}

bool is_disturbed(const RunRecord& record) {
  constexpr double kNoticeable = 0.1;  // processors
  const double spare = std::max(0, available_threads() - record.threads);
  return record.other_processors > spare + kNoticeable;
}

std::string to_json(const RunRecord& record, const World& world) {
  Json json;
  json["schema"] = "piecework.run/1";
  json["environment"] = Json::parse(record.environment_json);
  json["environment"]["load_before"] = record.load_before;
  json["environment"]["load_after"] = record.load_after;
  json["environment"]["other_processors"] = record.other_processors;
  json["environment"]["disturbed"] = is_disturbed(record);
  json["environment"]["threads"] = record.threads;
  json["scene"] = scene_json(record, world);
  json["method"] = record.method;
  json["setup"] = {{"load_ms", world.load_ms},
                   {"partition_ms", world.partition_ms},
                   {"solver_ms", record.setup.ms},
                   {"factor_nonzeros", record.setup.factor_nonzeros},
                   {"factor_bytes", record.setup.factor_bytes}};
  json["notes"] = world.notes;
  json["frames"] = Json::array();
  for (const FrameRecord& frame : record.frames) json["frames"].push_back(frame_json(frame));
  json["expectations"] = Json::array();
  for (const ExpectationResult& e : record.expectations)
    json["expectations"].push_back({{"text", e.text},
                                    {"reached", e.reached},
                                    {"value", e.reached ? Json(e.value) : Json()},
                                    {"holds", e.holds}});
  return json.dump(1) + "\n";
}

RecordedPart recorded_part(std::string_view text, const std::string& source, int last_step) {
  RecordedPart part;
  try {
    const Json json = Json::parse(text);
    for (const Json& frame : json.at("frames")) {
      if (frame.at("step").get<int>() > last_step) break;
      part.frames.push_back(frame_from_json(frame));
    }
    for (const Json& e : json.at("expectations"))
      if (e.at("reached").get<bool>())
        part.expectations.push_back({e.at("text"), true, e.at("value"), e.at("holds")});
  } catch (const Json::exception& error) {
    throw InputError(
        fmt::format("{}: not a run record of this version ({}); run with --overwrite to start anew",
                    source, error.what()));
  }
  return part;
}

std::string to_csv(const RunRecord& record) {
  std::string csv = "frame,step,time_s,phase,ms_per_step\r\n";
  for (const FrameRecord& frame : record.frames) {
    const auto row = [&](const char* phase, double ms) {
      csv +=
          fmt::format("{},{},{:.9g},{},{:.6g}\r\n", frame.frame, frame.step, frame.time, phase, ms);
    };
    for (const auto& [key, member] : kPhases)
      if (frame.phases.*member >= 0) row(key, frame.phases.*member);
    row("other", frame.other_ms());
    row("step", frame.step_ms);
  }
  return csv;
}

}  // namespace piecework::runner
