#include <piecework/contact/contact.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include <piecework/collision/intersections.hpp>
#include <piecework/contact/carry.hpp>
#include <piecework/core/clock.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/model/assembly.hpp>
#include <piecework/model/stepper.hpp>

namespace piecework::contact {
namespace {

constexpr std::size_t kPairsPerBlock = 1024;
/// Of the way that is left: less is not tried by bodies with a closed form.
constexpr double kLeastPart = 1.0 / 8;
/// Bounds are rounded: what is farther than this times the contact distance is out of reach.
constexpr double kSurely = 1.01;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// How far vertices may move until near pairs are listed anew: a list must stay short beside the
/// mesh, or every triangle has its neighbours' neighbours in it.
double list_slack(const model::ClothModel& model, double distance) {
  constexpr double kOfEdge = 0.15;
  return std::max(0.5 * distance, kOfEdge * model.mean_edge);
}

}  // namespace

double default_stiffness(const model::ClothModel& model, double h) {
  constexpr double kPart = 0.1;
  return kPart * model::assemble_system(model, h).diagonal().mean();
}

Obstacles::Obstacles(std::span<const colliders::MeshCollider> meshes)
    : meshes_(meshes), first_vertex_{0} {
  for (const auto& mesh : meshes) {
    const int first = first_vertex_.back();
    for (const Triangle& t : mesh.triangles())
      triangles_.push_back({first + t[0], first + t[1], first + t[2]});
    first_vertex_.push_back(first + mesh.num_vertices());
  }
}

bool Obstacles::are_static() const {
  return std::all_of(meshes_.begin(), meshes_.end(), [](const auto& m) { return m.is_static(); });
}

void Obstacles::place(double time, Positions& x) const {
  x.resize(num_vertices(), 3);
  Positions one;
  for (std::size_t m = 0; m < meshes_.size(); ++m) {
    meshes_[m].positions_at(time, one);
    x.middleRows(first_vertex_[m], one.rows()) = one;
  }
}

const colliders::MeshCollider& Obstacles::of_vertex(int v) const {
  const auto next = std::upper_bound(first_vertex_.begin(), first_vertex_.end(), v);
  return meshes_[static_cast<std::size_t>(next - first_vertex_.begin()) - 1];
}

collision::Surface Obstacles::surface(const model::ClothModel& cloth, bool self) const {
  return collision::make_surface(cloth.triangles, cloth.num_vertices(), triangles_, num_vertices(),
                                 self);
}

double Obstacles::distance(double otherwise) const {
  double largest = 0;
  for (const auto& mesh : meshes_)
    largest = std::max(largest, mesh.traits().thickness.value_or(otherwise));
  return largest;
}

namespace {

/// Otherwise there is nothing to search, and no tree is built.
bool may_pair(const ContactOptions& options, const Obstacles& obstacles) {
  return options.self || obstacles.num_vertices() > 0;
}

}  // namespace

Contact::Contact(const model::ClothModel& model, ContactOptions options, const Colliders& colliders)
    : model_(model),
      options_(options),
      obstacles_(colliders.meshes),
      bodies_(colliders.bodies, options.activation, options.friction),
      slack_(list_slack(model, options.activation.distance)),
      near_(collision::make_surface(may_pair(options, obstacles_) ? model.triangles : Triangles{},
                                    model.num_vertices(), obstacles_.triangles(),
                                    obstacles_.num_vertices(), options.self),
            std::max(options.activation.distance, obstacles_.distance(options.activation.distance)),
            slack_),
      filter_(model, options.ccd) {
  obstacles_.place(0, rest_obstacles_);
  const auto rubs = [](const auto& collider) { return collider.traits().friction.has_value(); };
  has_friction_ = options.friction ||
                  std::any_of(colliders.bodies.begin(), colliders.bodies.end(), rubs) ||
                  std::any_of(colliders.meshes.begin(), colliders.meshes.end(), rubs);
}

Activation Contact::activation_of(const NearPair& pair) const {
  Activation activation = options_.activation;
  for (const int v : pair.vertices)
    if (v >= model_.num_vertices()) {
      const auto& traits = obstacles_.of_vertex(v - model_.num_vertices()).traits();
      activation.distance = traits.thickness.value_or(activation.distance);
      break;
    }
  return activation;
}

colliders::Friction Contact::friction_of(const NearPair& pair) const {
  for (const int v : pair.vertices)
    if (v >= model_.num_vertices()) {
      const auto& traits = obstacles_.of_vertex(v - model_.num_vertices()).traits();
      return traits.friction.value_or(options_.friction.value_or(colliders::Friction{}));
    }
  return options_.friction.value_or(colliders::Friction{});
}

void Contact::begin_step(const model::StepProblem& problem, double begin, double end,
                         const Positions& obstacles) {
  problem_ = &problem;
  is_held_ = {model_.num_vertices(), problem.fixed};
  end_time_ = end;
  filter_.begin_step(is_held_, end);
  report_ = {};
  active_.clear();
  sliding_.clear();
  near_.begin();
  bodies_.begin_step(begin, end);
  listed_ = -1;
  if (obstacle_begin_.rows() == 0 || lags_ || !obstacles_.are_static()) {
    obstacles_.place(begin, obstacle_begin_);
    obstacles_.place(end, obstacle_end_);
  }
  lags_ = obstacles.rows() > 0;
  if (lags_) obstacle_begin_ = obstacles;
  obstacle_now_ = obstacle_begin_;
  arrived_ = true;
  if (!has_friction_) return;
  // Pressure as the step before left it: what touches only now slides freely until it is renewed.
  const Stopwatch watch;
  near_.cover({*problem.previous, obstacle_begin_}, {*problem.predicted, obstacle_end_});
  report_.cull_ms += watch.elapsed_ms();
  find_active(*problem.previous);
  renew_friction();
}

void Contact::take_back_start() {
  std::swap(obstacle_now_, obstacle_before_);
  bodies_.place(1);
  arrived_ = true;
  report_.held_back = 0;
}

bool Contact::held_moves(const Positions& from, const Positions& to) const {
  if (!obstacles_.are_static()) return true;
  return parallel_max(at(model_.num_vertices()), [&](std::size_t v) {
           const auto row = static_cast<Eigen::Index>(v);
           const bool moves = (*problem_->fixed)[v] && to.row(row) != from.row(row);
           return moves ? 1.0 : 0.0;
         }) > 0;
}

double Contact::start(Positions& x) {
  std::swap(obstacle_now_, obstacle_before_);
  obstacle_now_ = obstacle_begin_;
  bodies_.place(0);
  arrived_ = false;
  (void)go_on(*problem_->previous, x);
  return 1 - report_.held_back;
}

bool Contact::advance_held(Positions& x) {
  if (arrived_) return false;
  Positions to = x;
  parallel_for(static_cast<std::size_t>(x.rows()), [&](std::size_t v) {
    const auto row = static_cast<Eigen::Index>(v);
    if ((*problem_->fixed)[v]) to.row(row) = problem_->predicted->row(row);
  });
  if (!go_on(x, to)) return false;
  std::swap(x, to);
  return true;
}

/// Bodies with a closed form move at once, and cloth that lies on others cannot always give way so
/// far: then they go a part of their way.
bool Contact::go_on(const Positions& from, Positions& to) {
  const Positions wanted = bodies_.move_in_step() ? to : Positions();
  const Positions obstacles = obstacle_now_;
  for (double part = 1;; part = part > kLeastPart ? part / 2 : 0) {
    const Shortening way = go_on_by(part, from, obstacles, to);
    const bool enters = way.any && part > 0 && bodies_.move_in_step() &&
                        bodies_.any_enters(from, *problem_->fixed, to);
    if (!enters) {
      note_held(way);
      return way.most > 0 || (part > 0 && bodies_.move_in_step());
    }
    bodies_.take_back();
    to = wanted;
  }
}

Shortening Contact::go_on_by(double part, const Positions& from, const Positions& obstacles,
                             Positions& to) {
  listed_ = -1;
  model_.sewing.follow(end_time_, to);
  if (held_moves(from, to)) carry_along({from, obstacles}, to, obstacle_end_);
  bodies_.move(part, from, *problem_->fixed, to);
  model_.sewing.follow(end_time_, to);
  obstacle_now_ = obstacle_end_;
  return shorten({from, obstacles}, to, obstacle_now_);
}

void Contact::note_held(const Shortening& way) {
  const double gone = std::min(way.least, bodies_.move_in_step() ? bodies_.part() : 1.0);
  arrived_ = gone == 1;
  report_.held_back = 1 - gone;
}

bool Contact::limit(const Positions& from, Positions& to) {
  const int before = report_.shortened;
  if (bodies_.limit(from, *problem_->fixed, to)) {
    ++report_.shortened;
    model_.sewing.follow(end_time_, to);
  }
  shorten({from, obstacle_now_}, to, obstacle_now_);
  return report_.shortened > before;
}

void Contact::carry_along(const Points& from, Positions& x, const Positions& obstacles) {
  const Stopwatch watch;
  near_.cover(from, {x, obstacles});
  carry(near_.candidates().pairs, is_held_, from, x, obstacles);
  model_.sewing.follow(end_time_, x);
  report_.narrow_ms += watch.elapsed_ms();
}

Shortening Contact::shorten(const Points& from, Positions& to, Positions& obstacles) {
  Stopwatch watch;
  if (near_.cover(from, {to, obstacles})) report_.cull_ms += watch.lap();
  const Shortening way = filter_.shorten(near_, from, to, obstacles);
  if (way.any) ++report_.shortened;
  report_.narrow_ms += watch.lap();
  return way;
}

void Contact::find_active_pairs(const PairList& list, const Points& points) {
  const std::vector<NearPair>& pairs = list.pairs;
  list.moved(points, moved_);
  const Points rest{model_.start, rest_obstacles_};
  active_blocks_.resize((pairs.size() + kPairsPerBlock - 1) / kPairsPerBlock);
  parallel_for(
      active_blocks_.size(),
      [&](std::size_t block) {
        active_blocks_[block].clear();
        const std::size_t end = std::min(pairs.size(), (block + 1) * kPairsPerBlock);
        ActivePair active;
        for (std::size_t i = block * kPairsPerBlock; i < end; ++i) {
          const NearPair& pair = pairs[i];
          const Activation activation = activation_of(pair);
          if (pair.distance - closing_bound(pair, moved_) > kSurely * activation.distance) continue;
          if (!activate(pair, points, rest, activation, active)) continue;
          active.friction = friction_of(pair);
          active_blocks_[block].push_back(active);
        }
      },
      1);
  for (const auto& block : active_blocks_)
    active_.insert(active_.end(), block.begin(), block.end());
}

void Contact::find_active(const Positions& x) {
  const Points points{x, obstacle_now_};
  const Stopwatch watch;
  if (near_.cover(points, points)) report_.cull_ms += watch.elapsed_ms();
  const PairList& near = near_.near(points);
  if (listed_ != near_.generation()) bodies_.list(x, slack_);
  listed_ = near_.generation();
  active_.clear();
  find_active_pairs(near, points);
  bodies_.activate(x, active_);
  report_.pairs = static_cast<int>(active_.size());
  report_.candidates = static_cast<int>(near_.candidates().pairs.size());
}

double Contact::evaluate(const Positions& x, Positions& gradient) {
  const Stopwatch watch;
  find_active(x);
  double energy = 0;
  for (const ActivePair& pair : active_) {
    energy += pair.energy;
    for (std::size_t k = 0; k < at(pair.count); ++k)
      if (!is_held_(pair.vertices[k]))
        gradient.row(pair.vertices[k]) += pair.gradient[k].transpose();
  }
  if (!sliding_.empty()) energy += add_friction(x, gradient);
  report_.narrow_ms += watch.elapsed_ms();
  return energy;
}

bool Contact::renew_friction() {
  if (!has_friction_) return false;
  const Points before{*problem_->previous, obstacle_begin_};
  sliding_.resize(active_.size());
  parallel_for(active_.size(), [&](std::size_t i) {
    const ActivePair& pair = active_[i];
    FrictionPair& out = sliding_[i];
    const auto [sticking, sliding] = pair.friction;
    out = {pair.vertices,
           pair.count,
           pair.beta,
           pair.normal,
           sticking * pair.pressure,
           sticking > 0 ? sliding / sticking : 1,
           Vec3::Zero()};
    if (pair.count == 1) {
      out.start = bodies_.unslid(pair, before(pair.vertices[0]));
      return;
    }
    for (std::size_t k = 0; k < 4; ++k) out.start += pair.beta[k] * before(pair.vertices[k]);
  });
  return true;
}

Vec3 Contact::slid(const FrictionPair& pair, const Points& points) const {
  Vec3 way = -pair.start;
  for (std::size_t k = 0; k < at(pair.count); ++k) way += pair.beta[k] * points(pair.vertices[k]);
  return way - way.dot(pair.normal) * pair.normal;
}

double Contact::add_friction(const Positions& x, Positions& gradient) {
  const Points points{x, obstacle_now_};
  const double slip = options_.slip_speed * options_.h;
  parallel_for(sliding_.size(), [&](std::size_t i) {
    FrictionPair& pair = sliding_[i];
    const Vec3 way = slid(pair, points);
    const FrictionValue f = smoothed_friction(way.norm(), slip, pair.sliding);
    pair.force_ratio = f.force_ratio;
    pair.energy = pair.limit * f.energy;
    pair.force = pair.limit * f.force_ratio * way;
  });
  double energy = 0;
  for (const FrictionPair& pair : sliding_) {
    energy += pair.energy;
    for (std::size_t k = 0; k < at(pair.count); ++k)
      if (!is_held_(pair.vertices[k]))
        gradient.row(pair.vertices[k]) += pair.beta[k] * pair.force.transpose();
  }
  return energy;
}

model::ContactBlock Contact::block(const collision::PairVertices& vertices, int count,
                                   const std::array<double, 4>& beta, const Mat3& stiffness) const {
  model::ContactBlock block{{}, 0, {}, stiffness};
  for (std::size_t k = 0; k < at(count); ++k) {
    if (is_held_(vertices[k])) continue;
    block.vertices[at(block.count)] = vertices[k];
    block.beta[at(block.count++)] = beta[k];
  }
  return block;
}

void Contact::hessian(std::vector<model::ContactBlock>& blocks) const {
  blocks.resize(active_.size() + sliding_.size());
  parallel_for(active_.size(), [&](std::size_t i) {
    const ActivePair& p = active_[i];
    blocks[i] = block(p.vertices, p.count, p.beta, p.curvature * p.normal * p.normal.transpose());
  });
  parallel_for(sliding_.size(), [&](std::size_t i) {
    const FrictionPair& p = sliding_[i];
    blocks[active_.size() + i] =
        block(p.vertices, p.count, p.beta,
              p.limit * p.force_ratio * (Mat3::Identity() - p.normal * p.normal.transpose()));
  });
}

void Contact::add_stiffness(const collision::PairVertices& vertices, int count,
                            const std::array<double, 4>& beta, const Vec3& normal, double pressing,
                            double sliding, const Positions& normals,
                            model::ContactStiffness& stiffness) const {
  double sum = 0;  // of |beta| over what moves: |sum beta u|^2 <= sum |beta| sum |beta| |u|^2
  for (std::size_t k = 0; k < at(count); ++k)
    if (!is_held_(vertices[k])) sum += std::abs(beta[k]);
  for (std::size_t k = 0; k < at(count); ++k) {
    const int v = vertices[k];
    if (is_held_(v)) continue;
    const double share = sum * std::abs(beta[k]);
    const double aligned = normals.row(v).dot(normal.transpose());
    const double along = aligned * aligned;
    stiffness.along[v] += share * (pressing * along + sliding * (1 - along));
    stiffness.across[v] += share * (pressing * (1 - along) + sliding);
  }
}

void Contact::stiffness(const Positions& normals, model::ContactStiffness& stiffness) const {
  stiffness.along = Eigen::VectorXd::Zero(model_.num_vertices());
  stiffness.across = Eigen::VectorXd::Zero(model_.num_vertices());
  for (const ActivePair& p : active_)
    add_stiffness(p.vertices, p.count, p.beta, p.normal, p.curvature, 0, normals, stiffness);
  for (const FrictionPair& p : sliding_)
    add_stiffness(p.vertices, p.count, p.beta, p.normal, 0, p.limit * p.force_ratio, normals,
                  stiffness);
}

Positions Contact::lagging_obstacles() const {
  return arrived_ || obstacles_.are_static() ? Positions() : obstacle_now_;
}

void Contact::end_step(const Positions& x) {
  if (!options_.check) return;
  const Stopwatch watch;
  report_.interpenetrations = bodies_.count_inside(x);
  if (may_pair(options_, obstacles_)) {
    Positions all;
    Points{x, obstacle_now_}.copy_to(all);
    report_.interpenetrations +=
        static_cast<int>(collision::find_intersections(near_.surface(), all).size());
  }
  report_.check_ms = watch.elapsed_ms();
}

}  // namespace piecework::contact
