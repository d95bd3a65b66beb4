#include "tree_plan.hpp"

#include <algorithm>
#include <queue>
#include <utility>

namespace piecework::global {
namespace {

class Planner {
 public:
  Planner(const Symbolic& symbolic, const PlanOptions& options, const PanelLayout& layout)
      : symbolic_(symbolic), options_(options), layout_(layout) {}

  TreePlan build() {
    plan_.fronts.resize(symbolic_.fronts.size());
    if (symbolic_.num_boundary > 0)
      plan_.boundary_front = static_cast<int>(plan_.fronts.size()) - 1;
    link_children();
    cut_subtrees();
    group_tasks();
    find_levels();
    cut_panels();
    place_panels();
    place_vectors();
    find_runs();
    return std::move(plan_);
  }

 private:
  void link_children();
  void cut_subtrees();
  void group_tasks();
  void find_levels();
  void cut_panels();
  [[nodiscard]] std::vector<int> storage_order() const;
  void place_panels();
  void place_vectors();
  void find_runs();
  void add_run(FrontPlan& front, int start);

  [[nodiscard]] double numbers(const Front& front) const {
    return static_cast<double>(front.width) * (front.width + front.num_rows);
  }
  [[nodiscard]] const Front& front(int f) const {
    return symbolic_.fronts[static_cast<std::size_t>(f)];
  }
  [[nodiscard]] FrontPlan& plan(int f) { return plan_.fronts[static_cast<std::size_t>(f)]; }
  [[nodiscard]] Panel& panel(int f, int k) {
    return plan_.panels[plan(f).first_panel + static_cast<std::size_t>(k)];
  }

  const Symbolic& symbolic_;
  PlanOptions options_;
  PanelLayout layout_;
  std::vector<double> subtree_numbers_;
  std::vector<int> first_below_;  ///< per front: first front of its subtree
  TreePlan plan_;
};

void Planner::link_children() {
  plan_.children.resize(symbolic_.fronts.size());
  subtree_numbers_.resize(symbolic_.fronts.size());
  first_below_.resize(symbolic_.fronts.size());
  for (std::size_t f = 0; f < symbolic_.fronts.size(); ++f) {
    const Front& current = symbolic_.fronts[f];
    subtree_numbers_[f] = numbers(current);
    first_below_[f] = static_cast<int>(f);
    for (const int child : plan_.children[f]) {
      subtree_numbers_[f] += subtree_numbers_[static_cast<std::size_t>(child)];
      first_below_[f] = std::min(first_below_[f], first_below_[static_cast<std::size_t>(child)]);
    }
    if (current.parent >= 0)
      plan_.children[static_cast<std::size_t>(current.parent)].push_back(static_cast<int>(f));
  }
}

/// From the roots down: what is small enough becomes a subtree. The boundary never does.
void Planner::cut_subtrees() {
  std::vector<int> open;
  for (std::size_t f = 0; f < symbolic_.fronts.size(); ++f)
    if (symbolic_.fronts[f].parent < 0) open.push_back(static_cast<int>(f));
  while (!open.empty()) {
    const int f = open.back();
    open.pop_back();
    if (f != plan_.boundary_front &&
        subtree_numbers_[static_cast<std::size_t>(f)] <= options_.subtree_numbers) {
      const int first = first_below_[static_cast<std::size_t>(f)];
      const int begin = front(first).first;
      const int columns = front(f).first + front(f).width - begin;
      plan_.subtrees.push_back({first, f, begin, columns});
    } else {
      const auto& below = plan_.children[static_cast<std::size_t>(f)];
      open.insert(open.end(), below.begin(), below.end());
    }
  }
  std::sort(plan_.subtrees.begin(), plan_.subtrees.end(),
            [](const Subtree& a, const Subtree& b) { return a.first_front < b.first_front; });
  for (std::size_t s = 0; s < plan_.subtrees.size(); ++s)
    for (int f = plan_.subtrees[s].first_front; f <= plan_.subtrees[s].last_front; ++f)
      plan(f).subtree = static_cast<int>(s);
}

void Planner::group_tasks() {
  double open = options_.task_numbers;
  for (std::size_t s = 0; s < plan_.subtrees.size(); ++s) {
    if (open >= options_.task_numbers) {
      plan_.tasks.emplace_back();
      open = 0;
    }
    plan_.tasks.back().push_back(static_cast<int>(s));
    open += subtree_numbers_[static_cast<std::size_t>(plan_.subtrees[s].last_front)];
  }
}

void Planner::find_levels() {
  std::vector<int> height(symbolic_.fronts.size(), 0);
  for (std::size_t f = 0; f < symbolic_.fronts.size(); ++f) {
    if (plan_.fronts[f].subtree >= 0) continue;
    for (const int child : plan_.children[f])
      if (plan(child).subtree < 0)
        height[f] = std::max(height[f], height[static_cast<std::size_t>(child)] + 1);
    const auto level = static_cast<std::size_t>(height[f]);
    if (plan_.levels.size() <= level) plan_.levels.resize(level + 1);
    plan_.levels[level].push_back(static_cast<int>(f));
  }
}

void Planner::cut_panels() {
  for (std::size_t f = 0; f < symbolic_.fronts.size(); ++f) {
    const Front& current = symbolic_.fronts[f];
    FrontPlan& result = plan_.fronts[f];
    result.first_panel = plan_.panels.size();
    if (static_cast<int>(f) == plan_.boundary_front) continue;
    // Equal panels of whole strips rather than full ones and a rest.
    const int limit = result.subtree < 0 ? options_.top_panel_columns : options_.panel_columns;
    const int count = std::max(1, (current.width + limit - 1) / limit);
    const int strips = layout_.num_strips((current.width + count - 1) / count);
    const int columns = strips * layout_.strip_cols;
    for (int first = 0; first < current.width; first += columns) {
      const int cols = std::min(columns, current.width - first);
      plan_.panels.push_back({first, cols, current.width + current.num_rows - first - cols});
    }
    result.num_panels = static_cast<int>(plan_.panels.size() - result.first_panel);
  }
}

/// The order of the backward sweep, which comes with cold caches: the top first.
std::vector<int> Planner::storage_order() const {
  std::vector<int> order;
  for (const bool in_subtree : {false, true})
    for (std::size_t f = symbolic_.fronts.size(); f-- > 0;)
      if ((plan_.fronts[f].subtree >= 0) == in_subtree) order.push_back(static_cast<int>(f));
  return order;
}

/// First the parts that both sweeps read, then the pivot blocks, which only one reads.
void Planner::place_panels() {
  const std::vector<int> order = storage_order();
  for (const int f : order)
    for (int k = plan(f).num_panels; k-- > 0;) {
      panel(f, k).below = plan_.factor_numbers;
      plan_.factor_numbers += layout_.block_size(panel(f, k).rows, panel(f, k).cols);
    }
  plan_.own_begin = plan_.factor_numbers;
  for (const int f : order)
    for (int k = plan(f).num_panels; k-- > 0;) {
      panel(f, k).own = plan_.factor_numbers;
      plan_.factor_numbers += layout_.block_size(panel(f, k).cols, panel(f, k).cols);
    }
}

void Planner::place_vectors() {
  const auto take = [&](int rows, int& stride) {
    stride = static_cast<int>(layout_.aligned(static_cast<std::size_t>(rows + kSlack)));
    const std::size_t start = plan_.workspace;
    plan_.workspace += kMaxLanes * static_cast<std::size_t>(stride);
    return start;
  };
  const auto rows_of = [&](int f) { return front(f).width + front(f).num_rows; };
  for (Subtree& subtree : plan_.subtrees) {
    subtree.vector = take(subtree.num_columns + front(subtree.last_front).num_rows, subtree.stride);
    int most = 0;
    for (int f = subtree.first_front; f <= subtree.last_front; ++f)
      most = std::max(most, rows_of(f));
    subtree.scratch = take(most, subtree.scratch_stride);
  }
  for (std::size_t f = 0; f < plan_.fronts.size(); ++f)
    if (plan_.fronts[f].subtree < 0) {
      plan_.fronts[f].vector = take(rows_of(static_cast<int>(f)), plan_.fronts[f].stride);
      plan_.fronts[f].solution = take(rows_of(static_cast<int>(f)), plan_.fronts[f].stride);
    }
}

void Planner::add_run(FrontPlan& current, int start) {
  if (current.num_runs > 0) {
    RowRun& last = plan_.runs.back();
    if (last.start + last.length == start) {
      ++last.length;
      return;
    }
  }
  plan_.runs.push_back({start, 1});
  ++current.num_runs;
}

void Planner::find_runs() {
  std::vector<int> place(static_cast<std::size_t>(symbolic_.size()), -1);
  const auto number_rows = [&](std::span<const int> rows, int first) {
    for (const int row : rows) place[static_cast<std::size_t>(row)] = first++;
  };
  for (const Subtree& subtree : plan_.subtrees) {
    number_rows(symbolic_.front_rows(front(subtree.last_front)), subtree.num_columns);
    for (int f = subtree.first_front; f < subtree.last_front; ++f) {
      plan(f).first_run = plan_.runs.size();
      for (const int row : symbolic_.front_rows(front(f))) {
        const int column = row - subtree.first_column;
        add_run(plan(f),
                column < subtree.num_columns ? column : place[static_cast<std::size_t>(row)]);
      }
    }
  }
  // Towards the parent's vector. Its columns and rows get their places in it once per parent.
  for (std::size_t p = 0; p < symbolic_.fronts.size(); ++p) {
    if (plan_.fronts[p].subtree >= 0) continue;
    const Front& parent = symbolic_.fronts[p];
    number_rows(symbolic_.front_rows(parent), parent.width);
    for (const int child : plan_.children[p]) {
      plan(child).first_run = plan_.runs.size();
      for (const int row : symbolic_.front_rows(front(child))) {
        const int column = row - parent.first;
        add_run(plan(child), column < parent.width ? column : place[static_cast<std::size_t>(row)]);
      }
    }
  }
}

}  // namespace

TreePlan plan_tree(const Symbolic& symbolic, const PlanOptions& options,
                   const PanelLayout& layout) {
  return Planner(symbolic, options, layout).build();
}

std::vector<char> interior_roots(const Symbolic& symbolic, const TreePlan& plan, int count) {
  if (count <= 0) return {};
  std::vector<int> columns(symbolic.fronts.size());
  std::vector<char> result(symbolic.fronts.size(), 0);
  std::priority_queue<std::pair<int, int>> open;  // the largest interior is divided next
  for (std::size_t f = 0; f < symbolic.fronts.size(); ++f) {
    columns[f] = symbolic.fronts[f].width;
    for (const int child : plan.children[f]) columns[f] += columns[static_cast<std::size_t>(child)];
    if (symbolic.fronts[f].parent < 0) open.emplace(columns[f], static_cast<int>(f));
  }
  int chosen = 0;
  while (!open.empty()) {
    const auto f = static_cast<std::size_t>(open.top().second);
    const bool enough = chosen + static_cast<int>(open.size()) >= count;
    open.pop();
    if (enough || plan.fronts[f].subtree >= 0) {
      result[f] = 1;
      ++chosen;
    } else {
      for (const int child : plan.children[f])
        open.emplace(columns[static_cast<std::size_t>(child)], child);
    }
  }
  return result;
}

}  // namespace piecework::global
