#pragma once

// The local step: displacements that undo what is wrong. Private to `untangle`.

#include <array>
#include <vector>

#include "tangle.hpp"

namespace piecework::untangle {

/// A demand on displacements u: sum_i weight_i direction . u_vertex_i >= amount.
struct Push {
  std::array<int, 5> vertices;
  std::array<double, 5> weight;  ///< 0: not in use
  Vec3 direction;                ///< unit
  double amount;                 ///< m
};

/// Displacements of single vertices of cloth that meet demands, one demand after the other as in
/// position based dynamics: what is met already asks for nothing more, so that many demands on one
/// vertex do not add up.
struct Displacements {
  Positions u;               ///< |V| x 3, m
  std::vector<char> pushed;  ///< per vertex: some demand wants it to move

  Displacements(const Setting& setting, const std::vector<Push>& pushes);

 private:
  void meet(const Setting& setting, const Push& push, const std::vector<double>& farthest);
};

/// Pushes that undo a tangle.
/// \param step  how far to go where only a direction is known, m
std::vector<Push> untangling_pushes(const Setting& setting, const Tangle& tangle,
                                    const Positions& all, double step);

/// Pushes that open the gaps to what is wanted.
std::vector<Push> opening_pushes(const Closeness& close);

}  // namespace piecework::untangle
