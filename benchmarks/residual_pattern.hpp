#pragma once

// How patterned a residual is: measures for our analogue of the paper's Fig. 7.

#include <array>
#include <vector>

#include <piecework/core/types.hpp>

namespace piecework::bench {

using Edges = std::vector<std::array<int, 2>>;

/// Each edge of the triangles once.
Edges edges_of(const Triangles& triangles);

/// log10(|r_v| / rms + 1e-3) of a force residual per mass, for the vertices that are free; 0 for
/// others. The offset keeps vertices that happen to be at rest from dominating.
Eigen::VectorXd residual_pattern(const Positions& gradient, const Eigen::VectorXd& mass,
                                 const std::vector<char>& fixed);

/// Moran's I over edges between free vertices: 1 where neighbours have equal values, about 0 where
/// values are scattered at random, negative where they alternate.
double moran(const Eigen::VectorXd& values, const Edges& edges, const std::vector<char>& fixed);

/// Pearson's correlation over free vertices.
double correlation(const Eigen::VectorXd& a, const Eigen::VectorXd& b,
                   const std::vector<char>& fixed);

}  // namespace piecework::bench
