#include <piecework/mesh/avatar.hpp>

#include <algorithm>
#include <utility>

#include <piecework/core/parallel.hpp>
#include <piecework/mesh/avatar_figure.hpp>

namespace piecework::mesh {
namespace {

/// Value of one track at a time. `mix`: (a, b, share) -> value in between.
template <class Value, class Mix>
Value sample(const Track<Value>& track, double time, const Value& otherwise, const Mix& mix) {
  if (track.time.empty()) return otherwise;
  const auto later = std::upper_bound(track.time.begin(), track.time.end(), time);
  const auto after = static_cast<std::size_t>(later - track.time.begin());
  if (after == 0) return track.value.front();
  if (after == track.time.size()) return track.value.back();
  const double t0 = track.time[after - 1], t1 = track.time[after];
  return mix(track.value[after - 1], track.value[after], (time - t0) / (t1 - t0));
}

Vec3 mix_vectors(const Vec3& a, const Vec3& b, double share) { return a + share * (b - a); }

Eigen::Quaterniond mix_turns(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b,
                             double share) {
  return a.slerp(share, b);  // the shorter way
}

Pose pose_at(const AnimatedNode& node, double time) {
  return {sample(node.move, time, node.bind.move, mix_vectors),
          sample(node.turn, time, node.bind.turn, mix_turns),
          sample(node.scale, time, node.bind.scale, mix_vectors)};
}

Pose mix_poses(const Pose& a, const Pose& b, double share) {
  return {mix_vectors(a.move, b.move, share), mix_turns(a.turn, b.turn, share),
          mix_vectors(a.scale, b.scale, share)};
}

Affine transform(const Pose& pose) {
  Affine result;
  result.linear() = pose.turn.toRotationMatrix() * pose.scale.asDiagonal();
  result.translation() = pose.move;
  return result;
}

/// Starts and ends at rest, so that the garment is not jerked [smoothstep].
double ease(double share) { return share * share * (3 - 2 * share); }

/// To the parent's coordinates, per node.
std::vector<Affine> locals_at(const AvatarFigure& figure, double time) {
  std::vector<Affine> locals = figure.local;
  const double lead = figure.lead_in;
  const bool leading = time < lead;
  const double clip_time = figure.start_time + (leading ? 0 : time - lead);
  for (const AnimatedNode& node : figure.animated) {
    Pose pose = pose_at(node, clip_time);
    if (leading && figure.lead == AvatarLead::BindPose)
      pose = mix_poses(node.bind, pose, ease(std::max(0.0, time) / lead));
    locals[static_cast<std::size_t>(node.node)] = transform(pose);
  }
  return locals;
}

void skin(const AvatarFigure& figure, const std::vector<Affine>& locals, Positions& x) {
  const std::vector<Affine> bindings = binding_transforms(figure, locals);
  x.resize(static_cast<Eigen::Index>(figure.place.size()), 3);
  parallel_for(figure.place.size(), [&](std::size_t v) {
    Vec3 sum = Vec3::Zero();
    for (int i = figure.begin[v]; i < figure.begin[v + 1]; ++i) {
      const Influence& influence = figure.influence[static_cast<std::size_t>(i)];
      const Affine& binding = bindings[static_cast<std::size_t>(influence.binding)];
      sum += influence.weight * (binding * figure.place[v]);
    }
    x.row(static_cast<Eigen::Index>(v)) = sum.transpose();
  });
}

}  // namespace

std::vector<Affine> binding_transforms(const AvatarFigure& figure,
                                       const std::vector<Affine>& locals) {
  std::vector<Affine> global(locals.size());
  for (std::size_t n = 0; n < locals.size(); ++n) {
    const int parent = figure.parent[n];
    global[n] = parent < 0 ? figure.world * locals[n]
                           : global[static_cast<std::size_t>(parent)] * locals[n];
  }
  std::vector<Affine> bindings;
  for (const Binding& binding : figure.binding)
    bindings.push_back(global[static_cast<std::size_t>(binding.node)] * binding.offset);
  return bindings;
}

struct Avatar::Figure : AvatarFigure {};

Avatar::Avatar(std::unique_ptr<const Figure> figure) : figure_(std::move(figure)) {}
Avatar::Avatar(Avatar&&) noexcept = default;
Avatar& Avatar::operator=(Avatar&&) noexcept = default;
Avatar::~Avatar() = default;

const Triangles& Avatar::triangles() const { return figure_->triangles; }
int Avatar::num_vertices() const { return static_cast<int>(figure_->place.size()); }
const std::vector<int>& Avatar::vertex_map() const { return figure_->vertex_map; }
bool Avatar::moves() const { return !figure_->animated.empty(); }
double Avatar::duration() const { return figure_->duration; }
const std::string& Avatar::clip() const { return figure_->clip; }
const std::vector<std::string>& Avatar::notes() const { return figure_->notes; }

void Avatar::positions_at(double time, Positions& x) const {
  skin(*figure_, locals_at(*figure_, time), x);
}

void Avatar::bind_pose(Positions& x) const { skin(*figure_, figure_->local, x); }

Avatar import_avatar(const std::filesystem::path& path, const AvatarOptions& options) {
  return Avatar(std::make_unique<const Avatar::Figure>(Avatar::Figure{make_figure(path, options)}));
}

}  // namespace piecework::mesh
