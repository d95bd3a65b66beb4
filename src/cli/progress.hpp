#pragma once

// One progress line on a terminal, a log line every few seconds elsewhere. All on stderr.

#include <string>

#include <piecework/core/clock.hpp>

namespace piecework::cli {

class Progress {
 public:
  /// \param verb   "simulating", "rendering"
  /// \param quiet  says nothing at all
  Progress(std::string verb, bool quiet);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Work begins after `first` of `total` frames.
  void start(int first, int total);
  /// `done` of the total are complete. \param detail  e.g. "12 it, gradient 3.1e-03"
  void update(int done, const std::string& detail);
  /// Ends the line; the next message starts on a fresh one.
  void finish();

 private:
  std::string verb_;
  bool quiet_;
  bool terminal_;
  bool line_open_ = false;
  int first_ = 0;
  int total_ = 0;
  double last_print_ms_ = 0;
  Stopwatch watch_;
};

}  // namespace piecework::cli
