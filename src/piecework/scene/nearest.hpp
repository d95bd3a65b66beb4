#pragma once

// Private to the module: "did you mean".

#include <string>
#include <string_view>
#include <vector>

namespace piecework::scene {

/// Fewest insertions, deletions, replacements and swaps of neighbours that turn `a` into `b`
/// (optimal string alignment), letter case and the choice of '-', ' ' or '_' not counted.
std::size_t edit_distance(std::string_view a, std::string_view b);

/// The candidate nearest to `name`, the first of several; empty if none is alike (more than two
/// edits in five letters). Names of more than 100 characters are like none.
std::string nearest(std::string_view name, const std::vector<std::string>& candidates);

/// `did you mean "x"?`, or `known <what>: a, b, c` if none is alike.
std::string suggestion(std::string_view name, const std::vector<std::string>& candidates,
                       const std::string& what);

}  // namespace piecework::scene
