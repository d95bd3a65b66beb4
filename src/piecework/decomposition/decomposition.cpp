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

/// Packs components into `bins` sets, heaviest first into the lightest set.
std::vector<Piece> pack(std::vector<Piece> pieces, int bins) {
  std::stable_sort(pieces.begin(), pieces.end(),
                   [](const Piece& a, const Piece& b) { return a.weight > b.weight; });
  std::vector<Piece> packed(static_cast<std::size_t>(bins));
  for (Piece& piece : pieces) {
    Piece& bin =
        *std::min_element(packed.begin(), packed.end(),
                          [](const Piece& a, const Piece& b) { return a.weight < b.weight; });
    bin.triangles.insert(bin.triangles.end(), piece.triangles.begin(), piece.triangles.end());
    bin.weight += piece.weight;
  }
  return packed;
}

/// Builds the tree top down; domains are numbered from left to right.
class TreeBuilder {
 public:
  TreeBuilder(const TriangleGraph& graph, const Options& options, Decomposition& result)
      : graph_(graph), bisector_(graph, options.seed), result_(result) {}

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
    const int half = domains / 2;
    const std::size_t first = bisector_.split(set, static_cast<double>(half) / domains);
    // Domains are shared out by the weight that each side really got: where a set cannot be halved
    // (limbs of unequal size), the domains still can. Each needs a triangle.
    const double share = weight(set.first(first)) / weight(set);
    const int second = static_cast<int>(set.size() - first);
    const int left =
        std::clamp(static_cast<int>(std::lround(share * domains)), std::max(1, domains - second),
                   std::min(domains - 1, static_cast<int>(first)));
    const int left_node = bisect(set.first(first), left, node);
    const int right_node = bisect(set.subspan(first), domains - left, node);
    finish(node, left_node, right_node);
    return node;
  }

  [[nodiscard]] double weight(std::span<const int> set) const {
    double sum = 0;
    for (const int triangle : set) sum += graph_.weight[static_cast<std::size_t>(triangle)];
    return sum;
  }

  const TriangleGraph& graph_;
  Bisector bisector_;
  Decomposition& result_;
};

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

/// Domains of each vertex: counted, filled, then sorted and made unique in place.
mesh::Adjacency collect_vertex_domains(const Elements& elements, const Decomposition& result) {
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
  result.vertex_domains = collect_vertex_domains(elements, result);
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

  const TriangleGraph graph = build_graph(elements);
  std::vector<Piece> pieces = connected_components(graph);
  if (static_cast<int>(pieces.size()) > domains) {
    result.notes.push_back(
        fmt::format("{} components in {} domains: some domains hold several components",
                    pieces.size(), domains));
    pieces = pack(std::move(pieces), domains);
  } else {
    share_domains(pieces, domains);
  }
  TreeBuilder(graph, options, result).join(pieces, -1);
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
