#include <piecework/untangle/untangle.hpp>

#include <algorithm>

#include "pushes.hpp"
#include "setting.hpp"
#include "spread.hpp"
#include "tangle.hpp"

namespace piecework::untangle {
namespace {

constexpr double kOpenTo = 0.5;       ///< of the contact distance: gaps that pushes aim at
constexpr double kEnough = 0.1;       ///< of the contact distance: gaps to be content with
constexpr int kOpeningRounds = 10;    ///< at most so many, once nothing is wrong
constexpr double kFirstStep = 0.03;   ///< mean edges
constexpr double kLargestStep = 0.5;  ///< mean edges
constexpr double kFirstReach = 8;     ///< edges
constexpr double kLargestReach = 64;  ///< edges
constexpr int kPatience = 4;          ///< rounds without progress until steps become longer

/// How good positions are: what is wrong, then how much is too close.
struct State {
  Positions x;
  Tangle tangle;
  Closeness close;  ///< known where nothing is wrong

  [[nodiscard]] int wrong() const { return tangle.count().total(); }
  [[nodiscard]] std::size_t too_close() const { return close.pairs.size() + close.bodies.size(); }
  [[nodiscard]] bool better_than(const State& other) const {
    return wrong() != other.wrong() ? wrong() < other.wrong() : too_close() < other.too_close();
  }
};

class Untangling {
 public:
  Untangling(const Setting& setting, const UntangleOptions& options)
      : setting_(setting),
        options_(options),
        spread_(setting),
        marked_(static_cast<std::size_t>(setting.model.num_vertices()), 0),
        step_(kFirstStep * setting.model.mean_edge) {}

  UntangleReport run(Positions& x) {
    const Positions start = x;
    State now = examined(x);
    UntangleReport report{.before = now.tangle.count()};
    State best = now;
    int opened = 0, since_best = 0;
    while (report.rounds < options_.rounds && !spread_.empty()) {
      if (now.wrong() == 0 && (now.too_close() == 0 || opened++ == kOpeningRounds)) break;
      const Displacements wanted(setting_, pushes_for(now));
      if (wanted.u.isZero(0)) break;
      mark(wanted);
      ++report.rounds;
      spread_.move(wanted, reach_, x);
      now = examined(x);
      since_best = now.better_than(best) ? 0 : since_best + 1;
      if (since_best == 0) best = now;
      if (since_best % kPatience == kPatience - 1) lengthen();
    }
    x = best.x;
    report.after = best.tangle.count();
    report.left_at = somewhere(best.tangle);
    report.largest_move = (x - start).rowwise().norm().maxCoeff();
    return report;
  }

 private:
  State examined(const Positions& x) {
    const Positions all = all_positions(setting_, x);
    State state{x, find_tangle(setting_, all, passed_), {}};
    if (state.wrong() == 0) state.close = find_close(setting_, all, marked_, kEnough);
    return state;
  }

  [[nodiscard]] std::vector<Push> pushes_for(const State& state) const {
    const Positions all = all_positions(setting_, state.x);
    if (state.wrong() > 0) return untangling_pushes(setting_, state.tangle, all, step_);
    return opening_pushes(find_close(setting_, all, marked_, kOpenTo));
  }

  void lengthen() {
    step_ = std::min(2 * step_, kLargestStep * setting_.model.mean_edge);
    reach_ = std::min(2 * reach_, kLargestReach);
  }

  void mark(const Displacements& wanted) {
    for (std::size_t v = 0; v < marked_.size(); ++v)
      if (wanted.pushed[v]) marked_[v] = 1;
  }

  [[nodiscard]] std::optional<int> somewhere(const Tangle& tangle) const {
    if (!tangle.crossings.empty()) {
      const collision::Intersection& first = tangle.crossings.front();
      const int v = setting_.surface.edges[static_cast<std::size_t>(first.edge)][0];
      return setting_.surface.is_cloth(v)
                 ? v
                 : setting_.surface.triangles[static_cast<std::size_t>(first.triangle)][0];
    }
    if (!tangle.in_mesh.empty()) return tangle.in_mesh.front().vertex;
    if (!tangle.in_body.empty()) return tangle.in_body.front().vertex;
    return std::nullopt;
  }

  const Setting& setting_;
  UntangleOptions options_;
  Spread spread_;
  Passed passed_;
  std::vector<char> marked_;    ///< vertices that were pushed
  double step_;                 ///< m
  double reach_ = kFirstReach;  ///< edges
};

}  // namespace

UntangleReport untangle(const model::ClothModel& model, const contact::Colliders& colliders,
                        const std::vector<char>& held, const UntangleOptions& options,
                        Positions& x) {
  const Setting setting(model, colliders, held, options);
  return Untangling(setting, options).run(x);
}

}  // namespace piecework::untangle
