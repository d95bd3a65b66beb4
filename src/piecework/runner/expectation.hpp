#pragma once

// Checks the scene's `expect` while a run goes on.

#include <vector>

#include <piecework/runner/record.hpp>
#include <piecework/runner/world.hpp>

namespace piecework::runner {

class ExpectationChecker {
 public:
  /// \param world  must outlive the checker.
  /// \throws InputError if an expectation names a cloth or vertex that does not exist.
  explicit ExpectationChecker(const World& world);

  /// Evaluates what is due at this state; call it after every step and for the start state.
  void observe(const model::State& state, const std::vector<FrameRecord>& frames);

  /// Evaluates what is due at the end.
  void finish(const model::State& state, const std::vector<FrameRecord>& frames);

  /// All results in the scene's order; those whose time did not come are not reached.
  [[nodiscard]] std::vector<ExpectationResult> results() const;

  /// Takes over results of an earlier part of the run, recognised by their text.
  void restore(const std::vector<ExpectationResult>& results);

 private:
  struct Item {
    const scene::Expectation* expectation;
    int part = -1;             ///< -1: all cloths
    int vertex = -1;           ///< of the model
    ExpectationResult result;  ///< its text is always there
  };
  void evaluate(Item& item, const model::State& state,
                const std::vector<FrameRecord>& frames) const;
  [[nodiscard]] double measure(const Item& item, const model::State& state,
                               const std::vector<FrameRecord>& frames) const;

  const World& world_;
  std::vector<Item> items_;
};

}  // namespace piecework::runner
