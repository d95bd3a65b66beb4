#pragma once

// Sewing: chains of vertices or neighbouring borders -> stitches -> which vertices follow which.
// Non-conforming seams by elimination, x = T x_free [Lu25, Sec. 4.4; differs, docs/architecture.md
// D16 to D18].

#include <array>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include <piecework/core/types.hpp>

namespace piecework::mesh {

/// Ratios this close to 0 or 1 are 0 or 1: the vertices coincide. Chosen: far above the rounding of
/// an arc length, far below anything that can be seen.
inline constexpr double kSnapRatio = 1e-9;

/// A vertex sewn onto an edge: x_vertex = (1 - ratio) x_a + ratio x_b.
struct Stitch {
  int vertex = 0;  ///< the slave
  int a = 0;
  int b = 0;
  double ratio = 0;       ///< 0 to 1
  int seam = 0;           ///< index into SeamNames::seams
  double close_time = 0;  ///< s; 0: closed from the start
  /// Found, not asked for: left out where it contradicts another stitch, instead of an error.
  bool yields = false;
};

/// Vertices in order along a border, with the arc length of each from the first, in rest, m. A
/// closed chain names its first vertex again at its end.
struct SeamChain {
  std::vector<int> vertices;
  std::vector<double> arc;  ///< as many, ascending from 0
};

/// Sews two chains, first to first and last to last, by fraction of arc length: chains of different
/// lengths are gathered. The vertices of the finer side (more vertices; `b` if equal) become the
/// slaves.
/// \param where  opens messages
/// \throws InputError if a chain has fewer than two vertices, repeats one (other than closing), or
///         has no length.
std::vector<Stitch> stitch_chains(const SeamChain& a, const SeamChain& b, const std::string& where);

/// Sews borders that lie side by side in `x`: each vertex of the finer side onto the nearest edge
/// of the other within `distance` (m); its own edges and its own neighbours are no place to be sewn
/// to. Which side is finer is decided for each pair of uninterrupted runs of border vertices that
/// found something. All stitches yield. \param x             positions, |V| x 3, m \param first,
/// second border edges of the two cloths; the same edges sew a cloth to itself
std::vector<Stitch> stitch_near(const Positions& x, const std::vector<std::array<int, 2>>& first,
                                const std::vector<std::array<int, 2>>& second, double distance);

/// How messages call seams and vertices.
struct SeamNames {
  std::vector<std::string> seams;
  std::function<std::string(int)> vertex;
};

/// T of x = T x_free + o [Lu25, Sec. 4.4]: every vertex is free (an unknown of its own) or a slave,
/// an affine combination of free ones, its carriers. T is |V| x |free|; its rows sum to 1; rows of
/// free vertices are unit rows and not stored. Empty: nothing is sewn.
struct SeamMap {
  std::vector<int> slaves;         ///< vertices without an unknown, ascending
  std::vector<int> row;            ///< per vertex: index into slaves, -1 if free
  std::vector<int> begin;          ///< per slave: offsets into carrier and weight, one more
  std::vector<int> carrier;        ///< free vertices, ascending for each slave
  std::vector<double> weight;      ///< above 0
  std::vector<double> close_time;  ///< per slave, s: when the last seam it hangs on is closed
  int dropped = 0;                 ///< stitches that yielded to others

  [[nodiscard]] bool empty() const { return slaves.empty(); }
  [[nodiscard]] int num_slaves() const { return static_cast<int>(slaves.size()); }
  [[nodiscard]] bool is_slave(int vertex) const {
    return !row.empty() && row[static_cast<std::size_t>(vertex)] >= 0;
  }
  /// Calls visit(vertex, weight) for what carries a vertex: itself, if it is free.
  template <class Visit>
  void visit_carriers(int vertex, const Visit& visit) const {
    if (!is_slave(vertex)) {
      visit(vertex, 1.0);
      return;
    }
    const auto s = static_cast<std::size_t>(row[static_cast<std::size_t>(vertex)]);
    for (int k = begin[s]; k < begin[s + 1]; ++k)
      visit(carrier[static_cast<std::size_t>(k)], weight[static_cast<std::size_t>(k)]);
  }
};

/// Resolves stitches: coincident vertices become one (their lowest vertex, if it is free, carries
/// the others), each vertex is sewn onto one edge at most, and slaves of slaves are substituted.
/// \throws InputError that names seam and vertex: a vertex out of range, a ratio outside 0 to 1, a
///         vertex sewn onto two different edges, a vertex that through others hangs on itself.
SeamMap resolve_seams(std::span<const Stitch> stitches, int num_vertices, const SeamNames& names);

/// Triangles two corners of which have become one vertex: a seam has sewn neighbours to each other.
std::vector<int> collapsed_triangles(const Triangles& triangles, const SeamMap& seams);

/// Pairs of triangles that face each other across a seam, t0 < t1, ascending, each once: one with
/// an edge of slaves, and one with an edge whose two ends are carried by one free vertex each, both
/// among those that carry the first. Where a coarse side follows and steps over vertices of the
/// fine one, a border edge at one of them is enough. With these pairs the dual graph of the
/// triangles is connected through seams.
std::vector<std::array<int, 2>> seam_neighbors(const Triangles& triangles, const SeamMap& seams);

}  // namespace piecework::mesh
