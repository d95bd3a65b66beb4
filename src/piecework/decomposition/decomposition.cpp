#include <piecework/decomposition/decomposition.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <queue>

#include <fmt/format.h>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>

#include "bisection.hpp"

namespace piecework::decomposition {
namespace {

bool bends(const Elements& elements, std::size_t hinge) {
  return elements.hinge_bends.empty() || elements.hinge_bends[hinge] != 0;
}

/// Neighbours across seams, without those that share an edge anyway.
mesh::Adjacency link_across(const TriangleGraph& graph, std::span<const std::array<int, 2>> pairs) {
  std::vector<std::array<int, 2>> links;
  for (const auto& [t0, t1] : pairs) {
    const auto& known = graph.neighbors[static_cast<std::size_t>(t0)];
    if (std::find(known.begin(), known.end(), t1) != known.end()) continue;
    links.push_back({t0, t1});
    links.push_back({t1, t0});
  }
  std::sort(links.begin(), links.end());
  mesh::Adjacency across;
  across.begin.assign(graph.neighbors.size() + 1, 0);
  for (const auto& link : links) {
    ++across.begin[static_cast<std::size_t>(link[0]) + 1];
    across.item.push_back(link[1]);
  }
  std::partial_sum(across.begin.begin(), across.begin.end(), across.begin.begin());
  return across;
}

/// A hinge's work is shared by its two triangles, so a triangle weighs 2 and a hinge 1 on each
/// side.
TriangleGraph build_graph(const Elements& elements) {
  TriangleGraph graph;
  graph.neighbors.assign(elements.triangles.size(), {-1, -1, -1});
  graph.weight.assign(elements.triangles.size(), 2);
  const auto link = [&](int from, int to) {
    auto& slots = graph.neighbors[static_cast<std::size_t>(from)];
    const auto slot = std::find(slots.begin(), slots.end(), -1);
    PIECEWORK_ASSERT(slot != slots.end());
    *slot = to;
  };
  for (std::size_t h = 0; h < elements.hinges.size(); ++h) {
    const auto [t0, t1] = elements.hinges[h].triangles;
    link(t0, t1);
    link(t1, t0);
    if (!bends(elements, h)) continue;
    ++graph.weight[static_cast<std::size_t>(t0)];
    ++graph.weight[static_cast<std::size_t>(t1)];
  }
  if (!elements.seam_neighbors.empty()) graph.across = link_across(graph, elements.seam_neighbors);
  return graph;
}

/// Triangles that become `domains` domains. With more components than domains a set holds several
/// components and stays whole; otherwise it is connected.
struct Piece {
  std::vector<int> triangles;
  std::int64_t weight = 0;
  int domains = 1;
};

std::vector<Piece> connected_components(const TriangleGraph& graph) {
  std::vector<Piece> pieces;
  std::vector<char> seen(graph.neighbors.size(), 0);
  std::vector<int> stack;
  for (std::size_t start = 0; start < seen.size(); ++start) {
    if (seen[start]) continue;
    Piece piece;
    stack.assign(1, static_cast<int>(start));
    seen[start] = 1;
    while (!stack.empty()) {
      const int current = stack.back();
      stack.pop_back();
      piece.triangles.push_back(current);
      piece.weight += graph.weight[static_cast<std::size_t>(current)];
      graph.visit_neighbors(current, [&](int next) {
        if (seen[static_cast<std::size_t>(next)]) return;
        seen[static_cast<std::size_t>(next)] = 1;
        stack.push_back(next);
      });
    }
    std::sort(piece.triangles.begin(), piece.triangles.end());
    pieces.push_back(std::move(piece));
  }
  return pieces;
}

/// Sums of the first 0, 1, ... weights.
std::vector<double> prefix_sums(std::span<const double> weights) {
  std::vector<double> sums(weights.size() + 1, 0.0);
  std::partial_sum(weights.begin(), weights.end(), sums.begin() + 1);
  return sums;
}

/// The number of domains from `first` on, `low` to `high` of them, whose weight is closest to
/// `target`; the fewer of two that are as close.
int count_with_weight(std::span<const double> sums, int first, int low, int high, double target) {
  const auto miss = [&](int count) {
    return std::abs(sums[static_cast<std::size_t>(first) + static_cast<std::size_t>(count)] -
                    sums[static_cast<std::size_t>(first)] - target);
  };
  int best = low;
  for (int count = low + 1; count <= high; ++count)
    if (miss(count) < miss(best)) best = count;
  return best;
}

/// Gives every piece, in order, the next domains: those whose weight is closest to its own.
void share_weighted_domains(std::vector<Piece>& pieces, std::span<const double> weights) {
  const std::vector<double> sums = prefix_sums(weights);
  double work = 0;
  std::int64_t room = 0;  // domains that the pieces not yet served can hold
  for (const Piece& piece : pieces) {
    work += static_cast<double>(piece.weight);
    room += static_cast<std::int64_t>(piece.triangles.size());
  }
  int first = 0;
  double done = 0;
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    Piece& piece = pieces[p];
    const auto size = static_cast<std::int64_t>(piece.triangles.size());
    const auto left = static_cast<std::int64_t>(weights.size()) - first;
    const auto others = static_cast<std::int64_t>(pieces.size() - p - 1);
    room -= size;
    done += static_cast<double>(piece.weight);
    const double target = done / work * sums.back() - sums[static_cast<std::size_t>(first)];
    piece.domains =
        count_with_weight(sums, first, static_cast<int>(std::max<std::int64_t>(1, left - room)),
                          static_cast<int>(std::min(size, left - others)), target);
    first += piece.domains;
  }
}

/// Gives every piece a number of domains: the next one always goes where domains are heaviest.
void share_domains(std::vector<Piece>& pieces, int domains) {
  using Load = std::pair<double, int>;  // weight per domain, -piece: ties go to the first piece
  std::priority_queue<Load> loads;
  for (std::size_t p = 0; p < pieces.size(); ++p)
    loads.emplace(static_cast<double>(pieces[p].weight), -static_cast<int>(p));
  for (int left = domains - static_cast<int>(pieces.size()); left > 0;) {
    const int index = -loads.top().second;
    loads.pop();
    Piece& piece = pieces[static_cast<std::size_t>(index)];
    if (piece.domains >= static_cast<int>(piece.triangles.size())) continue;
    ++piece.domains;
    --left;
    loads.emplace(static_cast<double>(piece.weight) / piece.domains, -index);
  }
}

/// Packs components into `bins` sets, heaviest first, each into the set that is lightest with it,
/// measured by the set's share. \param shares  per set; empty: equal.
std::vector<Piece> pack(std::vector<Piece> pieces, int bins, std::span<const double> shares) {
  std::stable_sort(pieces.begin(), pieces.end(),
                   [](const Piece& a, const Piece& b) { return a.weight > b.weight; });
  std::vector<Piece> packed(static_cast<std::size_t>(bins));
  for (Piece& piece : pieces) {
    const auto load = [&](const Piece& bin) {
      const auto b = static_cast<std::size_t>(&bin - packed.data());
      return static_cast<double>(bin.weight + piece.weight) / (shares.empty() ? 1.0 : shares[b]);
    };
    Piece& bin = *std::min_element(packed.begin(), packed.end(),
                                   [&](const auto& a, const auto& b) { return load(a) < load(b); });
    bin.triangles.insert(bin.triangles.end(), piece.triangles.begin(), piece.triangles.end());
    bin.weight += piece.weight;
  }
  return packed;
}

/// Builds the tree top down; domains are numbered from left to right.
class TreeBuilder {
 public:
  /// \param weights  per domain; empty: equal
  TreeBuilder(const TriangleGraph& graph, int seed, std::span<const double> weights,
              Decomposition& result)
      : graph_(graph), bisector_(graph, seed), result_(result) {
    if (!weights.empty()) sums_ = prefix_sums(weights);
  }

  /// Joins pieces by nodes without separator, then bisects each.
  int join(std::span<Piece> pieces, int parent) {
    if (pieces.size() == 1) return bisect(pieces[0].triangles, pieces[0].domains, parent);
    const int node = add_node(parent);
    const std::size_t half = pieces.size() / 2;
    const int left = join(pieces.first(half), node);  // numbered before the right half
    const int right = join(pieces.subspan(half), node);
    finish(node, left, right);
    return node;
  }

 private:
  int add_node(int parent) {
    result_.nodes.push_back({.parent = parent});
    return static_cast<int>(result_.nodes.size()) - 1;
  }

  void finish(int node, int left, int right) {
    TreeNode& parent = result_.nodes[static_cast<std::size_t>(node)];
    const TreeNode& first = result_.nodes[static_cast<std::size_t>(left)];
    parent.children = {left, right};
    parent.first_domain = first.first_domain;
    parent.num_domains =
        first.num_domains + result_.nodes[static_cast<std::size_t>(right)].num_domains;
  }

  int bisect(std::span<int> set, int domains, int parent) {
    const int node = add_node(parent);
    if (domains == 1) {
      result_.nodes[static_cast<std::size_t>(node)].first_domain = result_.num_domains;
      for (const int triangle : set)
        result_.triangle_domain[static_cast<std::size_t>(triangle)] = result_.num_domains;
      ++result_.num_domains;
      return node;
    }
    const std::size_t first = bisector_.split(set, first_share(domains));
    // Domains are shared out by the weight that each side really got: where a set cannot be halved
    // (limbs of unequal size), the domains still can. Each needs a triangle.
    const double share = weight(set.first(first)) / weight(set);
    const int second = static_cast<int>(set.size() - first);
    const int left = first_domains(share, domains, std::max(1, domains - second),
                                   std::min(domains - 1, static_cast<int>(first)));
    const int left_node = bisect(set.first(first), left, node);
    const int right_node = bisect(set.subspan(first), domains - left, node);
    finish(node, left_node, right_node);
    return node;
  }

  /// Share of the next `domains` domains' work that the first half of them gets.
  [[nodiscard]] double first_share(int domains) const {
    const int half = domains / 2;
    if (sums_.empty()) return static_cast<double>(half) / domains;
    return next_weight(half) / next_weight(domains);
  }

  /// How many of the next `domains` domains, `low` to `high`, fit into `share` of their work.
  [[nodiscard]] int first_domains(double share, int domains, int low, int high) const {
    if (sums_.empty()) return std::clamp(static_cast<int>(std::lround(share * domains)), low, high);
    return count_with_weight(sums_, result_.num_domains, low, high, share * next_weight(domains));
  }

  /// Weight of the next `count` domains: those to the left are made already.
  [[nodiscard]] double next_weight(int count) const {
    return sums_[static_cast<std::size_t>(result_.num_domains) + static_cast<std::size_t>(count)] -
           sums_[static_cast<std::size_t>(result_.num_domains)];
  }

  [[nodiscard]] double weight(std::span<const int> set) const {
    double sum = 0;
    for (const int triangle : set) sum += graph_.weight[static_cast<std::size_t>(triangle)];
    return sum;
  }

  const TriangleGraph& graph_;
  Bisector bisector_;
  Decomposition& result_;
  std::vector<double> sums_;  ///< of the domains' weights; empty: all are equal
};

/// The weights of the first `domains` domains; none if they are all the same.
std::vector<double> checked_weights(const Options& options, int domains) {
  const std::vector<double>& weights = options.domain_weights;
  if (weights.empty()) return {};
  if (weights.size() != static_cast<std::size_t>(options.domains))
    throw InputError(fmt::format("domain_weights: {} weights for {} domains; give one per domain",
                                 weights.size(), options.domains));
  for (std::size_t d = 0; d < weights.size(); ++d)
    if (!(weights[d] > 0) || !std::isfinite(weights[d]))
      throw InputError(fmt::format("domain_weights: weight {} is {}; give a positive finite number",
                                   d, weights[d]));
  const auto last = weights.begin() + domains;
  if (std::all_of(weights.begin(), last, [&](double w) { return w == weights[0]; })) return {};
  return {weights.begin(), last};
}

void own_hinges(const Elements& elements, Decomposition& result) {
  result.hinge_domain.resize(elements.hinges.size());
  parallel_for(elements.hinges.size(), [&](std::size_t h) {
    const auto [t0, t1] = elements.hinges[h].triangles;
    result.hinge_domain[h] = std::min(result.triangle_domain[static_cast<std::size_t>(t0)],
                                      result.triangle_domain[static_cast<std::size_t>(t1)]);
  });
}

/// Calls visit(vertex, domain) for every vertex that a constraint acts on.
template <class Visit>
void for_each_incidence(const Elements& elements, const Decomposition& result, const Visit& visit) {
  const auto visit_carriers = [&](int vertex, int domain) {
    if (elements.seams == nullptr) return visit(vertex, domain);
    elements.seams->visit_carriers(vertex, [&](int carrier, double) { visit(carrier, domain); });
  };
  for (std::size_t t = 0; t < elements.triangles.size(); ++t)
    for (const int vertex : elements.triangles[t])
      visit_carriers(vertex, result.triangle_domain[t]);
  for (std::size_t h = 0; h < elements.hinges.size(); ++h)
    if (bends(elements, h))
      for (const int vertex : elements.hinges[h].vertices)
        visit_carriers(vertex, result.hinge_domain[h]);
}

/// The deepest node whose domains include everything from `low` to `high`.
int lowest_common_node(const std::vector<TreeNode>& nodes, int low, int high) {
  const auto covers = [&](int node) {
    const TreeNode& n = nodes[static_cast<std::size_t>(node)];
    return n.first_domain <= low && high < n.first_domain + n.num_domains;
  };
  int node = 0;
  for (;;) {
    const auto [left, right] = nodes[static_cast<std::size_t>(node)].children;
    if (left >= 0 && covers(left))
      node = left;
    else if (right >= 0 && covers(right))
      node = right;
    else
      return node;
  }
}

void place_vertices(const Elements& elements, Decomposition& result) {
  result.vertex_domains = constraint_domains(elements, result);
  result.vertex_node.assign(static_cast<std::size_t>(elements.num_vertices), 0);
  parallel_for(result.vertex_node.size(), [&](std::size_t v) {
    const int first = result.vertex_domains.begin[v];
    const int last = result.vertex_domains.begin[v + 1];
    if (first == last) return;  // a vertex without constraint may be solved anywhere: the root
    result.vertex_node[v] = lowest_common_node(
        result.nodes, result.vertex_domains.item[static_cast<std::size_t>(first)],
        result.vertex_domains.item[static_cast<std::size_t>(last) - 1]);
  });
  if (elements.seams == nullptr) return;
  for (const int slave : elements.seams->slaves)
    result.vertex_node[static_cast<std::size_t>(slave)] = -1;
}

}  // namespace

// Counted, filled, then sorted and made unique in place.
mesh::Adjacency constraint_domains(const Elements& elements, const Decomposition& result) {
  const auto count = static_cast<std::size_t>(elements.num_vertices);
  std::vector<int> begin(count + 1, 0);
  for_each_incidence(elements, result,
                     [&](int vertex, int) { ++begin[static_cast<std::size_t>(vertex) + 1]; });
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<int> item(static_cast<std::size_t>(begin.back()));
  std::vector<int> cursor(begin.begin(), begin.end() - 1);
  for_each_incidence(elements, result, [&](int vertex, int domain) {
    item[static_cast<std::size_t>(cursor[static_cast<std::size_t>(vertex)]++)] = domain;
  });
  mesh::Adjacency domains;
  domains.begin.push_back(0);
  for (std::size_t v = 0; v < count; ++v) {
    const auto first = item.begin() + begin[v];
    const auto last = item.begin() + begin[v + 1];
    std::sort(first, last);
    domains.item.insert(domains.item.end(), first, std::unique(first, last));
    domains.begin.push_back(static_cast<int>(domains.item.size()));
  }
  return domains;
}

DofClass Decomposition::dof_class(int vertex) const {
  const auto v = static_cast<std::size_t>(vertex);
  const int count = vertex_domains.begin[v + 1] - vertex_domains.begin[v];
  return count > 2 ? DofClass::Corner : count == 2 ? DofClass::Duplicate : DofClass::Internal;
}

Decomposition decompose(const Elements& elements, const Options& options) {
  if (options.domains < 1)
    throw InputError(fmt::format("domains: {} asked for; ask for at least 1", options.domains));
  if (elements.triangles.empty()) throw InputError("domains: the mesh has no triangle to divide");

  Decomposition result;
  result.seed = options.seed;
  result.triangle_domain.assign(elements.triangles.size(), 0);
  int domains = options.domains;
  if (static_cast<std::size_t>(domains) > elements.triangles.size()) {
    domains = static_cast<int>(elements.triangles.size());
    result.notes.push_back(
        fmt::format("{} domains asked for, but the mesh has {} triangles: made {}", options.domains,
                    elements.triangles.size(), domains));
  }

  const std::vector<double> weights = checked_weights(options, domains);
  const TriangleGraph graph = build_graph(elements);
  std::vector<Piece> pieces = connected_components(graph);
  if (static_cast<int>(pieces.size()) > domains) {
    result.notes.push_back(
        fmt::format("{} components in {} domains: some domains hold several components",
                    pieces.size(), domains));
    pieces = pack(std::move(pieces), domains, weights);
  } else if (!weights.empty()) {
    share_weighted_domains(pieces, weights);
  } else {
    share_domains(pieces, domains);
  }
  TreeBuilder(graph, options.seed, weights, result).join(pieces, -1);
  own_hinges(elements, result);
  place_vertices(elements, result);
  return result;
}

Summary summarize(const Decomposition& decomposition, const Elements& elements) {
  Summary summary;
  summary.domains = decomposition.num_domains;
  for (int v = 0; v < elements.num_vertices; ++v) {
    const DofClass dof = decomposition.dof_class(v);
    summary.corner += dof == DofClass::Corner;
    summary.boundary += dof != DofClass::Internal;
  }
  const int slaves = elements.seams == nullptr ? 0 : elements.seams->num_slaves();
  summary.remainder = elements.num_vertices - slaves - summary.corner;

  std::vector<std::int64_t> constraints(static_cast<std::size_t>(summary.domains), 0);
  for (const int domain : decomposition.triangle_domain)
    ++constraints[static_cast<std::size_t>(domain)];
  for (std::size_t h = 0; h < elements.hinges.size(); ++h) {
    const auto [t0, t1] = elements.hinges[h].triangles;
    summary.edge_cut += decomposition.triangle_domain[static_cast<std::size_t>(t0)] !=
                        decomposition.triangle_domain[static_cast<std::size_t>(t1)];
    if (bends(elements, h)) ++constraints[static_cast<std::size_t>(decomposition.hinge_domain[h])];
  }
  const auto total = std::accumulate(constraints.begin(), constraints.end(), std::int64_t{0});
  summary.balance = static_cast<double>(*std::max_element(constraints.begin(), constraints.end())) *
                    summary.domains / static_cast<double>(total);
  return summary;
}

std::string library_version() { return graph::metis_version(); }

std::vector<std::array<int, 2>> adjacent_domains(
    const Decomposition& decomposition, std::span<const mesh::Hinge> hinges,
    std::span<const std::array<int, 2>> seam_neighbors) {
  std::vector<std::array<int, 2>> pairs;
  const auto add = [&](const std::array<int, 2>& triangles) {
    const int a = decomposition.triangle_domain[static_cast<std::size_t>(triangles[0])];
    const int b = decomposition.triangle_domain[static_cast<std::size_t>(triangles[1])];
    if (a != b) pairs.push_back({std::min(a, b), std::max(a, b)});
  };
  for (const mesh::Hinge& hinge : hinges) add(hinge.triangles);
  for (const auto& triangles : seam_neighbors) add(triangles);
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

}  // namespace piecework::decomposition
