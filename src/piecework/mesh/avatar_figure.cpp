#include <piecework/mesh/avatar_figure.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <span>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include <piecework/core/error.hpp>
#include <piecework/mesh/assimp_guard.hpp>
#include <piecework/mesh/avatar_file.hpp>
#include <piecework/mesh/checks.hpp>
#include <piecework/mesh/input_file.hpp>
#include <piecework/mesh/polygon.hpp>

namespace piecework::mesh {
namespace {

/// A bind matrix is singular if its determinant is below this fraction of the cube of its norm: it
/// would flatten the figure to float precision. Chosen.
constexpr double kSingular = 1e-9;

/// A quaternion shorter than this has no direction left in float precision. Chosen.
constexpr double kShortestTurn = 1e-3;

/// Vertices move alike if no weight differs by more than this. Chosen: weights of 8 bits are 4e-3
/// apart.
constexpr double kSameWeight = 1e-3;

/// Sums of weights that are further from 1 than rounding of the file are worth a note. Chosen.
constexpr double kWeightNote = 1e-2;

Affine affine(const double* rows) {
  Affine result;
  result.matrix() =
      Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(rows).topRows<3>();
  return result;
}

/// The nearest scale, turn and move; of a mirroring transform the first scale is negative.
Pose decompose(const Affine& transform) {
  const Mat3& linear = transform.linear();
  Vec3 scale = linear.colwise().norm().transpose();
  if (linear.determinant() < 0) scale.x() = -scale.x();
  Mat3 turn;
  for (Eigen::Index k = 0; k < 3; ++k)
    turn.col(k) = scale[k] != 0 ? Vec3(linear.col(k) / scale[k]) : Vec3(Vec3::Unit(k));
  return {transform.translation(), Eigen::Quaterniond(turn).normalized(), scale};
}

Affine world_transform(const AvatarOptions& options) {
  Mat3 turn = Mat3::Identity();
  if (options.up_axis == UpAxis::X) turn << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  if (options.up_axis == UpAxis::Z) turn << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  Affine world = Affine::Identity();
  world.linear() = options.unit_in_metres * turn;
  return world;
}

std::vector<std::string> lines(std::string_view text) {
  std::vector<std::string> result;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    result.emplace_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return result;
}

class FigureBuilder {
 public:
  explicit FigureBuilder(AvatarFile file)
      : file_(std::move(file)), names_(lines(file_.node_names)) {}

  AvatarFigure run(const AvatarOptions& options) {
    out_.world = world_transform(options);
    out_.notes = lines(file_.notes);
    out_.lead_in = options.lead_in;
    out_.lead = options.lead;
    add_nodes();
    add_clip(options);
    add_bindings();
    add_weights();
    weld();
    add_triangles();
    drop_unused();
    return std::move(out_);
  }

 private:
  [[noreturn]] void fail(const std::string& problem, const char* remedy = kExportAgain) const {
    throw InputError(fmt::format("{}: {}; {}", file_.file, problem, remedy));
  }

  void add_nodes() {
    out_.parent = file_.node_parent;
    for (std::size_t n = 0; n < out_.parent.size(); ++n) {
      out_.local.push_back(affine(&file_.node_local[16 * n]));
      if (!out_.local.back().matrix().allFinite())
        fail(fmt::format("the transform of node '{}' is not finite", names_[n]));
    }
  }

  void add_clip(const AvatarOptions& options) {
    if (file_.duration.empty()) return;
    out_.clip = file_.clip;
    out_.duration = file_.duration.front();
    out_.start_time = options.start_time;
    if (!(options.start_time <= out_.duration))
      fail(fmt::format("the clip \"{}\" lasts {:.4g} s, it cannot start at {:.4g} s", out_.clip,
                       out_.duration, options.start_time),
           "start earlier");
    for (std::size_t track = 0; track < file_.track_node.size(); ++track) {
      const int node = file_.track_node[track];
      AnimatedNode& animated = out_.animated.emplace_back();
      animated.node = node;
      animated.bind = decompose(out_.local[static_cast<std::size_t>(node)]);
      read_track(file_.moves, track, "position", animated.move,
                 [](const auto& v) { return Vec3(v.template head<3>()); });
      read_track(file_.scales, track, "scale", animated.scale,
                 [](const auto& v) { return Vec3(v.template head<3>()); });
      read_track(file_.turns, track, "rotation", animated.turn, [](const auto& v) {
        return Eigen::Quaterniond(v[0], v[1], v[2], v[3]).normalized();
      });
    }
  }

  template <class Value, class Convert>
  void read_track(const AvatarKeys& keys, std::size_t track, const char* kind, Track<Value>& out,
                  const Convert& convert) const {
    const auto first = static_cast<std::size_t>(keys.begin[track]);
    const auto last = static_cast<std::size_t>(keys.begin[track + 1]);
    for (std::size_t k = first; k < last; ++k) {
      const auto item = [&] {
        return fmt::format("clip \"{}\": {} key {} of '{}'", out_.clip, kind, k - first,
                           names_[static_cast<std::size_t>(file_.track_node[track])]);
      };
      if (!std::isfinite(keys.time[k]) || !keys.value[k].allFinite())
        fail(item() + " is not finite");
      if (k > first && !(keys.time[k] > keys.time[k - 1]))
        fail(fmt::format("{} at {:.6g} s does not come after the one before it, at {:.6g} s",
                         item(), keys.time[k], keys.time[k - 1]));
      if (&keys == &file_.turns && keys.value[k].norm() < kShortestTurn)
        fail(fmt::format("{} is a quaternion of length {:.3g}, not 1", item(),
                         keys.value[k].norm()));
      out.time.push_back(keys.time[k]);
      out.value.push_back(convert(keys.value[k]));
    }
  }

  int binding(int node, const Affine& offset) {
    for (std::size_t b = 0; b < out_.binding.size(); ++b)
      if (out_.binding[b].node == node && out_.binding[b].offset.matrix() == offset.matrix())
        return static_cast<int>(b);
    out_.binding.push_back({node, offset});
    return static_cast<int>(out_.binding.size()) - 1;
  }

  void add_bindings() {
    for (std::size_t j = 0; j < file_.joint_node.size(); ++j) {
      const Affine offset = affine(&file_.joint_offset[16 * j]);
      const double norm = offset.linear().norm();
      const std::string& name = names_[static_cast<std::size_t>(file_.joint_node[j])];
      if (!offset.matrix().allFinite())
        fail(fmt::format("the bind matrix of joint '{}' is not finite", name));
      if (!(std::abs(offset.linear().determinant()) > kSingular * norm * norm * norm))
        fail(fmt::format("the bind matrix of joint '{}' is singular", name));
      joint_binding_.push_back(binding(file_.joint_node[j], offset));
    }
  }

  /// Per vertex of the file: its influences, by binding, with a sum of 1.
  void add_weights() {
    influences_.resize(file_.positions.size());
    for (std::size_t i = 0; i < file_.weight.size(); ++i) {
      const double weight = file_.weight[i];
      if (!std::isfinite(weight) || weight < 0)
        fail(fmt::format("vertex {}: a weight of {}", file_.weight_vertex[i], weight));
      const auto joint = static_cast<std::size_t>(file_.weight_joint[i]);
      if (weight > 0)
        influences_[static_cast<std::size_t>(file_.weight_vertex[i])].push_back(
            {joint_binding_[joint], weight});
    }
    int scaled = 0, lost = 0;
    for (std::size_t v = 0; v < influences_.size(); ++v) {
      std::vector<Influence>& list = influences_[v];
      if (list.empty()) lost += bind_unweighted(v) ? 1 : 0;
      std::sort(list.begin(), list.end(),
                [](const Influence& a, const Influence& b) { return a.binding < b.binding; });
      double sum = 0;
      for (const Influence& influence : list) sum += influence.weight;
      for (Influence& influence : list) influence.weight /= sum;
      scaled += std::abs(sum - 1) > kWeightNote ? 1 : 0;
    }
    if (scaled > 0)
      out_.notes.push_back(fmt::format("scaled the weights of {} vertices to a sum of 1", scaled));
    if (lost > 0)
      out_.notes.push_back(
          fmt::format("{} vertices without weights follow the nearest joint", lost));
  }

  /// A vertex without weights: to its node if its mesh has no joints, else to the joint whose
  /// origin as bound is nearest. Returns whether it had to be the latter.
  bool bind_unweighted(std::size_t v) {
    int nearest = -1;
    double best = 0;
    for (std::size_t j = 0; j < file_.joint_node.size(); ++j) {
      if (file_.joint_mesh[j] != file_.vertex_mesh[v]) continue;
      const int candidate = joint_binding_[j];
      const Affine& offset = out_.binding[static_cast<std::size_t>(candidate)].offset;
      const Vec3 origin = -offset.linear().inverse() * offset.translation();
      const double distance = (origin - file_.positions[v]).norm();
      if (nearest >= 0 && !(distance < best)) continue;
      nearest = candidate;
      best = distance;
    }
    const bool has_joints = nearest >= 0;
    if (!has_joints) nearest = binding(file_.vertex_node[v], Affine::Identity());
    influences_[v].push_back({nearest, 1.0});
    return has_joints;
  }

  [[nodiscard]] bool move_alike(std::size_t v, std::size_t w) const {
    return std::equal(influences_[v].begin(), influences_[v].end(), influences_[w].begin(),
                      influences_[w].end(), [](const Influence& a, const Influence& b) {
                        return a.binding == b.binding &&
                               std::abs(a.weight - b.weight) <= kSameWeight;
                      });
  }

  void weld() {
    std::map<std::array<double, 3>, std::vector<int>> at;
    std::vector<int> kept;  // vertex of the file, per vertex
    for (std::size_t v = 0; v < file_.positions.size(); ++v) {
      const Vec3& p = file_.positions[v];
      if (!p.allFinite()) fail(fmt::format("vertex {} is not at a finite position", v));
      if (p.lpNorm<Eigen::Infinity>() > kMaxCoordinate)
        fail(fmt::format("vertex {} is more than {:g} units from the origin", v, kMaxCoordinate));
      std::vector<int>& here = at[{p.x() + 0.0, p.y() + 0.0, p.z() + 0.0}];  // -0 is 0
      const auto same = std::find_if(here.begin(), here.end(), [&](int w) {
        return move_alike(v, static_cast<std::size_t>(kept[static_cast<std::size_t>(w)]));
      });
      if (same == here.end()) {
        here.push_back(static_cast<int>(kept.size()));
        out_.vertex_map.push_back(here.back());
        kept.push_back(static_cast<int>(v));
      } else {
        out_.vertex_map.push_back(*same);
      }
    }
    out_.begin.push_back(0);
    for (const int v : kept) {
      const std::vector<Influence>& list = influences_[static_cast<std::size_t>(v)];
      out_.place.push_back(file_.positions[static_cast<std::size_t>(v)]);
      out_.influence.insert(out_.influence.end(), list.begin(), list.end());
      out_.begin.push_back(static_cast<int>(out_.influence.size()));
    }
  }

  void add_triangles() {
    const std::vector<Affine> bound = binding_transforms(out_, out_.local);
    int dropped = 0;
    for (std::size_t p = 0; p + 1 < file_.polygon_begin.size(); ++p) {
      const std::span<const int> polygon(file_.polygon_vertex.data() + file_.polygon_begin[p],
                                         file_.polygon_vertex.data() + file_.polygon_begin[p + 1]);
      std::vector<Vec3> corners;
      for (const int v : polygon) corners.push_back(file_.positions[static_cast<std::size_t>(v)]);
      Triangles triangles;
      triangulate_polygon(corners, triangles);
      const auto first = static_cast<std::size_t>(polygon.front());
      const auto leader = static_cast<std::size_t>(influences_[first].front().binding);
      const bool mirrored = bound[leader].linear().determinant() < 0;
      for (const Triangle& t : triangles) {
        Triangle welded;
        for (std::size_t k = 0; k < 3; ++k)
          welded[k] = out_.vertex_map[static_cast<std::size_t>(
              polygon[static_cast<std::size_t>(t[mirrored ? 2 - k : k])])];
        const bool flat =
            welded[0] == welded[1] || welded[1] == welded[2] || welded[2] == welded[0];
        dropped += flat ? 1 : 0;
        if (!flat) out_.triangles.push_back(welded);
      }
    }
    if (dropped > 0)
      out_.notes.push_back(fmt::format("dropped {} triangles whose corners coincide", dropped));
    if (out_.triangles.empty()) fail("no triangle has three different corners");
  }

  /// Vertices that no triangle uses would be obstacles that nobody sees.
  void drop_unused() {
    std::vector<int> number(out_.place.size(), -1);
    for (const Triangle& t : out_.triangles)
      for (const int v : t) number[static_cast<std::size_t>(v)] = 0;
    AvatarFigure kept;
    kept.begin.push_back(0);
    for (std::size_t v = 0; v < number.size(); ++v) {
      if (number[v] < 0) continue;
      number[v] = static_cast<int>(kept.place.size());
      kept.place.push_back(out_.place[v]);
      kept.influence.insert(kept.influence.end(), out_.influence.begin() + out_.begin[v],
                            out_.influence.begin() + out_.begin[v + 1]);
      kept.begin.push_back(static_cast<int>(kept.influence.size()));
    }
    for (Triangle& t : out_.triangles)
      for (int& v : t) v = number[static_cast<std::size_t>(v)];
    for (int& v : out_.vertex_map) v = number[static_cast<std::size_t>(v)];
    out_.place = std::move(kept.place);
    out_.influence = std::move(kept.influence);
    out_.begin = std::move(kept.begin);
  }

  AvatarFile file_;
  std::vector<std::string> names_;
  AvatarFigure out_;
  std::vector<int> joint_binding_;
  std::vector<std::vector<Influence>> influences_;
};

void check_options(const std::filesystem::path& path, const AvatarOptions& options) {
  if (!std::isfinite(options.unit_in_metres) || !(options.unit_in_metres > 0))
    throw InputError(fmt::format(
        "{}: units: {} metres per unit; give a positive number, 0.01 for a file in centimetres",
        path.string(), options.unit_in_metres));
  if (!std::isfinite(options.start_time) || options.start_time < 0 ||
      !std::isfinite(options.lead_in) || options.lead_in < 0)
    throw InputError(fmt::format("{}: start_time {} s and lead_in {} s; give times from 0 up",
                                 path.string(), options.start_time, options.lead_in));
}

}  // namespace

AvatarFigure make_figure(const std::filesystem::path& path, const AvatarOptions& options) {
  check_options(path, options);
  const std::string extension = lower_extension(path);
  if (extension != ".gltf" && extension != ".glb" && extension != ".fbx")
    throw InputError(
        fmt::format("{}: unknown kind of avatar file '{}'; convert it to .glb, .gltf or .fbx",
                    path.string(), extension));
  check_file(path);
  const std::size_t most = std::min(options.max_triangles, kMaxTriangles);
  return FigureBuilder(read_avatar_file(path, extension, options.clip, most)).run(options);
}

}  // namespace piecework::mesh
