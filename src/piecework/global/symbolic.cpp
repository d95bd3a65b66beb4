#include <piecework/global/symbolic.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>

#include <piecework/core/error.hpp>

namespace piecework::global {
namespace {

using graph::Graph;

std::vector<int> inverse(std::span<const int> order) {
  std::vector<int> position(order.size());
  for (std::size_t p = 0; p < order.size(); ++p)
    position[static_cast<std::size_t>(order[p])] = static_cast<int>(p);
  return position;
}

/// The column elimination tree of a matrix in a given order [Liu 1990], and what it tells.
class ColumnTree {
 public:
  ColumnTree(const Graph& graph, std::vector<int> order, int num_boundary)
      : graph_(graph), order_(std::move(order)), eliminated_(size() - num_boundary) {
    link();
    postorder();
    count();
  }

  [[nodiscard]] int size() const { return static_cast<int>(order_.size()); }
  [[nodiscard]] int eliminated() const { return eliminated_; }
  [[nodiscard]] const std::vector<int>& order() const { return order_; }
  /// Parent of a column in postorder, -1 for a root.
  [[nodiscard]] int parent(int column) const { return parent_[static_cast<std::size_t>(column)]; }
  /// Entries of a column of L on and below the diagonal.
  [[nodiscard]] int column_count(int column) const {
    return count_[static_cast<std::size_t>(column)];
  }

 private:
  void link();
  void postorder();
  void count();
  [[nodiscard]] int& ancestor_of_leaf(int row, int column, int& kind);

  const Graph& graph_;
  std::vector<int> order_;
  int eliminated_;
  std::vector<int> parent_, count_;
  // Of count(), after Gilbert, Ng and Peyton 1994.
  std::vector<int> first_, max_first_, previous_leaf_, ancestor_;
};

void ColumnTree::link() {
  const std::vector<int> position = inverse(order_);
  parent_.assign(order_.size(), -1);
  std::vector<int> ancestor(order_.size(), -1);
  for (int column = 0; column < size(); ++column)
    for (const int neighbor : graph_.neighbors(order_[static_cast<std::size_t>(column)])) {
      int node = position[static_cast<std::size_t>(neighbor)];
      while (node >= 0 && node < column) {  // climb, and shorten the path for the next climber
        const int next = ancestor[static_cast<std::size_t>(node)];
        ancestor[static_cast<std::size_t>(node)] = column;
        if (next < 0) parent_[static_cast<std::size_t>(node)] = column;
        node = next;
      }
    }
  // The boundary is one dense block: a chain, and everything else hangs below its first column.
  for (int column = 0; column < size(); ++column) {
    int& parent = parent_[static_cast<std::size_t>(column)];
    if (column >= eliminated_)
      parent = column + 1 < size() ? column + 1 : -1;
    else if (parent >= eliminated_)
      parent = eliminated_;
  }
}

/// Renumbers the columns so that every subtree is a range.
void ColumnTree::postorder() {
  const std::size_t n = order_.size();
  std::vector<int> head(n, -1);
  std::vector<int> next(n, -1);
  std::vector<int> stack;
  for (std::size_t c = n; c-- > 0;) {
    if (parent_[c] < 0) continue;
    next[c] = head[static_cast<std::size_t>(parent_[c])];
    head[static_cast<std::size_t>(parent_[c])] = static_cast<int>(c);
  }
  std::vector<int> post;
  post.reserve(n);
  for (std::size_t root = 0; root < n; ++root) {
    if (parent_[root] >= 0) continue;
    stack.push_back(static_cast<int>(root));
    while (!stack.empty()) {
      const auto node = static_cast<std::size_t>(stack.back());
      if (const int child = head[node]; child >= 0) {
        head[node] = next[static_cast<std::size_t>(child)];
        stack.push_back(child);
      } else {
        post.push_back(static_cast<int>(node));
        stack.pop_back();
      }
    }
  }
  const std::vector<int> renumber = inverse(post);
  std::vector<int> order(n);
  std::vector<int> parent(n);
  for (std::size_t p = 0; p < n; ++p) {
    const auto old = static_cast<std::size_t>(post[p]);
    order[p] = order_[old];
    parent[p] = parent_[old] < 0 ? -1 : renumber[static_cast<std::size_t>(parent_[old])];
  }
  order_ = std::move(order);
  parent_ = std::move(parent);
}

/// Column counts of L: the row subtree of every row, leaf by leaf, without forming L.
void ColumnTree::count() {
  const std::size_t n = order_.size();
  const std::vector<int> position = inverse(order_);
  std::vector<int> delta(n, 0);
  first_.assign(n, -1);
  for (std::size_t k = 0; k < n; ++k) {
    delta[k] = first_[k] < 0 ? 1 : 0;
    for (int j = static_cast<int>(k); j >= 0 && first_[static_cast<std::size_t>(j)] < 0;
         j = parent_[static_cast<std::size_t>(j)])
      first_[static_cast<std::size_t>(j)] = static_cast<int>(k);
  }
  max_first_.assign(n, -1);
  previous_leaf_.assign(n, -1);
  ancestor_.resize(n);
  std::iota(ancestor_.begin(), ancestor_.end(), 0);
  for (int column = 0; column < size(); ++column) {
    const auto c = static_cast<std::size_t>(column);
    if (parent_[c] >= 0) --delta[static_cast<std::size_t>(parent_[c])];
    for (const int neighbor : graph_.neighbors(order_[c])) {
      const int row = position[static_cast<std::size_t>(neighbor)];
      int kind = 0;
      const int common = ancestor_of_leaf(row, column, kind);
      if (kind >= 1) ++delta[c];
      if (kind == 2) --delta[static_cast<std::size_t>(common)];
    }
    if (parent_[c] >= 0) ancestor_[c] = parent_[c];
  }
  count_ = std::move(delta);
  for (std::size_t c = 0; c < n; ++c)
    if (parent_[c] >= 0) count_[static_cast<std::size_t>(parent_[c])] += count_[c];
  for (int column = eliminated_; column < size(); ++column)
    count_[static_cast<std::size_t>(column)] = size() - column;
}

/// Whether `column` is a leaf of the subtree of `row`: kind 0 no, 1 the first, 2 a later one; then
/// returns its lowest common ancestor with the leaf before.
int& ColumnTree::ancestor_of_leaf(int row, int column, int& kind) {
  const auto r = static_cast<std::size_t>(row);
  const auto c = static_cast<std::size_t>(column);
  if (row <= column || first_[c] <= max_first_[r]) return ancestor_[c];
  max_first_[r] = first_[c];
  const int previous = previous_leaf_[r];
  previous_leaf_[r] = column;
  if (previous < 0) {
    kind = 1;
    return previous_leaf_[r];
  }
  kind = 2;
  int root = previous;
  while (root != ancestor_[static_cast<std::size_t>(root)])
    root = ancestor_[static_cast<std::size_t>(root)];
  for (int node = previous; node != root;) {
    int& up = ancestor_[static_cast<std::size_t>(node)];
    node = up;
    up = root;
  }
  return ancestor_[static_cast<std::size_t>(root)];
}

/// Groups columns into fronts: first whole small subtrees, then runs of equal structure, then
/// whatever pays to be merged.
class FrontTree {
 public:
  FrontTree(const ColumnTree& columns, const MergeCosts& costs) : columns_(columns), costs_(costs) {
    group();
    merge();
  }

  struct Group {
    std::vector<int> columns;
    std::vector<int> children;
    int parent = -1;
    double rows = 0;
    [[nodiscard]] double width() const { return static_cast<double>(columns.size()); }
  };

  /// Groups in postorder, each with its columns.
  [[nodiscard]] std::vector<const Group*> ordered() const;

 private:
  [[nodiscard]] std::vector<int> leaf_subtrees() const;
  void group();
  void merge();
  void absorb(Group& parent, int child);
  [[nodiscard]] double cost(double width, double rows) const {
    const auto padded = [](double count) { return 4.0 * std::ceil(count / 4.0); };
    return costs_.per_front + costs_.per_row * (width + rows) +
           width * (padded(width) + 2.0 * padded(rows));
  }

  const ColumnTree& columns_;
  MergeCosts costs_;
  std::vector<Group> groups_;
  std::vector<char> dropped_;
};

/// Per column: the last column of the largest subtree around it that is small enough for one
/// front, or -1.
std::vector<int> FrontTree::leaf_subtrees() const {
  const int n = columns_.eliminated();
  std::vector<int> size(static_cast<std::size_t>(n), 1);
  for (int c = 0; c < n; ++c)
    if (const int p = columns_.parent(c); p >= 0 && p < n)
      size[static_cast<std::size_t>(p)] += size[static_cast<std::size_t>(c)];
  std::vector<int> leaf(static_cast<std::size_t>(columns_.size()), -1);
  for (int c = n - 1; c >= 0; --c) {
    if (size[static_cast<std::size_t>(c)] > costs_.leaf_columns) continue;
    const int p = columns_.parent(c);
    const int above = p < 0 ? -1 : leaf[static_cast<std::size_t>(p)];
    leaf[static_cast<std::size_t>(c)] = above >= 0 ? above : c;
  }
  return leaf;
}

void FrontTree::group() {
  const int n = columns_.eliminated();
  const std::vector<int> leaf = leaf_subtrees();
  std::vector<int> group_of(leaf.size(), -1);
  const auto joins = [&](int c) {  // column c goes where column c - 1 went
    if (c == 0 || c >= n) return c > n;
    const int here = leaf[static_cast<std::size_t>(c)];
    const int before = leaf[static_cast<std::size_t>(c) - 1];
    if (here >= 0 || before >= 0) return here == before;
    return columns_.parent(c - 1) == c &&
           columns_.column_count(c - 1) == columns_.column_count(c) + 1;
  };
  for (int c = 0; c < columns_.size(); ++c) {
    if (!joins(c)) groups_.emplace_back();
    groups_.back().columns.push_back(c);
    groups_.back().rows = columns_.column_count(c) - 1;  // those of its last column
    group_of[static_cast<std::size_t>(c)] = static_cast<int>(groups_.size()) - 1;
  }
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const int up = columns_.parent(groups_[g].columns.back());
    if (up < 0) continue;
    groups_[g].parent = group_of[static_cast<std::size_t>(up)];
    groups_[static_cast<std::size_t>(groups_[g].parent)].children.push_back(static_cast<int>(g));
  }
  dropped_.assign(groups_.size(), 0);
}

void FrontTree::absorb(Group& parent, int child) {
  Group& merged = groups_[static_cast<std::size_t>(child)];
  parent.columns.insert(parent.columns.end(), merged.columns.begin(), merged.columns.end());
  std::erase(parent.children, child);
  parent.children.insert(parent.children.end(), merged.children.begin(), merged.children.end());
  dropped_[static_cast<std::size_t>(child)] = 1;
  merged = {};
}

/// Bottom up; each front takes in its best child as long as that pays.
void FrontTree::merge() {
  const bool has_boundary = columns_.eliminated() < columns_.size();
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    if (has_boundary && g + 1 == groups_.size()) break;
    Group& group = groups_[g];
    for (;;) {
      int best = -1;
      double best_gain = 0;
      for (const int child : group.children) {
        const Group& other = groups_[static_cast<std::size_t>(child)];
        const double gain = cost(group.width(), group.rows) + cost(other.width(), other.rows) -
                            cost(group.width() + other.width(), group.rows);
        if (gain > best_gain) {
          best_gain = gain;
          best = child;
        }
      }
      if (best < 0) break;
      absorb(group, best);
    }
    std::sort(group.columns.begin(), group.columns.end());
    std::sort(group.children.begin(), group.children.end());
    for (const int child : group.children)
      groups_[static_cast<std::size_t>(child)].parent = static_cast<int>(g);
  }
}

std::vector<const FrontTree::Group*> FrontTree::ordered() const {
  std::vector<const Group*> result;
  std::vector<std::pair<int, std::size_t>> stack;  // group, next child
  for (std::size_t root = 0; root < groups_.size(); ++root) {
    if (dropped_[root] || groups_[root].parent >= 0) continue;
    stack.emplace_back(static_cast<int>(root), 0);
    while (!stack.empty()) {
      auto& [node, next] = stack.back();
      const Group& group = groups_[static_cast<std::size_t>(node)];
      if (next < group.children.size()) {
        stack.emplace_back(group.children[next++], 0);
      } else {
        result.push_back(&group);
        stack.pop_back();
      }
    }
  }
  return result;
}

/// Places the columns front by front. Within a front any order will do: rows that are neighbours on
/// the separator come close to each other, so that fronts below see long runs of rows.
void place_columns(const Graph& graph, const ColumnTree& columns, const FrontTree& tree,
                   Symbolic& result) {
  std::vector<int> scratch(static_cast<std::size_t>(graph.size()), -1);
  std::vector<int> nodes;
  for (const FrontTree::Group* group : tree.ordered()) {
    nodes.clear();
    for (const int column : group->columns)
      nodes.push_back(columns.order()[static_cast<std::size_t>(column)]);
    Front front;
    front.first = static_cast<int>(result.order.size());
    front.width = static_cast<int>(nodes.size());
    const bool keep_order = front.first >= columns.eliminated();
    if (keep_order) {
      result.order.insert(result.order.end(), nodes.begin(), nodes.end());
    } else {
      for (const int local : graph::linear_order(graph::subgraph(graph, nodes, scratch)))
        result.order.push_back(nodes[static_cast<std::size_t>(local)]);
    }
    result.fronts.push_back(front);
  }
  result.position = inverse(result.order);
}

/// Rows of each front: those of its columns in the matrix and those of its children.
void find_rows(const Graph& graph, Symbolic& result) {
  std::vector<int> front_of(result.order.size());
  std::vector<int> mark(result.order.size(), -1);
  std::vector<std::vector<int>> children(result.fronts.size());
  for (std::size_t f = 0; f < result.fronts.size(); ++f) {
    const Front& front = result.fronts[f];
    for (int c = front.first; c < front.first + front.width; ++c)
      front_of[static_cast<std::size_t>(c)] = static_cast<int>(f);
  }
  for (std::size_t f = 0; f < result.fronts.size(); ++f) {
    Front& front = result.fronts[f];
    const int end = front.first + front.width;
    front.row_begin = result.rows.size();
    const auto add = [&](int row) {
      if (row < end || mark[static_cast<std::size_t>(row)] == static_cast<int>(f)) return;
      mark[static_cast<std::size_t>(row)] = static_cast<int>(f);
      result.rows.push_back(row);
    };
    for (int c = front.first; c < end; ++c)
      for (const int neighbor : graph.neighbors(result.order[static_cast<std::size_t>(c)]))
        add(result.position[static_cast<std::size_t>(neighbor)]);
    for (const int child : children[f]) {
      const Front& below = result.fronts[static_cast<std::size_t>(child)];
      for (std::size_t k = 0; k < static_cast<std::size_t>(below.num_rows); ++k)
        add(result.rows[below.row_begin + k]);
    }
    std::sort(result.rows.begin() + static_cast<std::ptrdiff_t>(front.row_begin),
              result.rows.end());
    front.num_rows = static_cast<int>(result.rows.size() - front.row_begin);
    if (front.num_rows == 0) continue;
    front.parent = front_of[static_cast<std::size_t>(result.rows[front.row_begin])];
    children[static_cast<std::size_t>(front.parent)].push_back(static_cast<int>(f));
  }
}

}  // namespace

Symbolic analyze(const Graph& graph, std::span<const int> order, std::span<const int> boundary,
                 const MergeCosts& costs) {
  PIECEWORK_ASSERT(static_cast<int>(order.size()) == graph.size());
  std::vector<char> kept(order.size(), 0);
  for (const int row : boundary) kept[static_cast<std::size_t>(row)] = 1;
  std::vector<int> columns;
  columns.reserve(order.size());
  for (const int row : order)
    if (!kept[static_cast<std::size_t>(row)]) columns.push_back(row);
  columns.insert(columns.end(), boundary.begin(), boundary.end());

  const ColumnTree tree(graph, std::move(columns), static_cast<int>(boundary.size()));
  Symbolic result;
  result.num_boundary = static_cast<int>(boundary.size());
  for (int c = 0; c < tree.eliminated(); ++c) {
    const double count = tree.column_count(c);
    result.nonzeros += count;
    result.flops += count * count;
  }
  result.order.reserve(order.size());
  place_columns(graph, tree, FrontTree(tree, costs), result);
  find_rows(graph, result);
  return result;
}

std::vector<int> dissection_order(const Graph& graph, const DomainTree* domains, int seed) {
  if (!domains || domains->node_parent.size() <= 1) return graph::nested_dissection(graph, seed);
  std::vector<std::vector<int>> nodes(domains->node_parent.size());
  for (std::size_t row = 0; row < domains->row_node.size(); ++row)
    nodes[static_cast<std::size_t>(domains->row_node[row])].push_back(static_cast<int>(row));
  std::vector<char> is_leaf(nodes.size(), 1);
  for (const int parent : domains->node_parent)
    if (parent >= 0) is_leaf[static_cast<std::size_t>(parent)] = 0;

  std::vector<int> order;
  order.reserve(domains->row_node.size());
  std::vector<int> scratch(domains->row_node.size(), -1);
  for (std::size_t node = nodes.size(); node-- > 0;) {  // children come after their parents
    const std::vector<int>& rows = nodes[node];
    if (!is_leaf[node]) {
      order.insert(order.end(), rows.begin(), rows.end());
      continue;
    }
    for (const int local : graph::nested_dissection(graph::subgraph(graph, rows, scratch), seed))
      order.push_back(rows[static_cast<std::size_t>(local)]);
  }
  return order;
}

}  // namespace piecework::global
