#pragma once

// Loops and sums over the rows of |V| x 3 vectors; sums column by column, in a fixed order. Private
// to the global module.

#include <piecework/core/parallel.hpp>
#include <piecework/core/types.hpp>

namespace piecework::global {

/// Calls body(v) for the rows v of |V| x 3 vectors, in parallel.
template <class Body>
void for_each_row(Eigen::Index rows, const Body& body) {
  parallel_for(static_cast<std::size_t>(rows),
               [&](std::size_t i) { body(static_cast<Eigen::Index>(i)); });
}

/// One number per right-hand side; starts at zero, as parallel_sum() wants it.
struct ColumnSums {
  Eigen::Array<double, 1, 3> value = Eigen::Array<double, 1, 3>::Zero();
  void operator+=(const ColumnSums& other) { value += other.value; }
};

/// a . b in each column.
inline Eigen::Array<double, 1, 3> column_dots(const Positions& a, const Positions& b) {
  return parallel_sum<ColumnSums>(static_cast<std::size_t>(a.rows()),
                                  [&](std::size_t i) {
                                    const auto v = static_cast<Eigen::Index>(i);
                                    return ColumnSums{a.row(v).array() * b.row(v).array()};
                                  })
      .value;
}

/// numerator / denominator where that is positive, else 0: a column that is solved stands still.
inline Eigen::Array<double, 1, 3> safe_ratio(const Eigen::Array<double, 1, 3>& numerator,
                                             const Eigen::Array<double, 1, 3>& denominator) {
  return (denominator > 0).select(numerator / denominator, 0.0);
}

}  // namespace piecework::global
