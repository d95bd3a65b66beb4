#pragma once

// Two runs of one cloth, compared where both were saved at the same time: the position error of A
// against the reference B.
//
// With d_i(t) = |x_i^A(t) - x_i^B(t)|, i over the vertices and t over the common times t > 0:
//
//     max      = max_t max_i d_i(t)                                        m
//     rms      = sqrt(mean over t and i of d_i(t)^2)                       m
//     motion   = max_t max_i |x_i^B(t) - x_i^B(0)|                         m
//     relative = max / motion
//
// Time 0 is left out: the start states are equal by definition, and would dilute the mean.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <piecework/core/statistics.hpp>

namespace piecework::runner {

struct FrameError {
  int frame_a = 0, frame_b = 0;
  double time = 0;               ///< s
  double max = 0, rms = 0;       ///< over the vertices, m
  std::optional<double> energy;  ///< incremental potential of A minus that of B, J; same h only
};

struct Comparison {
  std::filesystem::path a, b;
  int vertices = 0;
  std::vector<FrameError> frames;  ///< common times, in order; at least one
  double max = 0, rms = 0, motion = 0;
  double relative = 0;           ///< infinite if B does not move and A differs
  std::optional<double> energy;  ///< the difference largest in size, J
  MedianInterval ms_a, ms_b;     ///< ms per step, frames up to the last common time
  double time_ratio = 0;         ///< medians, A / B; not interleaved. NaN if B has no times
};

/// Compares two run directories. Times match within 1e-6 of the smaller h.
/// \throws InputError if a folder or its record is missing or damaged, if the meshes or the start
///         shapes differ, if no time is common, or if states were not kept.
Comparison compare_runs(const std::filesystem::path& a, const std::filesystem::path& b);

/// {"max", "rms", "relative", "time_ratio", ..., "frames": [...]}, schema "piecework.compare/1".
std::string to_json(const Comparison& comparison);

/// A Markdown table of the common times (of more than twenty: ten, evenly), and of all together.
std::string to_markdown(const Comparison& comparison);

}  // namespace piecework::runner
