#include <renderer/display_mesh.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <unordered_map>

#include <renderer/creases.hpp>

#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>

namespace piecework::render {
namespace {

constexpr std::size_t kMaxSplitTriangles = 300'000;  // splitting never makes a mesh larger

constexpr std::size_t kMaxBodyTriangles = 200'000;
constexpr float kCrease = 35.0F;  // degrees; chosen: edges of low polyhedra and of boxes are sharp

void check_triangles(std::span<const Triangle> triangles, Eigen::Index num_vertices,
                     const std::string& what) {
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (int v : triangles[t]) {
      if (v < 0 || v >= num_vertices) {
        throw InputError(what + ": triangle " + std::to_string(t) + ": vertex " +
                         std::to_string(v) + " does not exist; there are " +
                         std::to_string(num_vertices));
      }
    }
  }
}

void check_finite(const Positions& positions, const std::string& what, const char* cause) {
  if (positions.allFinite()) return;
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    if (positions.row(v).allFinite()) continue;
    throw InputError(what + ": vertex " + std::to_string(v) +
                     ": position is not a finite number; " + cause);
  }
}

void check_bodies(std::span<const Body> bodies) {
  for (const Body& body : bodies) {
    const std::string what = "frame: body " + std::to_string(&body - bodies.data());
    check_triangles(body.triangles, body.positions != nullptr ? body.positions->rows() : 0, what);
    if (body.positions != nullptr) check_finite(*body.positions, what, "look at its motion");
  }
}

struct Extent {
  Vec3 low, high;

  explicit Extent(const Positions& x)
      : low(x.colwise().minCoeff().transpose()), high(x.colwise().maxCoeff().transpose()) {}
  /// With what of `other` is nearer than `reach`, axis by axis.
  void include(const Extent& other, double reach) {
    const Vec3 far_low = low.array() - reach;
    const Vec3 far_high = high.array() + reach;
    if ((other.low.array() > far_high.array()).any()) return;
    if ((other.high.array() < far_low.array()).any()) return;
    low = low.cwiseMin(other.low.cwiseMax(far_low));
    high = high.cwiseMax(other.high.cwiseMin(far_high));
  }
};

/// The box [low, high] of the picture, m. \pre the frame has something to draw
Extent extent_of(const Frame& frame) {
  if (frame.triangles.empty()) {
    Extent all(*frame.bodies.front().positions);
    for (const Body& body : frame.bodies)
      all.include(Extent(*body.positions), std::numeric_limits<double>::infinity());
    return all;
  }
  const Extent cloth(*frame.positions);
  Extent all = cloth;
  for (const Body& body : frame.bodies) {
    Extent near = cloth;
    near.include(Extent(*body.positions), (cloth.high - cloth.low).norm());
    all.include(near, std::numeric_limits<double>::infinity());
  }
  return all;
}

void set_units(DisplayMesh& mesh, const Extent& extent) {
  const auto& [low, high] = extent;
  mesh.centre = low / 2 + high / 2;
  const double half_diagonal = (high / 2 - low / 2).norm();
  if (!std::isfinite(half_diagonal)) {
    throw InputError("frame: the positions are too far apart to be drawn");
  }
  mesh.scale = half_diagonal > 0 ? 1.0 / half_diagonal : 1.0;
  if (!std::isfinite(mesh.scale)) mesh.scale = 1.0;
  mesh.low = mesh.to_display(low).cast<float>();
  mesh.high = mesh.to_display(high).cast<float>();
}

/// \pre set_units()
void set_surface(DisplayMesh& mesh, const Positions& positions,
                 std::span<const Triangle> triangles) {
  mesh.positions.resize(static_cast<std::size_t>(positions.rows()));
  parallel_for(mesh.positions.size(), [&](std::size_t v) {
    const Vec3 p = positions.row(static_cast<Eigen::Index>(v)).transpose();
    mesh.positions[v] = mesh.to_display(p).cast<float>();
  });
  mesh.triangles.assign(triangles.begin(), triangles.end());
  mesh.source.resize(mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.source.size(); ++t) mesh.source[t] = static_cast<int>(t);
}

/// Area-weighted vertex normals. Where the faces around a vertex cancel (triangles wound in
/// opposite directions), the largest face alone decides.
void set_normals(DisplayMesh& mesh) {
  const Adjacency adjacency = build_adjacency(mesh.triangles, mesh.positions.size());
  std::vector<Vec3f> face(mesh.triangles.size());
  parallel_for(face.size(), [&](std::size_t t) {
    const auto [a, b, c] = mesh.triangles[t];
    face[t] = (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]);
  });
  mesh.normals.resize(mesh.positions.size());
  parallel_for(mesh.normals.size(), [&](std::size_t v) {
    Vec3f sum = Vec3f::Zero();
    Vec3f largest = Vec3f::Zero();
    float total = 0;
    for (int t : adjacency.around(static_cast<int>(v))) {
      sum += face[t];
      total += face[t].norm();
      if (face[t].squaredNorm() > largest.squaredNorm()) largest = face[t];
    }
    const Vec3f& normal = sum.norm() > 0.02F * total ? sum : largest;
    const float length = normal.norm();
    mesh.normals[v] = length > 0 ? Vec3f(normal / length) : Vec3f(0, 1, 0);
  });
}

/// One round of splitting. Finds the midpoints of long edges, then cuts each triangle by how many
/// of its edges have one.
class EdgeSplitter {
 public:
  EdgeSplitter(DisplayMesh& mesh, float longest_edge) : mesh_(mesh), longest_(longest_edge) {}

  /// False if no edge was too long.
  bool run() {
    const std::size_t count = mesh_.triangles.size();
    triangles_.reserve(count);
    for (std::size_t t = 0; t < count; ++t) cut(t);
    if (midpoints_.empty()) return false;
    mesh_.triangles.swap(triangles_);
    mesh_.source.swap(source_);
    return true;
  }

 private:
  bool is_long(int a, int b) const {
    return (mesh_.positions[a] - mesh_.positions[b]).squaredNorm() > longest_ * longest_;
  }

  int midpoint(int a, int b) {
    const auto key = (static_cast<std::uint64_t>(std::min(a, b)) << 32U) |
                     static_cast<std::uint64_t>(std::max(a, b));
    const auto [entry, is_new] = midpoints_.try_emplace(key, 0);
    if (is_new) {
      entry->second = static_cast<int>(mesh_.positions.size());
      const Vec3f position = 0.5F * (mesh_.positions[a] + mesh_.positions[b]);
      Vec3f normal = mesh_.normals[a] + mesh_.normals[b];
      const float length = normal.norm();
      normal = length > 1e-3F ? Vec3f(normal / length) : mesh_.normals[std::min(a, b)];
      mesh_.positions.push_back(position);
      mesh_.normals.push_back(normal);
    }
    return entry->second;
  }

  void emit(std::size_t t, const Triangle& corners) {
    triangles_.push_back(corners);
    source_.push_back(mesh_.source[t]);
  }

  void cut(std::size_t t) {
    Triangle v = mesh_.triangles[t];
    std::array<bool, 3> split{};
    for (std::size_t i = 0; i < 3; ++i) split[i] = is_long(v[i], v[(i + 1) % 3]);
    const auto count = std::count(split.begin(), split.end(), true);
    if (count == 0) {
      emit(t, v);
      return;
    }
    // Turn the triangle so that edge 0 is the only split one, or edge 2 the only whole one.
    while ((count == 1 && !split[0]) || (count == 2 && split[2])) {
      std::rotate(v.begin(), v.begin() + 1, v.end());
      std::rotate(split.begin(), split.begin() + 1, split.end());
    }
    const auto [a, b, c] = v;
    const int ab = midpoint(a, b);
    if (count == 1) {
      emit(t, {a, ab, c});
      emit(t, {ab, b, c});
      return;
    }
    const int bc = midpoint(b, c);
    emit(t, {ab, b, bc});
    if (count == 2) {
      emit(t, {a, ab, bc});
      emit(t, {a, bc, c});
      return;
    }
    const int ca = midpoint(c, a);
    emit(t, {a, ab, ca});
    emit(t, {ca, bc, c});
    emit(t, {ab, bc, ca});
  }

  DisplayMesh& mesh_;
  float longest_;
  std::unordered_map<std::uint64_t, int> midpoints_;
  std::vector<Triangle> triangles_;
  std::vector<int> source_;
};

/// Triangles that splitting at `longest` would leave, roughly.
double estimated_triangles(const DisplayMesh& mesh, float longest) {
  const double part = 0.3 * static_cast<double>(longest) * static_cast<double>(longest);
  double sum = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3f normal =
        (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]);
    sum += std::max(1.0, 0.5 * static_cast<double>(normal.norm()) / part);
  }
  return sum;
}

bool has_long_edge(const DisplayMesh& mesh, float longest) {
  const float limit = longest * longest;
  return std::any_of(mesh.triangles.begin(), mesh.triangles.end(), [&](const Triangle& v) {
    for (std::size_t i = 0; i < 3; ++i) {
      const Vec3f edge = mesh.positions[v[i]] - mesh.positions[v[(i + 1) % 3]];
      if (edge.squaredNorm() > limit) return true;
    }
    return false;
  });
}

void append_body(const Body& body, float longest_edge, DisplayMesh& mesh) {
  DisplayMesh part;
  part.centre = mesh.centre;
  part.scale = mesh.scale;
  set_surface(part, *body.positions, body.triangles);
  split_at_creases(part, kCrease);
  set_normals(part);
  split_long_edges(part, longest_edge, kMaxBodyTriangles);
  const int first = static_cast<int>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), part.positions.begin(), part.positions.end());
  mesh.normals.insert(mesh.normals.end(), part.normals.begin(), part.normals.end());
  for (const auto& [a, b, c] : part.triangles)
    mesh.triangles.push_back({first + a, first + b, first + c});
}

}  // namespace

Adjacency build_adjacency(std::span<const Triangle> triangles, std::size_t num_vertices) {
  Adjacency result;
  result.offset.assign(num_vertices + 1, 0);
  for (const Triangle& triangle : triangles) {
    for (int v : triangle) ++result.offset[v + 1];
  }
  for (std::size_t v = 0; v < num_vertices; ++v) result.offset[v + 1] += result.offset[v];
  std::vector<int> next(result.offset.begin(), result.offset.end() - 1);
  result.triangle.resize(3 * triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (int v : triangles[t]) result.triangle[next[v]++] = static_cast<int>(t);
  }
  return result;
}

void split_long_edges(DisplayMesh& mesh, float longest_edge, std::size_t max_triangles) {
  if (!(longest_edge > 0) || !has_long_edge(mesh, longest_edge)) return;
  float longest = longest_edge;
  while (estimated_triangles(mesh, longest) > static_cast<double>(max_triangles)) {
    longest *= 1.25F;
    if (longest > 2.0F) return;  // finer than this everywhere already
  }
  constexpr int kMaxRounds = 9;  // 2 display units / 2^9 is below any useful edge length
  for (int round = 0; round < kMaxRounds && mesh.triangles.size() < max_triangles; ++round) {
    if (!EdgeSplitter(mesh, longest).run()) return;
  }
}

DisplayMesh build_display_mesh(const Frame& frame, float longest_edge) {
  const bool has_positions = frame.positions != nullptr && frame.positions->rows() > 0;
  check_triangles(frame.triangles, has_positions ? frame.positions->rows() : 0, "frame");
  if (has_positions)
    check_finite(*frame.positions, "frame", "the simulation has probably diverged");
  check_bodies(frame.bodies);
  DisplayMesh mesh;
  const auto is_empty = [](const Body& body) { return body.triangles.empty(); };
  if (std::any_of(frame.bodies.begin(), frame.bodies.end(), is_empty))
    throw InputError("frame: a body has no triangles");
  if (frame.triangles.empty() && frame.bodies.empty()) return mesh;
  set_units(mesh, extent_of(frame));
  if (!frame.triangles.empty()) {
    set_surface(mesh, *frame.positions, frame.triangles);
    mesh.num_frame_vertices = mesh.positions.size();
    set_normals(mesh);
    split_long_edges(mesh, longest_edge, kMaxSplitTriangles);
  }
  for (const Body& body : frame.bodies) append_body(body, longest_edge, mesh);
  return mesh;
}

}  // namespace piecework::render
