#include <metis.h>

#include <algorithm>
#include <numeric>

#include <fmt/format.h>

#include <piecework/core/error.hpp>
#include <piecework/graph/graph.hpp>

namespace piecework::graph {
namespace {

static_assert(sizeof(idx_t) == sizeof(std::int32_t), "METIS must be built with 32-bit indices");

/// METIS's C interface is not const, but it only reads these.
idx_t* argument(std::span<const int> values) {
  return const_cast<idx_t*>(values.data());  // NOLINT(cppcoreguidelines-pro-type-const-cast)
}

}  // namespace

bool bisect(const Graph& graph, std::span<const std::int32_t> weight, double share, int seed,
            std::vector<std::int32_t>& side) {
  idx_t options[METIS_NOPTIONS];
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_SEED] = seed;
  idx_t count = graph.size();
  idx_t constraints = 1;
  idx_t parts = 2;
  idx_t cut = 0;
  real_t shares[2] = {static_cast<real_t>(share), static_cast<real_t>(1.0 - share)};
  side.assign(weight.size(), 0);
  const int status = METIS_PartGraphRecursive(
      &count, &constraints, argument(graph.begin), argument(graph.neighbor), argument(weight),
      nullptr, nullptr, &parts, shares, nullptr, options, &cut, side.data());
  const auto second = std::count(side.begin(), side.end(), 1);
  return status == METIS_OK && second > 0 && second < static_cast<std::ptrdiff_t>(side.size());
}

std::vector<int> nested_dissection(const Graph& graph, int seed) {
  std::vector<int> order(static_cast<std::size_t>(graph.size()));
  std::iota(order.begin(), order.end(), 0);
  if (graph.neighbor.empty()) return order;  // METIS does not take graphs without edges
  idx_t options[METIS_NOPTIONS];
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_SEED] = seed;
  idx_t count = graph.size();
  std::vector<int> position(order.size());
  const int status = METIS_NodeND(&count, argument(graph.begin), argument(graph.neighbor), nullptr,
                                  options, order.data(), position.data());
  if (status != METIS_OK) throw Error(ExitCode::SimulationFailed, "METIS ran out of memory");
  return order;
}

std::string metis_version() {
  return fmt::format("METIS {}.{}.{}", METIS_VER_MAJOR, METIS_VER_MINOR, METIS_VER_SUBMINOR);
}

}  // namespace piecework::graph
