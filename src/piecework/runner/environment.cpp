#include <piecework/runner/environment.hpp>

#include <hwloc.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <cstdlib>
#include <ctime>
#include <fstream>
#include <memory>

#include <fmt/format.h>
#include <tbb/version.h>
#include <nlohmann/json.hpp>

#include <piecework/core/parallel.hpp>
#include <piecework/decomposition/decomposition.hpp>
#include <piecework/global/cholmod_solver.hpp>
#include <piecework_build_info.hpp>

namespace piecework::runner {
namespace {

/// Value after the first ": " of the first line of a /proc file that begins with `key`.
std::string proc_value(const char* path, const std::string& key) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with(key)) continue;
    const auto colon = line.find(':');
    const auto begin =
        colon == std::string::npos ? colon : line.find_first_not_of(" \t", colon + 1);
    return begin == std::string::npos ? "unknown" : line.substr(begin);
  }
  return "unknown";
}

bool has_cpu_flag(const std::string& flags, const std::string& flag) {
  return (" " + flags + " ").find(" " + flag + " ") != std::string::npos;
}

std::string instruction_sets(const std::string& flags) {
  std::string sets;
  for (const char* set : {"avx2", "fma", "avx512f"})
    if (has_cpu_flag(flags, set)) sets += (sets.empty() ? "" : " ") + std::string(set);
  return sets.empty() ? "baseline" : sets;
}

/// "16 cores (8 of efficiency 0, 8 of efficiency 1)" on hybrid machines.
std::string cores() {
  hwloc_topology_t raw = nullptr;
  if (hwloc_topology_init(&raw) != 0) return "unknown";
  const std::unique_ptr<std::remove_pointer_t<hwloc_topology_t>, void (*)(hwloc_topology_t)>
      topology(raw, hwloc_topology_destroy);
  if (hwloc_topology_load(topology.get()) != 0) return "unknown";
  const int count = hwloc_get_nbobjs_by_type(topology.get(), HWLOC_OBJ_CORE);
  std::string text = fmt::format("{} cores, {} usable threads", count, available_threads());
  const int kinds = hwloc_cpukinds_get_nr(topology.get(), 0);
  for (int kind = 0; kinds > 1 && kind < kinds; ++kind) {
    hwloc_bitmap_t set = hwloc_bitmap_alloc();
    int efficiency = -1;
    hwloc_cpukinds_get_info(topology.get(), static_cast<unsigned>(kind), set, &efficiency, nullptr,
                            nullptr, 0);
    text += fmt::format("{} {} processors of efficiency {}", kind == 0 ? ";" : ",",
                        hwloc_bitmap_weight(set), efficiency);
    hwloc_bitmap_free(set);
  }
  return text;
}

std::string memory() {
  const double kib = std::strtod(proc_value("/proc/meminfo", "MemTotal").c_str(), nullptr);
  return fmt::format("{:.1f} GiB", kib / (1024.0 * 1024.0));
}

std::string kernel() {
  utsname name{};
  return uname(&name) == 0 ? fmt::format("{} {}", name.sysname, name.release) : "unknown";
}

}  // namespace

Environment describe_environment() {
  const std::string flags = proc_value("/proc/cpuinfo", "flags");
  return {
      {"cpu", proc_value("/proc/cpuinfo", "model name")},
      {"cores", cores()},
      {"instruction_sets", instruction_sets(flags)},
      {"virtual", has_cpu_flag(flags, "hypervisor") ? "yes" : "no"},
      {"memory", memory()},
      {"kernel", kernel()},
      {"compiler", build_info::kCompiler},
      {"compiler_flags", build_info::kFlags},
      {"build_type", build_info::kBuildType},
      {"revision",
       fmt::format("{}{}", build_info::kRevision, build_info::kDirty ? " (modified)" : "")},
      {"eigen", fmt::format("Eigen {}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION,
                            EIGEN_MINOR_VERSION)},
      {"cholmod", global::CholmodSolver::description()},
      {"partitioner",
       fmt::format("{}, seed {}", decomposition::library_version(), decomposition::kDefaultSeed)},
      {"tasks", fmt::format("oneTBB {}", TBB_runtime_version())},
  };
}

std::string to_json(const Environment& environment) {
  nlohmann::ordered_json json;
  for (const auto& [key, value] : environment) json[key] = value;
  return json.dump();
}

CpuTime cpu_time() {
  // cpu user nice system idle iowait irq softirq steal ..., in clock ticks
  std::ifstream file("/proc/stat");
  std::string label;
  file >> label;
  double busy = 0;
  for (int column = 0; column < 8; ++column) {
    double ticks = 0;
    file >> ticks;
    if (column != 3 && column != 4) busy += ticks;
  }
  std::timespec own{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &own);
  return {busy / static_cast<double>(::sysconf(_SC_CLK_TCK)),
          static_cast<double>(own.tv_sec) + 1e-9 * static_cast<double>(own.tv_nsec)};
}

double load_average() {
  double load = 0;
  return getloadavg(&load, 1) == 1 ? load : 0;
}

}  // namespace piecework::runner
