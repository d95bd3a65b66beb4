#include <piecework/runner/topology.hpp>

#include <hwloc.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <piecework/core/atomic_file.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>

namespace piecework::runner {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

using HwlocTopology =
    std::unique_ptr<std::remove_pointer_t<hwloc_topology_t>, void (*)(hwloc_topology_t)>;
using Bitmap = std::unique_ptr<std::remove_pointer_t<hwloc_bitmap_t>, void (*)(hwloc_bitmap_t)>;

Bitmap make_bitmap() { return {hwloc_bitmap_alloc(), hwloc_bitmap_free}; }

/// Cores, threads and processors of `set`, or nothing if it is empty.
CoreKind count_cores(hwloc_topology_t topology, hwloc_const_bitmap_t set) {
  CoreKind kind;
  kind.threads = std::max(0, hwloc_bitmap_weight(set));
  kind.cores = 0;
  for (hwloc_obj_t core = nullptr;
       (core = hwloc_get_next_obj_by_type(topology, HWLOC_OBJ_CORE, core)) != nullptr;)
    kind.cores += hwloc_bitmap_intersects(core->cpuset, set) != 0;
  if (kind.cores == 0) kind.cores = kind.threads;  // a machine that does not say what its cores are
  for (int p = hwloc_bitmap_first(set); p >= 0 && kind.threads > 0; p = hwloc_bitmap_next(set, p))
    kind.processors.push_back(p);
  return kind;
}

std::vector<CoreKind> kinds_of(hwloc_topology_t topology) {
  const Bitmap usable = make_bitmap();
  if (hwloc_get_cpubind(topology, usable.get(), HWLOC_CPUBIND_PROCESS) != 0)
    hwloc_bitmap_copy(usable.get(), hwloc_topology_get_allowed_cpuset(topology));
  const int count = hwloc_cpukinds_get_nr(topology, 0);
  std::vector<CoreKind> kinds;
  for (int k = count - 1; k >= 0; --k) {  // hwloc ranks the most efficient, slowest kind first
    const Bitmap set = make_bitmap();
    int efficiency = -1;
    if (hwloc_cpukinds_get_info(topology, static_cast<unsigned>(k), set.get(), &efficiency, nullptr,
                                nullptr, 0) != 0)
      continue;
    hwloc_bitmap_and(set.get(), set.get(), usable.get());
    CoreKind kind = count_cores(topology, set.get());
    if (kind.threads == 0) continue;
    kind.efficiency = efficiency;
    kind.name = fmt::format("kind {}", k);
    kinds.push_back(std::move(kind));
  }
  if (kinds.size() > 1) return kinds;
  CoreKind all = count_cores(topology, usable.get());
  all.name = "all alike";
  return {std::move(all)};
}

/// One value of a topology file and where it stands.
class Item {
 public:
  Item(const Json& json, std::string file, std::string pointer)
      : json_(json), file_(std::move(file)), pointer_(std::move(pointer)) {}

  [[noreturn]] void fail(const std::string& problem, const std::string& remedy) const {
    throw InputError(
        fmt::format("{}: {}: {}; {}", file_, pointer_.empty() ? "/" : pointer_, problem, remedy));
  }
  [[nodiscard]] const Json& json() const { return json_; }
  [[nodiscard]] std::string text() const {
    return json_.dump(-1, ' ', false, Json::error_handler_t::replace).substr(0, 60);
  }

  /// \param known  all keys that the object may have
  void require_object(const std::set<std::string>& known, const std::string& remedy) const {
    if (!json_.is_object()) fail(fmt::format("{} is no object", text()), remedy);
    for (const auto& [key, value] : json_.items())
      if (!known.contains(key)) fail(fmt::format("unknown key \"{}\"", key), remedy);
  }

  [[nodiscard]] Item at(const char* key, const std::string& remedy) const {
    if (!json_.contains(key)) fail(fmt::format("\"{}\" is missing", key), remedy);
    return {json_.at(key), file_, fmt::format("{}/{}", pointer_, key)};
  }
  [[nodiscard]] Item at(std::size_t index) const {
    return {json_.at(index), file_, fmt::format("{}/{}", pointer_, index)};
  }

  [[nodiscard]] int count() const {
    constexpr std::int64_t kMost = 4096;
    const bool good = json_.is_number_integer() && json_.get<double>() >= 1 &&
                      json_.get<double>() <= static_cast<double>(kMost);
    if (!good) fail(fmt::format("{} is no count", text()), "write a whole number from 1 to 4096");
    return json_.get<int>();
  }

 private:
  const Json& json_;
  std::string file_;
  std::string pointer_;
};

CoreKind read_kind(const Item& item) {
  const std::string shape = R"(write {"name": "performance", "cores": 8, "speed": 1})";
  item.require_object({"name", "cores", "threads", "speed"}, shape);
  CoreKind kind;
  const Item name = item.at("name", shape);
  if (!name.json().is_string() || name.json().get<std::string>().empty())
    name.fail(fmt::format("{} is no name", name.text()), "write a text");
  kind.name = name.json().get<std::string>();
  kind.cores = item.at("cores", shape).count();
  kind.threads = item.json().contains("threads") ? item.at("threads", shape).count() : kind.cores;
  const Item speed = item.at("speed", shape);
  const bool good = speed.json().is_number() && speed.json().get<double>() >= 1e-3 &&
                    speed.json().get<double>() <= 1e3;
  if (!good) speed.fail(fmt::format("{} is no speed", speed.text()), "write one of 0.001 to 1000");
  kind.speed = speed.json().get<double>();
  return kind;
}

}  // namespace

int Topology::cores() const {
  int sum = 0;
  for (const CoreKind& kind : kinds) sum += kind.cores;
  return sum;
}

bool Topology::uniform() const {
  return std::all_of(kinds.begin(), kinds.end(),
                     [&](const CoreKind& kind) { return kind.speed == kinds.front().speed; });
}

Topology machine_topology() {
  Topology result;
  result.source = "this machine";
  hwloc_topology_t raw = nullptr;
  if (hwloc_topology_init(&raw) == 0) {
    const HwlocTopology topology(raw, hwloc_topology_destroy);
    if (hwloc_topology_load(raw) == 0) result.kinds = kinds_of(raw);
  }
  if (result.kinds.empty() || result.cores() == 0)
    result.kinds = {{.name = "all alike",
                     .cores = available_threads(),
                     .threads = available_threads(),
                     .processors = {}}};
  return result;
}

Topology load_topology(const fs::path& file) {
  constexpr std::size_t kMaxBytes = std::size_t{1} << 20;
  constexpr std::size_t kMaxKinds = 16;
  const std::string shape = R"(write {"kinds": [{"name": "performance", "cores": 8, "speed": 1}]})";
  const std::string text = read_file(file, kMaxBytes);
  Json json;
  try {
    json = Json::parse(text);
  } catch (const Json::exception& error) {
    throw InputError(fmt::format("{}: /: no JSON ({}); {}", file.string(), error.what(), shape));
  }
  const Item root(json, file.string(), "");
  root.require_object({"kinds"}, shape);
  const Item kinds = root.at("kinds", shape);
  if (!kinds.json().is_array() || kinds.json().empty() || kinds.json().size() > kMaxKinds)
    kinds.fail(fmt::format("{} is no list of 1 to {} kinds", kinds.text(), kMaxKinds), shape);
  Topology topology;
  topology.source = file.string();
  std::set<std::string> names;
  for (std::size_t k = 0; k < kinds.json().size(); ++k) {
    topology.kinds.push_back(read_kind(kinds.at(k)));
    const std::string& name = topology.kinds.back().name;
    if (!names.insert(name).second)
      kinds.at(k).fail(fmt::format("a second kind named \"{}\"", name), "give it its own name");
  }
  std::stable_sort(topology.kinds.begin(), topology.kinds.end(),
                   [](const CoreKind& a, const CoreKind& b) { return a.speed > b.speed; });
  return topology;
}

}  // namespace piecework::runner
