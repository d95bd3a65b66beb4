// What cutting domains costs and how good they are: recursive METIS bisection of the jittered
// Delaunay-like sheet, from 20K to 1M vertices and 4 to 128 domains. Validation: every domain has
// triangles, and balance stays below 1.1.

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <piecework/decomposition/decomposition.hpp>
#include <piecework/mesh/generate.hpp>
#include <piecework/mesh/topology.hpp>

#include "bench.hpp"

namespace piecework::bench {
namespace {

void partition(benchmark::State& state) {
  const int side = side_of(state.range(0));
  const int domains = static_cast<int>(state.range(1));
  const mesh::MeshDocument sheet =
      mesh::generate(mesh::GeneratorKind::Sheet,
                     {.columns = side, .rows = side, .pattern = mesh::SheetPattern::Delaunay});
  const auto hinges =
      mesh::find_hinges(sheet.mesh.triangles, mesh::find_edges(sheet.mesh.triangles));
  const decomposition::Elements elements{sheet.mesh.triangles, hinges, {}, side * side};
  decomposition::Decomposition result;
  for (auto _ : state) result = decomposition::decompose(elements, {.domains = domains});

  const decomposition::Summary s = decomposition::summarize(result, elements);
  if (s.domains != domains || s.balance > 1.1) {
    fail(state, fmt::format("{} domains of {}, balance {}", s.domains, domains, s.balance));
    return;
  }
  state.counters["corner"] = s.corner;
  state.counters["boundary"] = s.boundary;
  state.counters["edge_cut"] = static_cast<double>(s.edge_cut);
  state.counters["balance"] = s.balance;
  state.counters["triangles_per_s"] =
      benchmark::Counter(static_cast<double>(sheet.mesh.num_triangles()),
                         benchmark::Counter::kIsIterationInvariantRate);
}

const Registration registration([] {
  auto* rows = benchmark::RegisterBenchmark("partition", partition);
  rows->Unit(benchmark::kMillisecond)->UseRealTime()->ArgNames({"n", "D"});
  for (const std::int64_t n : {19881, 60025, 199809, 1000000})
    for (const std::int64_t domains : {4, 32, 128})
      if (!quick() || n == 19881) rows->Args({n, domains});
});

}  // namespace
}  // namespace piecework::bench
