#include <piecework/graph/graph.hpp>

#include <algorithm>
#include <numeric>

namespace piecework::graph {

Graph graph_of_pattern(std::span<const int> column_begin, std::span<const int> row_index) {
  const auto size = column_begin.size() - 1;
  Graph result;
  result.begin.assign(size + 1, 0);
  const auto for_each_edge = [&](const auto& visit) {
    for (std::size_t column = 0; column < size; ++column)
      for (int k = column_begin[column]; k < column_begin[column + 1]; ++k) {
        const auto row = static_cast<std::size_t>(row_index[static_cast<std::size_t>(k)]);
        if (row != column) visit(row, column);
      }
  };
  for_each_edge([&](std::size_t row, std::size_t column) {
    ++result.begin[row + 1];
    ++result.begin[column + 1];
  });
  std::partial_sum(result.begin.begin(), result.begin.end(), result.begin.begin());
  result.neighbor.resize(static_cast<std::size_t>(result.begin.back()));
  std::vector<int> cursor(result.begin.begin(), result.begin.end() - 1);
  for_each_edge([&](std::size_t row, std::size_t column) {
    result.neighbor[static_cast<std::size_t>(cursor[row]++)] = static_cast<int>(column);
    result.neighbor[static_cast<std::size_t>(cursor[column]++)] = static_cast<int>(row);
  });
  // Where both triangles are stored every edge came twice.
  std::size_t write = 0;
  for (std::size_t v = 0; v < size; ++v) {
    const auto first = result.neighbor.begin() + result.begin[v];
    const auto last = result.neighbor.begin() + result.begin[v + 1];
    std::sort(first, last);
    const auto end = std::unique(first, last);
    result.begin[v] = static_cast<int>(write);
    write = static_cast<std::size_t>(
        std::copy(first, end, result.neighbor.begin() + static_cast<std::ptrdiff_t>(write)) -
        result.neighbor.begin());
  }
  result.begin[size] = static_cast<int>(write);
  result.neighbor.resize(write);
  return result;
}

Graph subgraph(const Graph& graph, std::span<const int> nodes, std::vector<int>& scratch) {
  for (std::size_t i = 0; i < nodes.size(); ++i)
    scratch[static_cast<std::size_t>(nodes[i])] = static_cast<int>(i);
  Graph result;
  result.begin.reserve(nodes.size() + 1);
  for (const int node : nodes) {
    for (const int other : graph.neighbors(node))
      if (const int local = scratch[static_cast<std::size_t>(other)]; local >= 0)
        result.neighbor.push_back(local);
    result.begin.push_back(static_cast<int>(result.neighbor.size()));
  }
  for (const int node : nodes) scratch[static_cast<std::size_t>(node)] = -1;
  return result;
}

std::vector<int> linear_order(const Graph& graph) {
  const auto size = static_cast<std::size_t>(graph.size());
  std::vector<int> order;
  order.reserve(size);
  std::vector<int> seen(size, 0);
  // Appends the component of `start`, nearest first; a walk marks its nodes with its number.
  const auto walk = [&](int start, int number) {
    std::size_t head = order.size();
    order.push_back(start);
    seen[static_cast<std::size_t>(start)] = number;
    for (; head < order.size(); ++head)
      for (const int next : graph.neighbors(order[head]))
        if (seen[static_cast<std::size_t>(next)] < number) {
          seen[static_cast<std::size_t>(next)] = number;
          order.push_back(next);
        }
  };
  for (std::size_t start = 0; start < size; ++start) {
    if (seen[start]) continue;
    const std::size_t first = order.size();
    walk(static_cast<int>(start), 1);
    const int end = order.back();  // as far away as any: one end of the component
    order.resize(first);
    walk(end, 2);
  }
  return order;
}

}  // namespace piecework::graph
