#include <piecework/mesh/seams.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include <fmt/format.h>

#include <piecework/core/error.hpp>

namespace piecework::mesh {
namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

void check_chain(const SeamChain& chain, const std::string& where) {
  if (chain.vertices.size() < 2 || chain.arc.size() != chain.vertices.size())
    throw InputError(fmt::format("{}: a chain of {} vertices; a seam needs at least 2 on each side",
                                 where, chain.vertices.size()));
  // A closed chain may name its first vertex again, at its end.
  std::vector<int> sorted(
      chain.vertices.begin() + (chain.vertices.front() == chain.vertices.back() ? 1 : 0),
      chain.vertices.end());
  std::sort(sorted.begin(), sorted.end());
  const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
  if (twice != sorted.end())
    throw InputError(
        fmt::format("{}: a chain names a vertex twice; remove one, or end the chain where it "
                    "closes",
                    where));
  if (!(chain.arc.back() > 0) || !std::is_sorted(chain.arc.begin(), chain.arc.end()))
    throw InputError(fmt::format("{}: a chain has no length; its vertices coincide", where));
}

/// Gathers the stitches of one set of vertices into unknowns and combinations of them.
class Resolver {
 public:
  Resolver(std::span<const Stitch> stitches, int num_vertices, const SeamNames& names)
      : stitches_(stitches), names_(names), parent_(at(num_vertices)), rule_(at(num_vertices), -1) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }

  SeamMap resolve() {
    for (const Stitch& stitch : stitches_) check(stitch);
    merge();
    for (const bool yields : {false, true})
      for (std::size_t i = 0; i < stitches_.size(); ++i)
        if (stitches_[i].yields == yields && !merged_[i]) add_rule(static_cast<int>(i));
    return build();
  }

 private:
  using Row = std::vector<std::pair<int, double>>;  ///< free class and weight, ascending

  [[nodiscard]] std::string seam(const Stitch& stitch) const {
    return names_.seams[at(stitch.seam)];
  }

  void check(const Stitch& stitch) const {
    for (const int v : {stitch.vertex, stitch.a, stitch.b})
      if (v < 0 || v >= static_cast<int>(parent_.size()))
        throw InputError(fmt::format("{}: vertex {} does not exist; there are {} vertices",
                                     seam(stitch), v, parent_.size()));
    if (!(stitch.ratio >= 0 && stitch.ratio <= 1))
      throw InputError(
          fmt::format("{}: {} is sewn with the ratio {}; choose one of 0 (at {}) to 1 (at {})",
                      seam(stitch), names_.vertex(stitch.vertex), stitch.ratio,
                      names_.vertex(stitch.a), names_.vertex(stitch.b)));
  }

  int find(int v) {
    while (parent_[at(v)] != v) v = parent_[at(v)] = parent_[at(parent_[at(v)])];
    return v;
  }

  void unite(int u, int v) {
    u = find(u);
    v = find(v);
    parent_[at(std::max(u, v))] = std::min(u, v);
  }

  /// Stitches at the end of their edge, or on edges that others have made a point.
  void merge() {
    merged_.assign(stitches_.size(), 0);
    for (bool changed = true; changed;) {
      changed = false;
      for (std::size_t i = 0; i < stitches_.size(); ++i) {
        const Stitch& s = stitches_[i];
        const bool at_a = s.ratio <= kSnapRatio || find(s.a) == find(s.b);
        if (merged_[i] || !(at_a || s.ratio >= 1 - kSnapRatio)) continue;
        unite(s.vertex, at_a ? s.a : s.b);
        merged_[i] = 1;
        changed = true;
      }
    }
  }

  /// True if `wanted` is `from` or among what carries it.
  bool hangs_on(int from, int wanted) {
    std::vector<int> stack = {find(from)};
    std::set<int> seen;
    while (!stack.empty()) {
      const int c = stack.back();
      stack.pop_back();
      if (c == wanted) return true;
      if (rule_[at(c)] < 0 || !seen.insert(c).second) continue;
      const Stitch& stitch = stitches_[at(rule_[at(c)])];
      stack.push_back(find(stitch.a));
      stack.push_back(find(stitch.b));
    }
    return false;
  }

  bool same_place(const Stitch& s, const Stitch& t) {
    constexpr double kSame = 1e-6;  // of an edge
    if (find(s.a) == find(t.a) && find(s.b) == find(t.b))
      return std::abs(s.ratio - t.ratio) <= kSame;
    return find(s.a) == find(t.b) && find(s.b) == find(t.a) &&
           std::abs(s.ratio - (1 - t.ratio)) <= kSame;
  }

  void add_rule(int index) {
    const Stitch& stitch = stitches_[at(index)];
    const int c = find(stitch.vertex);
    const int other = rule_[at(c)];
    if (other >= 0) {
      if (same_place(stitch, stitches_[at(other)])) return;
      return refuse_second(stitch, stitches_[at(other)]);
    }
    if (hangs_on(stitch.a, c) || hangs_on(stitch.b, c)) return refuse_cycle(stitch);
    rule_[at(c)] = index;
  }

  void refuse_second(const Stitch& stitch, const Stitch& first) {
    if (stitch.yields) return void(++dropped_);
    throw InputError(fmt::format(
        "{}: {} is sewn onto two edges, {} to {} and {} to {} (by {}); remove one of "
        "the stitches, or sew the other two sides to each other instead",
        seam(stitch), names_.vertex(stitch.vertex), names_.vertex(stitch.a),
        names_.vertex(stitch.b), names_.vertex(first.a), names_.vertex(first.b), seam(first)));
  }

  void refuse_cycle(const Stitch& stitch) {
    if (stitch.yields) return void(++dropped_);
    throw InputError(
        fmt::format("{}: {} hangs on itself: what it is sewn onto ({} to {}) is sewn onto it; "
                    "exchange the sides of one of the seams, or remove the stitch",
                    seam(stitch), names_.vertex(stitch.vertex), names_.vertex(stitch.a),
                    names_.vertex(stitch.b)));
  }

  /// Classes that have a rule, carriers before what they carry.
  std::vector<int> ordered_classes() {
    std::vector<int> order;
    std::vector<char> state(parent_.size(), 0);  // 1: on the stack, 2: done
    for (int start = 0; start < static_cast<int>(parent_.size()); ++start) {
      std::vector<int> stack = {start};
      while (!stack.empty()) {
        const int c = stack.back();
        if (rule_[at(c)] < 0 || state[at(c)] != 0) {
          if (rule_[at(c)] >= 0 && state[at(c)] == 1) order.push_back(c);
          state[at(c)] = 2;
          stack.pop_back();
          continue;
        }
        state[at(c)] = 1;
        const Stitch& stitch = stitches_[at(rule_[at(c)])];
        for (const int next : {find(stitch.a), find(stitch.b)})
          if (state[at(next)] == 0) stack.push_back(next);
      }
    }
    return order;
  }

  static void add(Row& row, const Row& other, double factor) {
    for (const auto& [c, w] : other) row.emplace_back(c, factor * w);
  }

  /// Adds up equal classes.
  static void tidy(Row& row) {
    std::stable_sort(row.begin(), row.end(),
                     [](const auto& s, const auto& t) { return s.first < t.first; });
    Row sum;
    for (const auto& [c, w] : row) {
      if (!sum.empty() && sum.back().first == c)
        sum.back().second += w;
      else
        sum.emplace_back(c, w);
    }
    row = std::move(sum);
  }

  /// When each class is closed: as its stitches say, and not before what carries it.
  std::vector<double> closing_times(const std::vector<int>& order) {
    std::vector<double> time(parent_.size(), 0);
    for (const Stitch& stitch : stitches_) {
      double& own = time[at(find(stitch.vertex))];
      own = std::max(own, stitch.close_time);
    }
    for (const int c : order) {
      const Stitch& stitch = stitches_[at(rule_[at(c)])];
      time[at(c)] = std::max({time[at(c)], time[at(find(stitch.a))], time[at(find(stitch.b))]});
    }
    return time;
  }

  SeamMap build() {
    const std::vector<int> order = ordered_classes();
    const std::vector<double> time = closing_times(order);
    std::map<int, Row> rows;  // of classes with a rule
    const auto row_of = [&](int c) { return rule_[at(c)] < 0 ? Row{{c, 1.0}} : rows.at(c); };
    for (const int c : order) {
      const Stitch& stitch = stitches_[at(rule_[at(c)])];
      Row row;
      add(row, row_of(find(stitch.a)), 1 - stitch.ratio);
      add(row, row_of(find(stitch.b)), stitch.ratio);
      tidy(row);
      rows.emplace(c, std::move(row));
    }
    SeamMap map;
    map.dropped = dropped_;
    map.row.assign(parent_.size(), -1);
    map.begin.push_back(0);
    for (int v = 0; v < static_cast<int>(parent_.size()); ++v) {
      const int c = find(v);
      if (c == v && rule_[at(c)] < 0) continue;
      map.row[at(v)] = map.num_slaves();
      map.slaves.push_back(v);
      map.close_time.push_back(time[at(c)]);
      for (const auto& [carrier, weight] : row_of(c)) {
        map.carrier.push_back(carrier);
        map.weight.push_back(weight);
      }
      map.begin.push_back(static_cast<int>(map.carrier.size()));
    }
    return map.empty() ? SeamMap{} : map;
  }

  std::span<const Stitch> stitches_;
  const SeamNames& names_;
  std::vector<int> parent_;   ///< classes of coincident vertices; a root is its lowest vertex
  std::vector<int> rule_;     ///< per root: its stitch onto an edge, -1: free
  std::vector<char> merged_;  ///< per stitch
  int dropped_ = 0;
};

}  // namespace

std::vector<Stitch> stitch_chains(const SeamChain& a, const SeamChain& b,
                                  const std::string& where) {
  check_chain(a, where);
  check_chain(b, where);
  const bool a_is_finer = a.vertices.size() > b.vertices.size();
  const SeamChain& fine = a_is_finer ? a : b;
  const SeamChain& coarse = a_is_finer ? b : a;
  std::vector<Stitch> stitches;
  std::size_t k = 0;  // edge of the coarse side
  for (std::size_t i = 0; i < fine.vertices.size(); ++i) {
    const double arc = fine.arc[i] / fine.arc.back() * coarse.arc.back();
    while (k + 2 < coarse.arc.size() && coarse.arc[k + 1] <= arc) ++k;
    const double length = coarse.arc[k + 1] - coarse.arc[k];
    const double ratio = length > 0 ? std::clamp((arc - coarse.arc[k]) / length, 0.0, 1.0) : 0.0;
    const bool is_last = i + 1 == fine.vertices.size();
    stitches.push_back({.vertex = fine.vertices[i],
                        .a = coarse.vertices[k],
                        .b = coarse.vertices[k + 1],
                        .ratio = is_last ? 1.0 : ratio});
  }
  return stitches;
}

SeamMap resolve_seams(std::span<const Stitch> stitches, int num_vertices, const SeamNames& names) {
  return Resolver(stitches, num_vertices, names).resolve();
}

}  // namespace piecework::mesh
