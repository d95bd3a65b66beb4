// main() of every benchmark driver. Over Google Benchmark's own it adds: an error when the filter
// matches nothing or a result is invalid, the context that results must name, and --quick.
//
// Exit codes: 0 ok; 2 wrong usage or nothing matched; 5 a benchmark reported an invalid result.

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include <benchmark/benchmark.h>
#include <fmt/format.h>
#include <tbb/version.h>

#include <piecework/core/parallel.hpp>
#include <piecework/core/types.hpp>
#include <piecework_build_info.hpp>

#include "bench.hpp"

namespace piecework::bench {
namespace {

constexpr std::string_view kSkipPrefix = "skipped: ";
constexpr int kUsage = 2;
constexpr int kCheckFailed = 5;

bool quick_mode = false;

std::vector<void (*)()>& registrations() {
  static std::vector<void (*)()> functions;
  return functions;
}

struct NamedCommand {
  const char* flag;
  const char* help;
  int (*function)();
};

std::vector<NamedCommand>& commands() {
  static std::vector<NamedCommand> all;
  return all;
}

std::vector<Option*>& options() {
  static std::vector<Option*> all;
  return all;
}

/// Passes everything on to the reporter that --benchmark_format names, and counts failures.
class FailureCounter : public benchmark::BenchmarkReporter {
 public:
  explicit FailureCounter(benchmark::BenchmarkReporter& display) : display_(display) {}
  bool ReportContext(const Context& context) override { return display_.ReportContext(context); }
  void ReportRuns(const std::vector<Run>& runs) override {
    failures_ += std::count_if(runs.begin(), runs.end(), [](const Run& run) {
      return run.error_occurred && !run.error_message.starts_with(kSkipPrefix);
    });
    display_.ReportRuns(runs);
  }
  void Finalize() override { display_.Finalize(); }
  [[nodiscard]] std::ptrdiff_t failures() const { return failures_; }

 private:
  benchmark::BenchmarkReporter& display_;
  std::ptrdiff_t failures_ = 0;
};

std::string cpu_model() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("model name"))
      return line.substr(std::min(line.find(": ") + 2, line.size()));
  }
  return "unknown";
}

std::string first_line(const char* path) {
  std::ifstream file(path);
  std::string line;
  return std::getline(file, line) ? line : "unknown";
}

void add_context() {
  using benchmark::AddCustomContext;
  AddCustomContext("build_type", build_info::kBuildType);
  AddCustomContext("revision", build_info::kRevision);
  AddCustomContext("dirty", build_info::kDirty ? "true" : "false");
  AddCustomContext("compiler", build_info::kCompiler);
  AddCustomContext("compiler_flags", build_info::kFlags);
  AddCustomContext("cpu_model", cpu_model());
  AddCustomContext("kernel", first_line("/proc/sys/kernel/osrelease"));
  AddCustomContext("available_threads", std::to_string(available_threads()));
  AddCustomContext("load_before", first_line("/proc/loadavg"));
  AddCustomContext("eigen", fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION,
                                        EIGEN_MINOR_VERSION));
  AddCustomContext("tbb", fmt::format("{}.{}", TBB_VERSION_MAJOR, TBB_VERSION_MINOR));
  AddCustomContext("quick", quick_mode ? "true" : "false");
}

void warn_unless_release() {
  if (std::string_view(build_info::kBuildType) == "Release") return;
  fmt::print(stderr,
             "*****************************************************************\n"
             "*** This is a {} build: its times mean nothing.\n"
             "*** Use the preset release: bash ci/build.sh release\n"
             "*****************************************************************\n",
             build_info::kBuildType);
}

/// Takes --quick and the driver's options out of the arguments and puts a short minimum time before
/// what the user gave.
std::vector<char*> read_own_flags(int argc, char** argv) {
  static char short_time[] = "--benchmark_min_time=0.01";
  std::vector<char*> arguments(argv, argv + argc);
  quick_mode =
      std::erase_if(arguments, [](const char* a) { return !std::strcmp(a, "--quick"); }) > 0;
  std::erase_if(arguments, [](const char* a) {
    return std::any_of(options().begin(), options().end(),
                       [a](Option* option) { return option->read(a); });
  });
  if (quick_mode) arguments.insert(arguments.begin() + 1, short_time);
  return arguments;
}

void print_help() {
  fmt::print(
      "Flags of Piecework's benchmarks:\n"
      "          [--quick]  small sizes, to see that the driver works; times mean nothing\n");
  for (const NamedCommand& command : commands())
    fmt::print("          [{}]  {}\n", command.flag, command.help);
  for (const Option* option : options())
    fmt::print("          [{}=VALUE]  {}\n", option->flag(), option->help());
  fmt::print("Flags of Google Benchmark:\n");
  benchmark::PrintDefaultHelp();
}

int run(int argc, char** argv) {
  std::vector<char*> arguments = read_own_flags(argc, argv);
  for (const NamedCommand& command : commands())
    if (arguments.size() > 1 && !std::strcmp(arguments.back(), command.flag))
      return command.function();
  int count = static_cast<int>(arguments.size());
  arguments.push_back(nullptr);
  benchmark::Initialize(&count, arguments.data(), print_help);
  if (benchmark::ReportUnrecognizedArguments(count, arguments.data())) return kUsage;
  warn_unless_release();
  add_context();
  for (auto* function : registrations()) function();

  FailureCounter reporter(*benchmark::CreateDefaultDisplayReporter());
  const std::size_t matched = benchmark::RunSpecifiedBenchmarks(&reporter);
  benchmark::Shutdown();
  if (matched == 0) {
    fmt::print(stderr, "error: no benchmark matches --benchmark_filter={}\n",
               benchmark::GetBenchmarkFilter());
    return kUsage;
  }
  if (reporter.failures() > 0) {
    fmt::print(stderr, "error: {} benchmark(s) reported an invalid result\n", reporter.failures());
    return kCheckFailed;
  }
  return 0;
}

}  // namespace

bool quick() { return quick_mode; }

Registration::Registration(void (*function)()) { registrations().push_back(function); }

Command::Command(const char* name, const char* help, int (*function)()) {
  commands().push_back({name, help, function});
}

Option::Option(const char* flag, const char* help) : flag_(flag), help_(help) {
  options().push_back(this);
}

bool Option::read(std::string_view argument) {
  const std::string start = std::string(flag_) + "=";
  if (!argument.starts_with(start)) return false;
  value_ = argument.substr(start.size());
  return true;
}

void fail(benchmark::State& state, const std::string& reason) {
  state.SkipWithError(reason.c_str());
}

void skip(benchmark::State& state, const std::string& reason) {
  state.SkipWithError(fmt::format("{}{}", kSkipPrefix, reason).c_str());
}

}  // namespace piecework::bench

int main(int argc, char** argv) { return piecework::bench::run(argc, argv); }
