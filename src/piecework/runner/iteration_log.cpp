#include <piecework/runner/iteration_log.hpp>

#include <charconv>
#include <iterator>
#include <sstream>

#include <fmt/format.h>

#include <piecework/core/atomic_file.hpp>
#include <piecework/runner/cells.hpp>

namespace piecework::runner {
namespace {

constexpr const char* kHead =
    "step,iteration,energy_j,gradient,error_mean_edges,dx_2,dx_rms,dx_inf,evaluations\r\n";

/// Lines of an earlier log that tell of steps up to `last_step`.
std::string lines_until(const std::string& text, int last_step) {
  std::istringstream lines(text);
  std::string line;
  std::string kept;
  std::getline(lines, line);  // the head
  while (std::getline(lines, line)) {
    int step = 0;
    const auto end = std::from_chars(line.data(), line.data() + line.size(), step);
    if (end.ec != std::errc() || step > last_step) break;
    kept += line + "\n";
  }
  return kept;
}

}  // namespace

IterationLog::IterationLog(const std::filesystem::path& directory, int last_step)
    : path_(directory / kFile), text_(kHead) {
  if (last_step > 0 && std::filesystem::exists(path_))
    text_ += lines_until(read_file(path_), last_step);
}

void IterationLog::attach(model::Integrator& integrator) {
  integrator.observe_iterations(
      [this](int step, const model::StepReport& report, const Positions& /*x*/) {
        const bool start = report.iterations == 0;
        fmt::format_to(std::back_inserter(text_), "{},{},{},{},{},{},{},{},{}\r\n", step,
                       report.iterations, csv_number(report.energy), csv_number(report.gradient),
                       start ? "" : csv_number(report.error), start ? "" : csv_number(report.dx_2),
                       start ? "" : csv_number(report.dx_rms),
                       start ? "" : csv_number(report.dx_inf), report.evaluations);
        return true;
      });
}

void IterationLog::save() const { write_file_atomically(path_, text_); }

}  // namespace piecework::runner
