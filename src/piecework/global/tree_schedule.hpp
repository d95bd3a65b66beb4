#pragma once

// What a solve consists of, for models of how it would run on other machines.

#include <vector>

namespace piecework::global {

/// Times of one solve on one thread and how its parts depend on each other: all tasks forward; then
/// the fronts level by level, 0 first; then the levels back; then all tasks backward.
struct TreeSchedule {
  struct Part {
    double forward_ms = 0;
    double backward_ms = 0;
    double forward_bytes = 0;  ///< of the factor that are read
    double backward_bytes = 0;
  };
  /// A front above the subtrees: its panels follow each other, each divided into tiles.
  struct Front : Part {
    int level = 0;
    int panels = 0;
    int forward_tiles = 1;  ///< of its largest panel
    int backward_tiles = 1;
  };
  std::vector<Part> tasks;
  std::vector<Front> fronts;  ///< level by level
};

}  // namespace piecework::global
