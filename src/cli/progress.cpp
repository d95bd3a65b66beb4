#include "progress.hpp"
#include "console.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include <fmt/format.h>

namespace piecework::cli {
namespace {

constexpr double kTerminalIntervalMs = 100;
constexpr double kLogIntervalMs = 5000;

std::string duration(double seconds) {
  const auto s = std::lround(seconds);
  if (s < 60) return fmt::format("{} s", s);
  if (s < 3600) return fmt::format("{} min {:02} s", s / 60, s % 60);
  return fmt::format("{} h {:02} min", s / 3600, s / 60 % 60);
}

}  // namespace

Progress::Progress(std::string verb, bool quiet)
    : verb_(std::move(verb)), quiet_(quiet), terminal_(::isatty(STDERR_FILENO) != 0) {}

Progress::~Progress() { finish(); }

void Progress::start(int first, int total) {
  first_ = first;
  total_ = total;
  watch_.lap();
  last_print_ms_ = 0;
}

void Progress::update(int done, const std::string& detail) {
  if (quiet_) return;
  const double elapsed = watch_.elapsed_ms();
  const double interval = terminal_ ? kTerminalIntervalMs : kLogIntervalMs;
  if (done < total_ && elapsed - last_print_ms_ < interval) return;
  last_print_ms_ = elapsed;
  const double rate = (done - first_) / std::max(1e-3, elapsed / 1000);
  std::string line = fmt::format("{} frame {}/{}", verb_, done, total_);
  if (done > first_) {
    line += rate >= 1 ? fmt::format(", {:.1f} frames/s", rate)
                      : fmt::format(", {:.1f} s/frame", 1 / rate);
    if (done < total_) line += ", ETA " + duration((total_ - done) / rate);
  }
  if (!detail.empty()) line += "  (" + detail + ")";
  if (terminal_)
    say("\r\033[K{}", line);
  else
    say("{}\n", line);
  line_open_ = terminal_;
}

void Progress::finish() {
  if (line_open_) say("\n");
  line_open_ = false;
}

}  // namespace piecework::cli
