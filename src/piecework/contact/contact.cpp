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
            slack_) {
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

bool Contact::is_held(int v) const {
  return v >= model_.num_vertices() || (*problem_->fixed)[at(v)] != 0;
}

void Contact::begin_step(const model::StepProblem& problem, double begin, double end,
                         const Positions& obstacles) {
  problem_ = &problem;
  end_time_ = end;
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
  arrived_ = true;
  report_.held_back = 0;
}

bool Contact::held_moves(const Positions& x) const {
  if (!obstacles_.are_static()) return true;
  return parallel_max(at(model_.num_vertices()), [&](std::size_t v) {
           const auto row = static_cast<Eigen::Index>(v);
           const bool moves = (*problem_->fixed)[v] && x.row(row) != problem_->previous->row(row);
           return moves ? 1.0 : 0.0;
         }) > 0;
}

double Contact::start(Positions& x) {
  bodies_.start(*problem_->previous, *problem_->fixed, x);
  listed_ = -1;
  if (held_moves(x)) carry({*problem_->previous, obstacle_begin_}, x, obstacle_end_);
  model_.sewing.follow(end_time_, x);
  std::swap(obstacle_now_, obstacle_before_);
  obstacle_now_ = obstacle_end_;
  const HeldWay held = shorten({*problem_->previous, obstacle_begin_}, x, obstacle_now_);
  note_held(held);
  return held.least;
}

void Contact::note_held(const HeldWay& held) {
  arrived_ = held.least == 1;
  report_.held_back = 1 - held.least;
}

bool Contact::advance_held(Positions& x) {
  if (arrived_) return false;
  Positions to = x, obstacles = obstacle_end_;
  parallel_for(static_cast<std::size_t>(x.rows()), [&](std::size_t v) {
    const auto row = static_cast<Eigen::Index>(v);
    if ((*problem_->fixed)[v]) to.row(row) = problem_->predicted->row(row);
  });
  model_.sewing.follow(end_time_, to);
  const Positions from = obstacle_now_;
  carry({x, from}, to, obstacles);
  const HeldWay held = shorten({x, from}, to, obstacles);
  if (held.most == 0) return false;
  note_held(held);
  std::swap(x, to);
  std::swap(obstacle_now_, obstacles);
  return true;
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

void Contact::find_active_pairs(std::span<const NearPair> pairs, const Points& points) {
  const Points rest{model_.start, rest_obstacles_};
  active_blocks_.resize((pairs.size() + kPairsPerBlock - 1) / kPairsPerBlock);
  parallel_for(
      active_blocks_.size(),
      [&](std::size_t block) {
        active_blocks_[block].clear();
        const std::size_t end = std::min(pairs.size(), (block + 1) * kPairsPerBlock);
        ActivePair active;
        for (std::size_t i = block * kPairsPerBlock; i < end; ++i) {
          if (!activate(pairs[i], points, rest, activation_of(pairs[i]), active)) continue;
          active.friction = friction_of(pairs[i]);
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
  const std::vector<NearPair>& pairs = near_.near(points).pairs;
  if (listed_ != near_.generation()) bodies_.list(x, slack_);
  listed_ = near_.generation();
  active_.clear();
  find_active_pairs(pairs, points);
  bodies_.activate(x, active_);
  report_.pairs = static_cast<int>(active_.size());
  report_.candidates = static_cast<int>(near_.candidates().pairs.size());
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
  double energy = 0;
  for (FrictionPair& pair : sliding_) {
    const Vec3 way = slid(pair, points);
    const FrictionValue f = smoothed_friction(way.norm(), slip, pair.sliding);
    pair.force_ratio = f.force_ratio;
    energy += pair.limit * f.energy;
    std::array<Vec3, 4> forces;
    for (std::size_t k = 0; k < at(pair.count); ++k)
      forces[k] = pair.limit * f.force_ratio * pair.beta[k] * way;
    add_to_gradient(pair.vertices, pair.count, forces, gradient);
  }
  return energy;
}

void Contact::add_block(const collision::PairVertices& vertices, int count,
                        const std::array<double, 4>& beta, const Mat3& stiffness,
                        std::vector<model::ContactBlock>& blocks) const {
  model::ContactBlock block{{}, 0, {}, stiffness};
  for (std::size_t k = 0; k < at(count); ++k) {
    if (is_held(vertices[k])) continue;
    block.vertices[at(block.count)] = vertices[k];
    block.beta[at(block.count++)] = beta[k];
  }
  if (block.count > 0) blocks.push_back(block);
}

void Contact::hessian(std::vector<model::ContactBlock>& blocks) const {
  blocks.clear();
  for (const ActivePair& pair : active_)
    add_block(pair.vertices, pair.count, pair.beta,
              pair.curvature * pair.normal * pair.normal.transpose(), blocks);
  for (const FrictionPair& pair : sliding_)
    add_block(
        pair.vertices, pair.count, pair.beta,
        pair.limit * pair.force_ratio * (Mat3::Identity() - pair.normal * pair.normal.transpose()),
        blocks);
}

void Contact::add_stiffness(const collision::PairVertices& vertices, int count,
                            const std::array<double, 4>& beta, const Vec3& normal, double pressing,
                            double sliding, const Positions& normals,
                            model::ContactStiffness& stiffness) const {
  double sum = 0;  // of |beta| over what moves: |sum beta u|^2 <= sum |beta| sum |beta| |u|^2
  for (std::size_t k = 0; k < at(count); ++k)
    if (!is_held(vertices[k])) sum += std::abs(beta[k]);
  for (std::size_t k = 0; k < at(count); ++k) {
    const int v = vertices[k];
    if (is_held(v)) continue;
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
    Positions all(x.rows() + obstacle_now_.rows(), 3);
    all << x, obstacle_now_;
    report_.interpenetrations +=
        static_cast<int>(collision::find_intersections(near_.surface(), all).size());
  }
  report_.check_ms = watch.elapsed_ms();
}

}  // namespace piecework::contact
