#include <piecework/runner/proposal.hpp>

#include <algorithm>
#include <numeric>

#include <fmt/format.h>

namespace piecework::runner {
namespace {

/// `domains` shared out in proportion to cores: largest remainders, earlier kinds first.
std::vector<int> share_by_cores(const Topology& topology, int domains) {
  const std::int64_t cores = topology.cores();
  std::vector<int> counts;
  std::vector<std::pair<std::int64_t, std::size_t>> remainders;  // negative: largest first
  for (std::size_t k = 0; k < topology.kinds.size(); ++k) {
    const std::int64_t product = std::int64_t{domains} * topology.kinds[k].cores;
    counts.push_back(static_cast<int>(product / cores));
    remainders.emplace_back(-(product % cores), k);
  }
  std::sort(remainders.begin(), remainders.end());
  const int left = domains - std::accumulate(counts.begin(), counts.end(), 0);
  for (std::size_t i = 0; i < static_cast<std::size_t>(left); ++i) ++counts[remainders[i].second];
  return counts;
}

/// The smallest domain's share of the vertices, about.
double smallest_domain(const DomainSetting& setting, int vertices) {
  if (setting.weights.empty()) return static_cast<double>(vertices) / setting.domains;
  const double sum = std::accumulate(setting.weights.begin(), setting.weights.end(), 0.0);
  return vertices * *std::min_element(setting.weights.begin(), setting.weights.end()) / sum;
}

/// At most `domains` domains of at least kMinVerticesPerDomain vertices each, at least one domain.
DomainSetting largest_setting(const Topology& topology, std::int64_t domains, int vertices) {
  constexpr std::int64_t kMostDomains = 65536;  // of a scene
  const std::int64_t room = std::max(1, vertices / kMinVerticesPerDomain);
  DomainSetting setting;
  for (auto d = static_cast<int>(std::min({domains, room, kMostDomains})); d > 1; --d) {
    setting = {d, weights_for(topology, d)};
    if (smallest_domain(setting, vertices) >= kMinVerticesPerDomain) return setting;
  }
  return {};
}

}  // namespace

DomainSetting present_setting(const scene::Scene& scene) {
  return {scene.solver.domains, scene.solver.domain_weights};
}

std::vector<double> weights_for(const Topology& topology, int domains) {
  if (topology.uniform()) return {};
  const std::vector<int> counts = share_by_cores(topology, domains);
  std::vector<double> weights;
  for (std::size_t k = 0; k < counts.size(); ++k)
    weights.insert(weights.end(), static_cast<std::size_t>(counts[k]), topology.kinds[k].speed);
  const bool same = std::all_of(weights.begin(), weights.end(),
                                [&](double weight) { return weight == weights.front(); });
  return same ? std::vector<double>{} : weights;
}

std::vector<DomainSetting> candidate_settings(const Topology& topology, int workers, int vertices) {
  std::vector<DomainSetting> settings = {{}};
  for (const int multiple : {1, 2, 4}) {
    DomainSetting setting = largest_setting(topology, std::int64_t{multiple} * workers, vertices);
    if (setting.domains > settings.back().domains) settings.push_back(std::move(setting));
  }
  return settings;
}

Proposal propose_measured(const std::vector<CandidateRow>& rows) {
  const CandidateRow* best = nullptr;
  for (const CandidateRow& row : rows) {
    if (row.timings.empty() || !row.refusal.empty()) continue;
    const Timing& timing = row.timings.back();
    if (!timing.significant() || !(timing.ratio.median < 1)) continue;
    if (best == nullptr || timing.ratio.median < best->timings.back().ratio.median) best = &row;
  }
  if (best == nullptr)
    return {rows.front().setting, "no candidate is significantly faster than the present setting"};
  return {best->setting, fmt::format("its global solve takes {:.3f} of the present setting's time",
                                     best->timings.back().ratio.median)};
}

Proposal propose_unmeasured(const Topology& topology, int workers, int vertices) {
  DomainSetting setting = largest_setting(topology, workers, vertices);
  const std::string why =
      setting.domains == workers
          ? std::string("not measured: one domain per worker")
          : fmt::format(
                "not measured: fewer domains than the {} workers, so that none has less "
                "than {} vertices",
                workers, kMinVerticesPerDomain);
  return {std::move(setting), why};
}

scene::Scene with_setting(scene::Scene scene, const DomainSetting& setting) {
  scene.solver.domains = setting.domains;
  scene.solver.domain_weights = setting.weights;
  return scene;
}

std::string weights_text(const std::vector<double>& weights) {
  if (weights.empty()) return "equal";
  constexpr int kMostRuns = 8;
  std::string text;
  int runs = 0;
  for (auto begin = weights.begin(); begin != weights.end();) {
    const auto end = std::find_if(begin, weights.end(), [&](double w) { return w != *begin; });
    if (++runs > kMostRuns) return text + ", ...";
    text += fmt::format("{}{} x {}", text.empty() ? "" : ", ", end - begin, *begin);
    begin = end;
  }
  return text;
}

}  // namespace piecework::runner
