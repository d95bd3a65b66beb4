#include <piecework/contact/contact.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include <piecework/collision/intersections.hpp>
#include <piecework/core/clock.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/model/assembly.hpp>
#include <piecework/model/stepper.hpp>

namespace piecework::contact {
namespace {

constexpr std::size_t kPairsPerBlock = 1024;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// How far vertices may move until near pairs are listed anew: a list must stay short beside the
/// mesh, or every triangle has its neighbours' neighbours in it.
double list_slack(const model::ClothModel& model, double distance) {
  constexpr double kOfEdge = 0.15;
  return std::max(0.5 * distance, kOfEdge * model.mean_edge);
}

void between(const Positions& a, const Positions& b, double fraction, Positions& out) {
  out.resize(a.rows(), 3);
  parallel_for(static_cast<std::size_t>(a.rows()), [&](std::size_t i) {
    const auto v = static_cast<Eigen::Index>(i);
    out.row(v) = fraction == 1 ? Eigen::RowVector3d(b.row(v))
                               : Eigen::RowVector3d(a.row(v) + fraction * (b.row(v) - a.row(v)));
  });
}

}  // namespace

double default_stiffness(const model::ClothModel& model, double h) {
  constexpr double kPart = 0.1;
  return kPart * model::assemble_system(model, h).diagonal().mean();
}

Contact::Contact(const model::ClothModel& model, ContactOptions options, Obstacles obstacles)
    : model_(model),
      options_(options),
      obstacles_(std::move(obstacles)),
      near_(collision::make_surface(model.triangles, model.num_vertices(), obstacles_.triangles,
                                    obstacles_.num_vertices, options.self),
            options.activation.distance, list_slack(model, options.activation.distance)) {
  if (obstacles_.place) obstacles_.place(0, rest_obstacles_);
}

bool Contact::is_held(int v) const {
  return v >= model_.num_vertices() || (*problem_->fixed)[at(v)] != 0;
}

void Contact::begin_step(const model::StepProblem& problem, double begin, double end) {
  problem_ = &problem;
  end_time_ = end;
  report_ = {};
  active_.clear();
  friction_.clear();
  near_.begin();
  if (obstacles_.place) {
    obstacles_.place(begin, obstacle_begin_);
    obstacles_.place(end, obstacle_end_);
  }
  hold_at(0);
  if (!options_.friction) return;
  // Pressure as the step before left it: what touches only now slides freely until it is renewed.
  const Stopwatch watch;
  near_.cover({*problem.previous, obstacle_begin_}, {*problem.predicted, obstacle_end_});
  report_.cull_ms += watch.elapsed_ms();
  find_active(*problem.previous);
  renew_friction();
}

void Contact::hold_at(double fraction) {
  fraction_ = fraction;
  between(obstacle_begin_, obstacle_end_, fraction, obstacle_now_);
}

double Contact::start(Positions& x) {
  between(obstacle_begin_, obstacle_end_, 1, obstacle_now_);
  fraction_ = shorten({*problem_->previous, obstacle_begin_}, x, obstacle_now_);
  report_.held_back = 1 - fraction_;
  return fraction_;
}

bool Contact::advance_held(Positions& x) {
  if (fraction_ == 1) return false;
  Positions to = x, obstacles = obstacle_end_;
  parallel_for(static_cast<std::size_t>(x.rows()), [&](std::size_t v) {
    const auto row = static_cast<Eigen::Index>(v);
    if ((*problem_->fixed)[v]) to.row(row) = problem_->predicted->row(row);
  });
  const Positions from = obstacle_now_;
  const double part = shorten({x, from}, to, obstacles);
  if (!(part > 0)) return false;
  fraction_ = part == 1 ? 1 : fraction_ + part * (1 - fraction_);
  report_.held_back = 1 - fraction_;
  std::swap(x, to);
  std::swap(obstacle_now_, obstacles);
  return true;
}

bool Contact::limit(const Positions& from, Positions& to) {
  const int before = report_.shortened;
  shorten({from, obstacle_now_}, to, obstacle_now_);
  return report_.shortened > before;
}

void Contact::find_active(const Positions& x) {
  const Points points{x, obstacle_now_}, rest{model_.start, rest_obstacles_};
  const Stopwatch watch;
  if (near_.cover(points, points)) report_.cull_ms += watch.elapsed_ms();
  const std::span<const NearPair> pairs = near_.near(points);
  active_blocks_.resize((pairs.size() + kPairsPerBlock - 1) / kPairsPerBlock);
  parallel_for(
      active_blocks_.size(),
      [&](std::size_t block) {
        active_blocks_[block].clear();
        const std::size_t end = std::min(pairs.size(), (block + 1) * kPairsPerBlock);
        ActivePair active;
        active.friction = options_.friction.value_or(0);
        for (std::size_t i = block * kPairsPerBlock; i < end; ++i)
          if (activate(pairs[i], points, rest, options_.activation, active))
            active_blocks_[block].push_back(active);
      },
      1);
  active_.clear();
  for (const auto& block : active_blocks_) active_.insert(active_.end(), block.begin(), block.end());
  report_.pairs = static_cast<int>(active_.size());
  report_.candidates = static_cast<int>(near_.candidates().size());
}

void Contact::add_to_gradient(const collision::PairVertices& vertices, int count,
                              const std::array<Vec3, 4>& forces, Positions& gradient) const {
  for (std::size_t i = 0; i < at(count); ++i)
    if (!is_held(vertices[i])) gradient.row(vertices[i]) += forces[i].transpose();
}

double Contact::evaluate(const Positions& x, Positions& gradient) {
  const Stopwatch watch;
  find_active(x);
  double energy = 0;
  for (const ActivePair& pair : active_) {
    energy += pair.energy;
    add_to_gradient(pair.vertices, pair.count, pair.gradient, gradient);
  }
  if (!friction_.empty()) energy += add_friction(x, gradient);
  report_.narrow_ms += watch.elapsed_ms();
  return energy;
}

bool Contact::renew_friction() {
  if (!options_.friction) return false;
  const Points before{*problem_->previous, obstacle_begin_};
  friction_.resize(active_.size());
  parallel_for(active_.size(), [&](std::size_t i) {
    const ActivePair& pair = active_[i];
    FrictionPair& out = friction_[i];
    out = {pair.vertices, pair.count, pair.beta, pair.normal, pair.friction * pair.pressure,
           Vec3::Zero()};
    for (std::size_t k = 0; k < at(pair.count); ++k)
      out.start += pair.beta[k] * before(pair.vertices[k]);
  });
  return true;
}

double Contact::add_friction(const Positions& x, Positions& gradient) {
  const Points points{x, obstacle_now_};
  const double slip = options_.slip_speed * options_.h;
  double energy = 0;
  for (const FrictionPair& pair : friction_) {
    Vec3 slid = -pair.start;
    for (std::size_t k = 0; k < at(pair.count); ++k)
      slid += pair.beta[k] * points(pair.vertices[k]);
    slid -= slid.dot(pair.normal) * pair.normal;
    const FrictionValue f = smoothed_friction(slid.norm(), slip);
    energy += pair.limit * f.energy;
    std::array<Vec3, 4> forces;
    for (std::size_t k = 0; k < at(pair.count); ++k)
      forces[k] = pair.limit * f.force_ratio * pair.beta[k] * slid;
    add_to_gradient(pair.vertices, pair.count, forces, gradient);
  }
  return energy;
}

void Contact::stiffness(const Positions& normals, model::ContactStiffness& stiffness) const {
  stiffness.along = Eigen::VectorXd::Zero(model_.num_vertices());
  stiffness.across = Eigen::VectorXd::Zero(model_.num_vertices());
  const double slip = options_.slip_speed * options_.h;
  for (const ActivePair& pair : active_) {
    double sum = 0;  // of |beta| over what moves: |sum beta u|^2 <= sum |beta| sum |beta| |u|^2
    for (std::size_t k = 0; k < at(pair.count); ++k)
      if (!is_held(pair.vertices[k])) sum += std::abs(pair.beta[k]);
    const double sticking = pair.friction * pair.pressure * 2 / slip;
    for (std::size_t k = 0; k < at(pair.count); ++k) {
      const int v = pair.vertices[k];
      if (is_held(v)) continue;
      const double share = sum * std::abs(pair.beta[k]);
      const double aligned = normals.row(v).dot(pair.normal.transpose());
      const double along = aligned * aligned;
      stiffness.along[v] += share * (pair.curvature * along + sticking * (1 - along));
      stiffness.across[v] += share * (pair.curvature * (1 - along) + sticking);
    }
  }
}

void Contact::end_step(const Positions& x) {
  if (!options_.check) return;
  const Stopwatch watch;
  Positions all(x.rows() + obstacle_now_.rows(), 3);
  all << x, obstacle_now_;
  report_.interpenetrations =
      static_cast<int>(collision::find_intersections(near_.surface(), all).size());
  report_.check_ms = watch.elapsed_ms();
}

}  // namespace piecework::contact
