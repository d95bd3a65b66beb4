#include <piecework/runner/compare.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <piecework/core/error.hpp>
#include <piecework/core/types.hpp>
#include <piecework/runner/cells.hpp>
#include <piecework/runner/saved_run.hpp>

namespace piecework::runner {
namespace {

namespace fs = std::filesystem;

/// Distance of each vertex in two shapes, m.
Eigen::VectorXd distances(const Positions& x, const Positions& y) {
  return (x - y).rowwise().norm();
}

[[noreturn]] void refuse(const SavedRun& a, const SavedRun& b, const std::string& problem,
                         const std::string& remedy) {
  throw InputError(fmt::format("{} and {}: {}; {}", a.directory.string(), b.directory.string(),
                               problem, remedy));
}

void refuse_other_mesh(const SavedRun& a, const SavedRun& b) {
  const char* remedy = "compare runs of one mesh";
  if (a.vertices != b.vertices)
    refuse(a, b, fmt::format("have {} and {} vertices", a.vertices, b.vertices), remedy);
  if (a.triangles != b.triangles)
    refuse(a, b, fmt::format("have {} and {} triangles", a.triangles, b.triangles), remedy);
  const bool recorded = !a.triangles_hash.empty() && !b.triangles_hash.empty();
  if (recorded && a.triangles_hash != b.triangles_hash)
    refuse(a, b, "have triangles between different vertices", remedy);
}

/// Other start shapes are other cloths, or other orders of the vertices.
void refuse_other_start(const SavedRun& a, const SavedRun& b, const Positions& start_b) {
  constexpr double kSame = 1e-6;  // mean edge lengths
  const double gap = distances(read_saved_state(a, 0).x, start_b).maxCoeff();
  if (!(gap <= kSame * b.mean_edge))
    refuse(a, b, fmt::format("start up to {:.3g} m apart, so their meshes differ", gap),
           "compare runs from one start shape");
}

struct CommonTime {
  const FrameRecord* a;
  const FrameRecord* b;
};

/// Frames of both runs at one time, in order.
std::vector<CommonTime> common_times(const SavedRun& a, const SavedRun& b) {
  constexpr double kSame = 1e-6;  // steps
  const double tolerance = kSame * std::min(a.h, b.h);
  std::vector<CommonTime> common;
  auto in_a = a.frames.begin();
  for (const FrameRecord& frame : b.frames) {
    while (in_a != a.frames.end() && in_a->time < frame.time - tolerance) ++in_a;
    if (in_a == a.frames.end()) break;
    if (in_a->time <= frame.time + tolerance) common.push_back({&*in_a, &frame});
  }
  return common;
}

std::string times_of(const SavedRun& run) {
  if (run.frames.empty()) return "no frame";
  return fmt::format("{} frames from {:.6g} to {:.6g} s", run.frames.size(),
                     run.frames.front().time, run.frames.back().time);
}

MedianInterval step_times(const SavedRun& run, int last_frame) {
  std::vector<double> ms;
  for (const FrameRecord& frame : run.frames)
    if (frame.frame <= last_frame) ms.push_back(frame.step_ms);
  return median_interval(std::move(ms));
}

/// Adds a common time; `result.rms` is the sum of squares meanwhile.
void add_frame(Comparison& result, const CommonTime& at, const Positions& x_a, const Positions& x_b,
               bool same_h) {
  const Eigen::VectorXd d = distances(x_a, x_b);
  FrameError error;
  error.frame_a = at.a->frame, error.frame_b = at.b->frame;
  error.time = at.b->time;
  error.max = d.maxCoeff();
  error.rms = std::sqrt(d.squaredNorm() / static_cast<double>(d.size()));
  if (same_h) error.energy = at.a->energy - at.b->energy;
  result.max = std::max(result.max, error.max);
  result.rms += d.squaredNorm();
  if (error.energy && std::abs(*error.energy) >= std::abs(result.energy.value_or(0)))
    result.energy = error.energy;
  result.frames.push_back(error);
}

void finish(Comparison& result) {
  const double count = static_cast<double>(result.frames.size()) * result.vertices;
  result.rms = std::sqrt(result.rms / count);
  result.relative = result.max > 0 ? result.max / result.motion : 0.0;
  result.time_ratio = result.ms_b.median > 0 ? result.ms_a.median / result.ms_b.median
                                             : std::numeric_limits<double>::quiet_NaN();
}

nlohmann::ordered_json median_json(const MedianInterval& m) {
  return {{"median", m.median}, {"low", m.low}, {"high", m.high}, {"n", m.count}};
}

/// Which rows of a long table are shown: ten, evenly, the last one among them.
bool is_shown(std::size_t row, std::size_t rows) {
  constexpr std::size_t kShown = 10;
  if (rows <= 2 * kShown) return true;
  return (row + 1) * kShown / rows != row * kShown / rows;
}

std::string row(const std::string& time, double max, double rms, std::optional<double> energy) {
  return fmt::format("| {} | {} | {} | {} |\n", time, three_digits(max), three_digits(rms),
                     energy ? three_digits(*energy) : kOff);
}

}  // namespace

Comparison compare_runs(const fs::path& path_a, const fs::path& path_b) {
  const SavedRun a = read_saved_run(path_a), b = read_saved_run(path_b);
  refuse_other_mesh(a, b);
  const Positions start = read_saved_state(b, 0).x;
  refuse_other_start(a, b, start);
  const std::vector<CommonTime> common = common_times(a, b);
  if (common.empty())
    refuse(a, b, fmt::format("have no time after 0 in common ({}, {})", times_of(a), times_of(b)),
           "choose step.h and step.output_every so that frames meet");
  Comparison result;
  result.a = path_a, result.b = path_b;
  result.vertices = b.vertices;
  for (const CommonTime& at : common) {
    const Positions x_a = read_saved_state(a, at.a->frame).x;
    const Positions x_b = read_saved_state(b, at.b->frame).x;
    if (!x_a.allFinite() || !x_b.allFinite())  // no maximum would see it
      refuse(a, b, fmt::format("have positions that are no numbers at {:.6g} s", at.b->time),
             "run them again");
    result.motion = std::max(result.motion, distances(x_b, start).maxCoeff());
    add_frame(result, at, x_a, x_b, a.h == b.h);
  }
  result.ms_a = step_times(a, common.back().a->frame);
  result.ms_b = step_times(b, common.back().b->frame);
  finish(result);
  return result;
}

std::string to_json(const Comparison& c) {
  using Json = nlohmann::ordered_json;
  const auto optional = [](const std::optional<double>& v) { return v ? Json(*v) : Json(); };
  Json json = {{"schema", "piecework.compare/1"},
               {"max", c.max},
               {"rms", c.rms},
               {"relative", c.relative},
               {"time_ratio", c.time_ratio},
               {"interleaved", false},
               {"motion", c.motion},
               {"energy_difference_j", optional(c.energy)},
               {"ms_per_step", {{"a", median_json(c.ms_a)}, {"b", median_json(c.ms_b)}}},
               {"a", c.a.string()},
               {"b", c.b.string()},
               {"vertices", c.vertices},
               {"frames", Json::array()}};
  for (const FrameError& f : c.frames)
    json["frames"].push_back({{"time_s", f.time},
                              {"frame_a", f.frame_a},
                              {"frame_b", f.frame_b},
                              {"max", f.max},
                              {"rms", f.rms},
                              {"energy_difference_j", optional(f.energy)}});
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string to_markdown(const Comparison& c) {
  std::string text = fmt::format("A: {}, reference B: {}; {} vertices, {} common times.\n\n",
                                 c.a.string(), c.b.string(), c.vertices, c.frames.size());
  text += "| time (s) | max (m) | RMS (m) | energy A - B (J) |\n|--:|--:|--:|--:|\n";
  for (std::size_t i = 0; i < c.frames.size(); ++i) {
    const FrameError& f = c.frames[i];
    if (is_shown(i, c.frames.size()))
      text += row(fmt::format("{:.6g}", f.time), f.max, f.rms, f.energy);
  }
  text += row("**all**", c.max, c.rms, c.energy);
  text += fmt::format(
      "\nRelative: {} (largest distance / largest displacement of B, {} m).\n"
      "Time A / B: {} ({} / {} ms per step), not interleaved.\n",
      three_digits(c.relative), three_digits(c.motion), three_digits(c.time_ratio),
      median_cell(c.ms_a), median_cell(c.ms_b));
  return text;
}

}  // namespace piecework::runner
