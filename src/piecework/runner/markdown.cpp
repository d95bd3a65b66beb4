// summary.md: the tables of a run as they are pasted into a paper or a pull request.

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include <fmt/format.h>

#include <piecework/core/statistics.hpp>
#include <piecework/runner/cells.hpp>
#include <piecework/runner/disturbance.hpp>
#include <piecework/runner/record.hpp>

namespace piecework::runner {
namespace {

std::string milliseconds(double value) { return value < 0 ? kOff : three_digits(value); }

using Column = std::function<double(const FrameRecord&)>;

std::vector<double> values(const RunRecord& record, const Column& column) {
  std::vector<double> result;
  for (const FrameRecord& frame : record.frames) {
    const double value = column(frame);
    if (value >= 0) result.push_back(value);
  }
  return result;
}

double mean(const std::vector<double>& v) {
  return v.empty() ? -1 : std::accumulate(v.begin(), v.end(), 0.0) / static_cast<double>(v.size());
}

double fastest(const RunRecord& record) {
  double ms = record.frames.front().step_min_ms;
  for (const FrameRecord& frame : record.frames) ms = std::min(ms, frame.step_min_ms);
  return ms;
}

double slowest(const RunRecord& record) {
  double ms = 0;
  for (const FrameRecord& frame : record.frames) ms = std::max(ms, frame.step_max_ms);
  return ms;
}

/// The columns of the paper's Table 1; what this run does not have is "-".
std::string table_one(const RunRecord& record, const World& world) {
  const auto phase = [&](double model::PhaseTimes::*member) {
    const auto v = values(record, [&](const FrameRecord& f) { return f.phases.*member; });
    // Per step of the run, as in the paper: a phase that ran in few steps is spread over all.
    return v.empty() ? std::string(kOff)
                     : three_digits(std::accumulate(v.begin(), v.end(), 0.0) /
                                    static_cast<double>(record.frames.size()));
  };
  const std::vector<double> steps = values(record, [](const FrameRecord& f) { return f.step_ms; });
  const MedianInterval median = median_interval(steps);
  const auto& s = world.domain_summary;
  const double iterations =
      mean(values(record, [](const FrameRecord& f) { return double(f.iterations) / f.steps; }));
  std::string text =
      "| Scene | # D | # DOF | # Elements | # C\\|B\\|R | # its | Cull | Nrw. | L | G | Ref. | SD "
      "| PCG | Misc. | Min | Max | Med | Avg |\n"
      "|:--|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n";
  text += fmt::format(
      "| {} | {} | {} | {} | {}\\|{}\\|{} | {} | {} | {} | {} | {} | {} | - | - | {} | {} | {} | "
      "{} "
      "| {} |\n",
      plain_cell(world.scene.name), s.domains, 3 * world.model.num_vertices(),
      world.model.triangles.size(), s.corner, s.boundary, s.remainder, three_digits(iterations),
      phase(&model::PhaseTimes::cull), phase(&model::PhaseTimes::narrow),
      phase(&model::PhaseTimes::local), phase(&model::PhaseTimes::global),
      phase(&model::PhaseTimes::refactor), phase(&model::PhaseTimes::misc),
      three_digits(fastest(record)), three_digits(slowest(record)), three_digits(median.median),
      three_digits(mean(steps)));
  return text;
}

/// Phases may leave 5 % of the run unexplained, and may not exceed it.
bool phases_explain(const RunRecord& record) {
  double other = 0;
  double total = 0;
  for (const FrameRecord& frame : record.frames) {
    other += frame.other_ms() * frame.steps;
    total += frame.step_ms * frame.steps;
  }
  return other >= -1e-9 * total && other <= 0.05 * total;
}

std::string phase_table(const RunRecord& record) {
  const std::vector<double> steps = values(record, [](const FrameRecord& f) { return f.step_ms; });
  const double total = std::accumulate(steps.begin(), steps.end(), 0.0);
  std::string text = fmt::format(
      "| Phase | ms per step, median [95 % interval, from 6 frames on] | mean | share | n "
      "|\n|:--|--:|--:|--:|--:|\n");
  const auto row = [&](const char* name, const Column& column) {
    const std::vector<double> v = values(record, column);
    const double sum = std::accumulate(v.begin(), v.end(), 0.0);
    const std::string share = v.empty() ? kOff : fmt::format("{:.1f} %", 100 * sum / total);
    text += fmt::format("| {} | {} | {} | {} | {} |\n", name, median_cell(median_interval(v)),
                        milliseconds(mean(v)), share, v.size());
  };
  row("Broad phase (Cull)", [](const FrameRecord& f) { return f.phases.cull; });
  row("Contact forces, continuous detection (Nrw.)",
      [](const FrameRecord& f) { return f.phases.narrow; });
  row("Local step (L)", [](const FrameRecord& f) { return f.phases.local; });
  row("Global step (G)", [](const FrameRecord& f) { return f.phases.global; });
  row("Refactorisation (Ref.)", [](const FrameRecord& f) { return f.phases.refactor; });
  row("Forces, prediction, velocities (Misc.)", [](const FrameRecord& f) { return f.phases.misc; });
  row("Check for interpenetrations", [](const FrameRecord& f) { return f.phases.check; });
  row(phases_explain(record) ? "Other" : "Other **FAIL**: the phases do not add up to the step",
      [](const FrameRecord& f) { return std::max(0.0, f.other_ms()); });
  row("**Step**", [](const FrameRecord& f) { return f.step_ms; });
  return text;
}

std::string accuracy_table(const RunRecord& record) {
  std::string text = "| Accuracy | median | worst |\n|:--|--:|--:|\n";
  const auto row = [&](const char* name, const Column& column) {
    const std::vector<double> v = values(record, column);
    text += fmt::format("| {} | {} | {} |\n", name, three_digits(median_interval(v).median),
                        three_digits(v.empty() ? 0 : *std::max_element(v.begin(), v.end())));
  };
  row("Gradient (rms nodal residual / mean nodal weight)",
      [](const FrameRecord& f) { return f.gradient; });
  row("Estimated position error (mean edge lengths)", [](const FrameRecord& f) { return f.error; });
  row("L-G iterations per step",
      [](const FrameRecord& f) { return double(f.iterations) / f.steps; });
  const auto contact = [&](const char* name, int model::ContactReport::*member) {
    row(name, [member](const FrameRecord& f) { return f.contact ? *f.contact.*member : -1.0; });
  };
  contact("Pairs in contact", &model::ContactReport::pairs);
  contact("Interpenetrations", &model::ContactReport::interpenetrations);
  row("Last increment, 2-norm in the unit box (the paper's stop)",
      [](const FrameRecord& f) { return f.dx_2; });
  return text;
}

std::string convergence_line(const RunRecord& record, const World& world) {
  const Totals sum = totals(record.frames);
  const scene::Quality& quality = world.scene.quality;
  std::string rule = quality.stop == "iterations"
                         ? fmt::format("{} iterations", quality.max_iterations)
                         : fmt::format("`{}` <= {:g}, at most {} iterations", quality.stop,
                                       quality.tolerance, quality.max_iterations);
  return fmt::format("Stop rule: {}; {} of {} steps reached it.\n", rule, sum.converged_steps,
                     sum.steps);
}

std::string environment_list(const RunRecord& record) {
  return list_of(record.environment_json) +
         fmt::format("- threads: {}\n- load before and after: {:.2f}, {:.2f}\n", record.threads,
                     record.load_before, record.load_after);
}

/// What was not as in the scene's file.
std::string overrides_line(const RunRecord& record) {
  std::string text = "Changed for this run:";
  for (const auto& [key, value] : record.overrides) text += fmt::format(" `{}={}`", key, value);
  return text + "\n";
}

std::string expectation_table(const RunRecord& record) {
  if (record.expectations.empty()) return "";
  std::string text = "\n## Expectations\n\n| Expectation | found | |\n|:--|--:|:--|\n";
  for (const ExpectationResult& e : record.expectations)
    text += fmt::format("| {} | {} | {} |\n", e.text, e.reached ? three_digits(e.value) : kOff,
                        e.holds ? "holds" : (e.reached ? "**FAIL**" : "not reached"));
  return text;
}

}  // namespace

std::string to_markdown(const RunRecord& record, const World& world) {
  std::string text = fmt::format("# {}\n\n", world.scene.name);
  if (!world.scene.description.empty()) text += world.scene.description + "\n\n";
  if (record.frames.empty()) return text + "No step was simulated.\n";
  const bool disturbed = is_disturbed(record);
  text += fmt::format("{}, {} threads, h = {:.6g} s. Times in ms per step{}.\n\n", record.method,
                      record.threads, world.scene.step.h, disturbed ? " †" : "");
  if (!record.overrides.empty()) text += overrides_line(record) + "\n";
  text += table_one(record, world);
  text += "\n" + phase_table(record);
  text += "\n" + accuracy_table(record);
  text += "\n" + convergence_line(record, world);
  text += fmt::format("Set-up: load {} ms, domains {} ms, analysis and factorisation {} ms.\n",
                      three_digits(world.load_ms), three_digits(world.partition_ms),
                      three_digits(record.setup.ms));
  if (record.setup.factor_nonzeros > 0)
    text += fmt::format("Factor: {} nonzeros, {} MB.\n", three_digits(record.setup.factor_nonzeros),
                        three_digits(record.setup.factor_bytes / 1e6));
  if (!world.model.sewing.empty())
    text += fmt::format("Seams: {} of {} vertices follow others.\n",
                        world.model.sewing.map().num_slaves(), world.model.num_vertices());
  if (disturbed)
    text += fmt::format("\n† Disturbed: other work kept {} processors busy during the run.\n",
                        three_digits(record.other_processors));
  for (const std::string& note : world.notes) text += fmt::format("\nNote: {}.\n", note);
  text += expectation_table(record);
  text += "\n## Environment\n\n" + environment_list(record);
  return text;
}

}  // namespace piecework::runner
