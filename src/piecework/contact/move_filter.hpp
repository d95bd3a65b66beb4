#pragma once

// How far a move may go: continuous collision detection, vertex by vertex.

#include <cstddef>
#include <vector>

#include <piecework/collision/ccd.hpp>
#include <piecework/contact/held.hpp>
#include <piecework/contact/near_pairs.hpp>
#include <piecework/model/constraints.hpp>

namespace piecework::contact {

/// What became of a move.
struct Shortening {
  bool any = false;  ///< something had to be shortened
  /// Parts of their ways that what is held and moves can go: the one that gets least far, and most.
  double least = 1, most = 1;
};

/// Shortens straight ways so that no pair meets on them. Only vertices that would meet something
/// are shortened, so that one pair does not stop the whole cloth; what that changes is checked
/// again.
class MoveFilter {
 public:
  /// \param model  must outlive this object
  MoveFilter(const model::ClothModel& model, const collision::CcdOptions& ccd)
      : model_(model), ccd_(ccd) {}

  /// \param time  at which seams are what they are in this step, s
  void begin_step(const Held& held, double time);

  /// Shortens the way from `from` to {to, obstacles}. \pre near covers both
  Shortening shorten(NearPairs& near, const Points& from, Positions& to, Positions& obstacles);

 private:
  struct Hit {
    std::size_t pair;
    double time;
  };

  void find_hits(const PairList& list, const Points& from, const Points& to, bool first);
  void find_hits_in(const PairList& list, std::size_t block, const Points& from, const Points& to,
                    bool first);
  void begin_ways(const Points& from, const Points& to);
  void lower_scales(const PairList& list, bool vertex_by_vertex);
  void lower_scale(int vertex, double part);
  void take_scales();
  void go(const Points& from, Positions& to, Positions& obstacles) const;
  [[nodiscard]] Shortening held_ways() const;

  const model::ClothModel& model_;
  collision::CcdOptions ccd_;
  Held held_;
  double time_ = 0;
  Positions way_;                           ///< of all points as it was wanted
  std::vector<double> scale_, next_scale_;  ///< part of its way that each vertex goes
  std::vector<char> changed_;               ///< by the last round
  std::vector<double> moved_;               ///< since the list was made, m
  std::vector<double> own_way_;             ///< length of the way, without the common motion, m
  std::vector<Hit> hits_;
  std::vector<std::vector<Hit>> hit_blocks_;
};

}  // namespace piecework::contact
