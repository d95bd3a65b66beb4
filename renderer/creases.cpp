#include <renderer/creases.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace piecework::render {
namespace {

class CreaseSplitter {
 public:
  CreaseSplitter(DisplayMesh& mesh, float degrees)
      : mesh_(mesh),
        old_(mesh.triangles),
        adjacency_(build_adjacency(old_, mesh.positions.size())),
        cosine_(std::cos(degrees * std::numbers::pi_v<float> / 180.0F)) {
    for (const auto& [a, b, c] : old_) {
      const Vec3f& p = mesh.positions[a];
      normals_.push_back((mesh.positions[b] - p).cross(mesh.positions[c] - p));
    }
  }

  void run() {
    const int count = static_cast<int>(mesh_.positions.size());
    for (int v = 0; v < count; ++v) split(v);
  }

 private:
  [[nodiscard]] bool is_smooth(int s, int t) const {
    return normals_[s].dot(normals_[t]) >= cosine_ * normals_[s].norm() * normals_[t].norm();
  }

  /// Both triangles have `vertex` and one more.
  [[nodiscard]] bool share_edge(int vertex, int s, int t) const {
    return std::any_of(old_[s].begin(), old_[s].end(), [&](int v) {
      return v != vertex && std::find(old_[t].begin(), old_[t].end(), v) != old_[t].end();
    });
  }

  void split(int vertex) {
    const std::span<const int> around = adjacency_.around(vertex);
    left_.assign(around.begin(), around.end());
    for (bool first = true; !left_.empty(); first = false) {
      int own = vertex;
      if (!first) {
        own = static_cast<int>(mesh_.positions.size());
        mesh_.positions.push_back(Vec3f(mesh_.positions[vertex]));
      }
      take_part(vertex, own);
    }
  }

  /// Takes the smooth part around the first triangle out of left_, and gives it the vertex `own`.
  void take_part(int vertex, int own) {
    part_.assign(1, left_.front());
    left_.erase(left_.begin());
    for (std::size_t i = 0; i < part_.size(); ++i) {
      const int t = part_[i];
      std::replace(mesh_.triangles[t].begin(), mesh_.triangles[t].end(), vertex, own);
      const auto stays = [&](int s) { return !share_edge(vertex, s, t) || !is_smooth(s, t); };
      const auto rest = std::stable_partition(left_.begin(), left_.end(), stays);
      part_.insert(part_.end(), rest, left_.end());
      left_.erase(rest, left_.end());
    }
  }

  DisplayMesh& mesh_;
  const std::vector<Triangle> old_;
  const Adjacency adjacency_;
  const float cosine_;
  std::vector<Vec3f> normals_;  ///< of triangles, twice their area long
  std::vector<int> left_;       ///< triangles around the vertex that have no part yet
  std::vector<int> part_;
};

}  // namespace

void split_at_creases(DisplayMesh& mesh, float degrees) { CreaseSplitter(mesh, degrees).run(); }

}  // namespace piecework::render
