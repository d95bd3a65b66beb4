#pragma once

// Every iteration of a run as a line of CSV: what each stop rule would have seen.

#include <filesystem>
#include <string>

#include <piecework/model/integrator.hpp>

namespace piecework::runner {

/// iterations.csv: step, iteration (0: the start), energy_j, gradient, error_mean_edges, dx_2,
/// dx_rms, dx_inf (unit boxes), evaluations. No times: the same bytes for every number of threads.
class IterationLog {
 public:
  static constexpr const char* kFile = "iterations.csv";

  /// Of the run in `directory`. What an earlier part of it wrote about steps up to `last_step` is
  /// kept. \throws InputError if it cannot be read.
  IterationLog(const std::filesystem::path& directory, int last_step);

  /// To be called once; the log outlives the integrator.
  void attach(model::Integrator& integrator);

  /// \throws OutputError.
  void save() const;

 private:
  std::filesystem::path path_;
  std::string text_;
};

}  // namespace piecework::runner
