#pragma once

// What every benchmark driver shares; bench_main.cpp holds main() and this header's functions.

#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>

#include <benchmark/benchmark.h>

namespace piecework::bench {

/// True under --quick: drivers then take small sizes and few repetitions, so that a run takes
/// seconds. It shows that the driver works and that its results are valid; its times mean nothing.
/// Valid inside benchmarks and Registration functions, not in static initialisers.
bool quick();

/// Runs `function` after the command line is read and before the benchmarks start, so that what
/// it registers may depend on quick(). To be a static object of a driver:
///
///     const Registration registration([] {
///       benchmark::RegisterBenchmark("solve", solve)->Arg(quick() ? 1000 : 199809);
///     });
class Registration {
 public:
  explicit Registration(void (*function)());
};

/// Another thing that a driver can do: with the flag `name` as its last argument the
/// driver runs `function` instead of the benchmarks and exits with what that returns. To be a
/// static object of a driver.
class Command {
 public:
  Command(const char* name, const char* help, int (*function)());
};

/// A flag of a driver that takes a value, as --flag=VALUE. To be a static object of the driver.
class Option {
 public:
  Option(const char* flag, const char* help);

  /// Empty: not given.
  [[nodiscard]] const std::string& value() const { return value_; }
  [[nodiscard]] const char* flag() const { return flag_; }
  [[nodiscard]] const char* help() const { return help_; }
  /// Takes the value out of an argument; false if it is for someone else.
  bool read(std::string_view argument);

 private:
  const char* flag_;
  const char* help_;
  std::string value_;
};

/// Ends a benchmark because its result is invalid; the program then exits with 5.
/// Leave the benchmark's function after the call.
void fail(benchmark::State& state, const std::string& reason);

/// Ends a benchmark that makes no sense on this machine (say, more threads than cores). The reason
/// is shown; the program's exit code stays as it is. Leave the benchmark's function after the call.
void skip(benchmark::State& state, const std::string& reason);

/// Vertices along one side of a square sheet of `vertices` (a square number, as in row names
/// n:...).
inline int side_of(std::int64_t vertices) {
  return static_cast<int>(std::lround(std::sqrt(static_cast<double>(vertices))));
}

/// Makes the compiler believe that `value` is read, so that it computes it. Instead of
/// benchmark::DoNotOptimize(), which in 1.7.1 lets g++ 12 overwrite an lvalue with garbage
/// (seen here on a double; their constraint is "+m,r").
template <class T>
void keep(const T& value) {
  asm volatile("" : : "m"(value) : "memory");
}

}  // namespace piecework::bench
