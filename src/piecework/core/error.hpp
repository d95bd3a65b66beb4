#pragma once

// The three kinds of trouble, never mixed: bad input and failed output are exceptions that carry
// the program's exit code; our own bugs are assertions; numerical trouble inside a step is a
// [[nodiscard]] status of the function concerned.

#include <stdexcept>
#include <string>

namespace piecework {

/// Exit codes of the program `piecework` (docs/architecture.md lists them for users).
enum class ExitCode : int {
  Ok = 0,
  SimulationFailed = 1,  ///< the simulation diverged
  Usage = 2,             ///< the command line is wrong
  BadInput = 3,          ///< a scene, mesh or other named input is wrong or missing
  OutputFailed = 4,      ///< a file could not be written
  CheckFailed = 5,       ///< a comparison or an expectation does not hold
  BackendMissing = 6,    ///< a graphics library or similar is not installed
};

/// Base of every exception that Piecework throws on purpose.
class Error : public std::runtime_error {
 public:
  Error(ExitCode code, const std::string& text) : std::runtime_error(text), code_(code) {}
  [[nodiscard]] ExitCode code() const { return code_; }

 private:
  ExitCode code_;
};

/// Bad input. The text reads "<file>: <item>: <what is wrong>; <what to change>".
class InputError : public Error {
 public:
  explicit InputError(const std::string& text) : Error(ExitCode::BadInput, text) {}
};

/// A file could not be written; nothing that existed before was damaged.
class OutputError : public Error {
 public:
  explicit OutputError(const std::string& text) : Error(ExitCode::OutputFailed, text) {}
};

/// The simulation cannot go on (non-finite state, matrix not positive definite).
class SimulationError : public Error {
 public:
  explicit SimulationError(const std::string& text) : Error(ExitCode::SimulationFailed, text) {}
};

/// A library that the command needs at run time is missing.
class BackendError : public Error {
 public:
  explicit BackendError(const std::string& text) : Error(ExitCode::BackendMissing, text) {}
};

}  // namespace piecework

/// Checks an invariant of ours (not of the input). Active in the dev and sanitizer presets.
#ifdef PIECEWORK_ASSERTIONS
#include <cstdio>
#include <cstdlib>
#define PIECEWORK_ASSERT(condition)                                                              \
  ((condition)                                                                                   \
       ? void(0)                                                                                 \
       : (std::fprintf(stderr, "%s:%d: assertion failed: %s\n", __FILE__, __LINE__, #condition), \
          std::abort()))
#else
#define PIECEWORK_ASSERT(condition) void(0)
#endif
