#include <piecework/contact/bodies.hpp>

#include <algorithm>
#include <cmath>

#include <piecework/core/parallel.hpp>

namespace piecework::contact {
namespace {

constexpr std::size_t kVerticesPerBlock = 2048;
/// Of the way to a body; the rest keeps a gap.
constexpr double kApproach = 0.9;
/// Of the distance at its begin: nearer than this a way has met the body.
constexpr double kTouching = 1e-3;
/// Of the contact distance: where a vertex is put that would otherwise be inside.
constexpr double kBeside = 0.5;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

}  // namespace

Bodies::Bodies(std::span<const colliders::AnalyticCollider> colliders, const Activation& activation,
               std::optional<colliders::Friction> friction)
    : colliders_(colliders), activation_(activation), friction_(friction) {}

double Bodies::distance(int body) const {
  return colliders_[at(body)].traits().thickness.value_or(activation_.distance);
}

void Bodies::pose(double time, std::vector<Eigen::Isometry3d>& poses) const {
  poses.clear();
  for (const auto& collider : colliders_) poses.push_back(collider.pose(time));
}

void Bodies::begin_step(double begin, double end) {
  begin_time_ = begin;
  end_time_ = end;
  pose(begin, begin_);
  pose(end, end_);
  moves_ = false;
  for (std::size_t body = 0; body < begin_.size(); ++body)
    if (begin_[body].matrix() != end_[body].matrix()) moves_ = true;
  place(0);
}

void Bodies::place(double part) {
  part_ = part;
  if (part == 1)
    now_ = end_;
  else
    pose(begin_time_ + part * (end_time_ - begin_time_), now_);
}

void Bodies::take_back() {
  part_ = part_before_;
  std::swap(now_, before_);
}

bool Bodies::is_inside(int body, const std::vector<Eigen::Isometry3d>& poses, const Positions& x,
                       std::size_t v) const {
  const Vec3 p = x.row(static_cast<Eigen::Index>(v)).transpose();
  return colliders_[at(body)].signed_distance(p, poses[at(body)]).distance < 0;
}

bool Bodies::any_enters(const Positions& from, const std::vector<char>& held,
                        const Positions& x) const {
  for (int body = 0; body < static_cast<int>(colliders_.size()); ++body) {
    const double enter = parallel_max(at(static_cast<int>(x.rows())), [&](std::size_t v) {
      const bool enters =
          !held[v] && is_inside(body, now_, x, v) && !is_inside(body, before_, from, v);
      return enters ? 1.0 : 0.0;
    });
    if (enter > 0) return true;
  }
  return false;
}

/// All shapes are convex, so the distance along a straight way is a convex function: Newton from
/// outside never passes its first zero, and what moves along a face or away from it is free at
/// once.
double Bodies::free_part(int body, const Vec3& from, const Vec3& way,
                         const Eigen::Isometry3d& pose) const {
  constexpr int kMaxSteps = 64;
  const auto& collider = colliders_[at(body)];
  colliders::SignedDistance now = collider.signed_distance(from, pose);
  const double touching = kTouching * now.distance;
  if (!(now.distance > 0) || way.norm() <= now.distance - touching) return 1;
  double t = 0;
  for (int k = 0; k < kMaxSteps && now.distance > touching; ++k) {
    const double closing = -now.normal.dot(way);
    if (!(closing > 0)) return 1;
    t += now.distance / closing;
    if (t >= 1) break;
    now = collider.signed_distance(from + t * way, pose);
  }
  if (t >= 1 && collider.signed_distance(from + way, pose).distance > touching) return 1;
  const double part = kApproach * std::min(t, 1.0);
  return collider.signed_distance(from + part * way, pose).distance > 0 ? part : 0;
}

/// Cutting a way short would also end its sliding: rather beside the body where it would be in it,
/// if the way there is free.
Vec3 Bodies::beside(int body, const Vec3& from, const Vec3& way, double part) const {
  const auto there = colliders_[at(body)].signed_distance(from + way, now_[at(body)]);
  const double missing = kBeside * distance(body) - there.distance;
  const Vec3 pushed = way + missing * there.normal;
  if (free_part(body, from, pushed, now_[at(body)]) == 1) return from + pushed;
  return from + part * way;
}

void Bodies::move(double part, const Positions& from, const std::vector<char>& held, Positions& x) {
  before_ = now_;
  part_before_ = part_;
  place(part == 1 ? 1 : part_ + part * (1 - part_));
  for (int body = 0; body < static_cast<int>(colliders_.size()); ++body) {
    const Eigen::Isometry3d& pose = now_[at(body)];
    const Eigen::Isometry3d carry = pose * before_[at(body)].inverse();
    parallel_for(at(static_cast<int>(x.rows())), [&](std::size_t v) {
      if (held[v]) return;
      const auto row = static_cast<Eigen::Index>(v);
      // In the frame of the body where it is now.
      const Vec3 begin = carry * Vec3(from.row(row).transpose());
      const Vec3 way = x.row(row).transpose() - begin;
      const double free = free_part(body, begin, way, pose);
      if (free < 1) x.row(row) = beside(body, begin, way, free).transpose();
    });
  }
}

bool Bodies::limit(const Positions& from, const std::vector<char>& held, Positions& to) const {
  double shortened = 0;
  for (int body = 0; body < static_cast<int>(colliders_.size()); ++body)
    shortened += parallel_sum<double>(at(static_cast<int>(to.rows())), [&](std::size_t v) {
      if (held[v]) return 0.0;
      const auto row = static_cast<Eigen::Index>(v);
      const Vec3 begin = from.row(row).transpose();
      const Vec3 way = to.row(row).transpose() - begin;
      const double part = free_part(body, begin, way, now_[at(body)]);
      if (part == 1) return 0.0;
      to.row(row) = (begin + part * way).transpose();
      return 1.0;
    });
  return shortened > 0;
}

void Bodies::list(const Positions& x, double slack) {
  near_.clear();
  const auto count = at(static_cast<int>(x.rows()));
  for (int body = 0; body < static_cast<int>(colliders_.size()); ++body) {
    const double reach = distance(body) + 2 * slack;
    blocks_.resize((count + kVerticesPerBlock - 1) / kVerticesPerBlock);
    parallel_for(
        blocks_.size(),
        [&](std::size_t block) {
          blocks_[block].clear();
          const std::size_t end = std::min(count, (block + 1) * kVerticesPerBlock);
          for (std::size_t v = block * kVerticesPerBlock; v < end; ++v) {
            const Vec3 p = x.row(static_cast<Eigen::Index>(v)).transpose();
            const double d = colliders_[at(body)].signed_distance(p, now_[at(body)]).distance;
            if (d < reach) blocks_[block].push_back({static_cast<int>(v), body, !(d > 0)});
          }
        },
        1);
    for (const auto& block : blocks_) near_.insert(near_.end(), block.begin(), block.end());
  }
}

int Bodies::count_inside(const Positions& x) const {
  double count = 0;
  for (int body = 0; body < static_cast<int>(colliders_.size()); ++body)
    count += parallel_sum<double>(at(static_cast<int>(x.rows())), [&](std::size_t v) {
      return is_inside(body, end_, x, v) ? 1.0 : 0.0;
    });
  return static_cast<int>(count);
}

void Bodies::activate(const Positions& x, std::vector<ActivePair>& active) const {
  for (const NearBody& near : near_) {
    const auto& collider = colliders_[at(near.body)];
    const auto at_vertex =
        collider.signed_distance(x.row(near.vertex).transpose(), now_[at(near.body)]);
    Activation activation = activation_;
    activation.distance = distance(near.body);
    if (!(at_vertex.distance < activation.distance)) continue;
    if (near.inside || !(at_vertex.distance > 0)) activation.barrier = Barrier::None;
    const ActivationValue b = activation(at_vertex.distance);
    ActivePair pair;
    pair.vertices = {near.vertex, near.body, -1, -1};
    pair.count = 1;
    pair.beta = {1, 0, 0, 0};
    pair.normal = at_vertex.normal;
    pair.energy = b.energy;
    pair.pressure = -b.slope;
    pair.curvature = b.curvature;
    pair.gradient.fill(Vec3::Zero());
    pair.gradient[0] = b.slope * at_vertex.normal;
    pair.friction = collider.traits().friction.value_or(friction_.value_or(colliders::Friction{}));
    active.push_back(pair);
  }
}

Vec3 Bodies::unslid(const ActivePair& pair, const Vec3& previous) const {
  const auto body = at(pair.vertices[1]);
  return end_[body] * (begin_[body].inverse() * previous);
}

}  // namespace piecework::contact
