#include <piecework/mesh/repair.hpp>

#include <algorithm>
#include <cstddef>
#include <map>
#include <utility>

#include <fmt/format.h>

#include <piecework/core/error.hpp>
#include <piecework/mesh/checks.hpp>
#include <piecework/mesh/topology.hpp>

namespace piecework::mesh {
namespace {

void drop_triangles(WorkMesh& work, const std::vector<bool>& dropped) {
  std::size_t kept = 0;
  for (std::size_t t = 0; t < dropped.size(); ++t) {
    if (dropped[t]) continue;
    work.mesh.triangles[kept] = work.mesh.triangles[t];
    work.triangle_polygon[kept] = work.triangle_polygon[t];
    if (!work.corner_uv.empty())
      std::copy_n(work.corner_uv.begin() + static_cast<std::ptrdiff_t>(3 * t), 3,
                  work.corner_uv.begin() + static_cast<std::ptrdiff_t>(3 * kept));
    ++kept;
  }
  work.mesh.triangles.resize(kept);
  work.triangle_polygon.resize(kept);
  if (!work.corner_uv.empty()) work.corner_uv.resize(3 * kept);
}

/// Drops the triangles listed and notes it; the note names the first one.
void drop_and_note(const RawMesh& raw, WorkMesh& work, const std::vector<int>& list,
                   const char* what, std::vector<std::string>& notes) {
  if (list.empty()) return;
  const int first = *std::min_element(list.begin(), list.end());
  notes.push_back(fmt::format("repair: dropped {} {} triangle{}, first from {}", list.size(), what,
                              list.size() == 1 ? "" : "s",
                              raw.polygon_name(work.triangle_polygon[first])));
  std::vector<bool> dropped(work.mesh.triangles.size(), false);
  for (int t : list) dropped[t] = true;
  drop_triangles(work, dropped);
}

bool runs_forward(const Triangle& t, int v0, int v1) {
  return (t[0] == v0 && t[1] == v1) || (t[1] == v0 && t[2] == v1) || (t[2] == v0 && t[0] == v1);
}

/// Triangles to drop so that no edge has more than two: of each edge the first triangle stays, and
/// the first one that runs the other way (or else the second).
std::vector<int> excess_triangles(const Triangles& triangles) {
  std::vector<bool> dropped(triangles.size(), false);
  std::vector<int> list;
  for (const EdgeUse& edge : crowded_edges(triangles)) {
    std::vector<int> alive;
    for (int t : edge.triangles) {
      if (!dropped[t]) alive.push_back(t);
    }
    if (alive.size() <= 2) continue;
    const bool forward = runs_forward(triangles[alive.front()], edge.v0, edge.v1);
    const auto partner = std::find_if(alive.begin() + 1, alive.end(), [&](int t) {
      return runs_forward(triangles[t], edge.v0, edge.v1) != forward;
    });
    std::swap(alive[1], partner == alive.end() ? alive[1] : *partner);
    for (std::size_t i = 2; i < alive.size(); ++i) {
      dropped[alive[i]] = true;
      list.push_back(alive[i]);
    }
  }
  return list;
}

/// Gives each fan of a bow-tie vertex but the first a vertex of its own, in the mesh and in the
/// file's polygons. New vertices come after all others.
class FanSplitter {
 public:
  FanSplitter(RawMesh& raw, WorkMesh& work)
      : raw_(raw),
        work_(work),
        fan_(corner_fans(work.mesh.triangles, sorted_half_edges(work.mesh.triangles))),
        first_fan_(static_cast<std::size_t>(work.mesh.num_vertices()), -1) {}

  /// Returns the number of vertices added to the file.
  int run() {
    const int before = work_.mesh.num_vertices();
    for (std::size_t corner = 0; corner < fan_.size(); ++corner) {
      int& first = first_fan_[vertex_at(corner)];
      if (first < 0) first = fan_[corner];
      if (first != fan_[corner]) split(corner);
    }
    Positions& positions = work_.mesh.positions;
    positions.conservativeResize(before + static_cast<int>(origin_.size()), 3);
    for (int i = 0; i < static_cast<int>(origin_.size()); ++i)
      positions.row(before + i) = positions.row(origin_[i]).eval();
    return static_cast<int>(copies_.size());
  }

 private:
  int& vertex_at(std::size_t corner) { return work_.mesh.triangles[corner / 3][corner % 3]; }

  void split(std::size_t corner) {
    const int old_vertex = vertex_at(corner);
    const int next = work_.mesh.num_vertices() + static_cast<int>(origin_.size());
    const auto [vertex, is_new] = fan_vertex_.try_emplace(fan_[corner], next);
    if (is_new) origin_.push_back(old_vertex);
    vertex_at(corner) = vertex->second;
    const int polygon = work_.triangle_polygon[corner / 3];
    FileLayout& layout = raw_.layout;
    for (int c = layout.polygon_begin[polygon]; c < layout.polygon_begin[polygon + 1]; ++c) {
      int& file_vertex = layout.polygon_vertex[c];
      if (work_.vertex_map[file_vertex] == old_vertex)
        file_vertex = copy_file_vertex(file_vertex, vertex->second);
    }
  }

  /// The file's own copy of a vertex for one new vertex of the mesh.
  int copy_file_vertex(int file_vertex, int vertex) {
    const int next = static_cast<int>(raw_.positions.size());
    const auto [copy, is_new] = copies_.try_emplace({file_vertex, vertex}, next);
    if (!is_new) return copy->second;
    raw_.positions.push_back(Vec3(raw_.positions[file_vertex]));
    if (!raw_.vertex_line.empty()) raw_.vertex_line.push_back(int{raw_.vertex_line[file_vertex]});
    work_.vertex_map.push_back(vertex);
    return next;
  }

  RawMesh& raw_;
  WorkMesh& work_;
  std::vector<int> fan_;
  std::vector<int> first_fan_;                 // of each vertex before the split
  std::map<int, int> fan_vertex_;              // new vertex of a fan
  std::vector<int> origin_;                    // old vertex of each new one
  std::map<std::pair<int, int>, int> copies_;  // (file vertex, new vertex) -> file vertex
};

void split_fans(RawMesh& raw, WorkMesh& work, std::vector<std::string>& notes) {
  const std::vector<int> pinched = pinched_vertices(work.mesh.triangles, work.mesh.num_vertices());
  if (pinched.empty()) return;
  const int added = FanSplitter(raw, work).run();
  notes.push_back(fmt::format("repair: split {} bow-tie vert{}; {} vert{} added after the last one",
                              pinched.size(), pinched.size() == 1 ? "ex" : "ices", added,
                              added == 1 ? "ex" : "ices"));
}

/// Orients the triangles of meshes without crowded edges.
class Orienter {
 public:
  Orienter(const RawMesh& raw, const WorkMesh& work)
      : raw_(raw),
        work_(work),
        edges_(find_edges(work.mesh.triangles)),
        turned_(work.mesh.triangles.size(), kUnknown),
        begin_(work.mesh.triangles.size() + 1, 0) {
    list_neighbours();
  }

  /// Triangles to turn: in each component the fewer (if equal, those unlike its first).
  std::vector<int> run() {
    std::vector<int> list;
    for (int seed = 0; seed < static_cast<int>(turned_.size()); ++seed) {
      if (turned_[seed] == kUnknown) orient_component(seed, list);
    }
    return list;
  }

 private:
  static constexpr signed char kUnknown = -1;

  void list_neighbours() {
    for (const Edge& edge : edges_) {
      if (edge.triangles[1] < 0) continue;
      for (int t : edge.triangles) ++begin_[t + 1];
    }
    for (std::size_t t = 1; t < begin_.size(); ++t) begin_[t] += begin_[t - 1];
    edge_of_.resize(static_cast<std::size_t>(begin_.back()));
    std::vector<int> next(begin_.begin(), begin_.end() - 1);
    for (int e = 0; e < static_cast<int>(edges_.size()); ++e) {
      if (edges_[e].triangles[1] < 0) continue;
      for (int t : edges_[e].triangles) edge_of_[next[t]++] = e;
    }
  }

  void orient_component(int seed, std::vector<int>& list) {
    std::vector<int> members{seed};
    turned_[seed] = 0;
    std::size_t num_turned = 0;
    for (std::size_t i = 0; i < members.size(); ++i) {
      const int t = members[i];
      num_turned += turned_[t] == 1;
      for (int n = begin_[t]; n < begin_[t + 1]; ++n) visit(t, edges_[edge_of_[n]], members);
    }
    const signed char minority = 2 * num_turned > members.size() ? 0 : 1;
    for (int t : members) {
      if (turned_[t] == minority) list.push_back(t);
    }
  }

  void visit(int t, const Edge& edge, std::vector<int>& members) {
    const Triangles& triangles = work_.mesh.triangles;
    const int other = edge.triangles[0] == t ? edge.triangles[1] : edge.triangles[0];
    const auto [v0, v1] = edge.vertices;
    const bool clash = runs_forward(triangles[t], v0, v1) == runs_forward(triangles[other], v0, v1);
    const auto wanted = static_cast<signed char>(clash ? 1 - turned_[t] : turned_[t]);
    if (turned_[other] == kUnknown) {
      turned_[other] = wanted;
      members.push_back(other);
    } else if (turned_[other] != wanted) {
      throw InputError(fmt::format(
          "{}: {}: part of a one-sided surface (a Moebius strip), which no orientation fits; cut "
          "it across",
          raw_.file, raw_.polygon_name(work_.triangle_polygon[other])));
    }
  }

  const RawMesh& raw_;
  const WorkMesh& work_;
  std::vector<Edge> edges_;
  std::vector<signed char> turned_;  // 0 stays, 1 is turned
  std::vector<int> begin_;           // edges around triangle t: edge_of_[begin_[t]], ...
  std::vector<int> edge_of_;
};

void orient(const RawMesh& raw, WorkMesh& work, std::vector<std::string>& notes) {
  if (clashing_edges(work.mesh.triangles).empty()) return;
  const std::vector<int> list = Orienter(raw, work).run();
  for (int t : list) {
    std::swap(work.mesh.triangles[t][1], work.mesh.triangles[t][2]);
    if (!work.corner_uv.empty()) std::swap(work.corner_uv[3 * t + 1], work.corner_uv[3 * t + 2]);
  }
  notes.push_back(fmt::format("repair: turned {} triangle{} to the orientation of the rest",
                              list.size(), list.size() == 1 ? "" : "s"));
}

void drop_isolated_vertices(WorkMesh& work, std::vector<std::string>& notes) {
  const int num_vertices = work.mesh.num_vertices();
  const std::vector<int> isolated = isolated_vertices(work.mesh.triangles, num_vertices);
  if (isolated.empty()) return;
  std::vector<int> number(static_cast<std::size_t>(num_vertices), 0);
  for (int v : isolated) number[v] = -1;
  int kept = 0;
  for (int v = 0; v < num_vertices; ++v) {
    if (number[v] < 0) continue;
    work.mesh.positions.row(kept) = work.mesh.positions.row(v).eval();
    number[v] = kept++;
  }
  work.mesh.positions.conservativeResize(kept, 3);
  for (Triangle& t : work.mesh.triangles) {
    for (int& v : t) v = number[v];
  }
  for (int& v : work.vertex_map) v = number[v];
  notes.push_back(fmt::format("repair: dropped {} isolated vert{}", isolated.size(),
                              isolated.size() == 1 ? "ex" : "ices"));
}

}  // namespace

void repair(RawMesh& raw, WorkMesh& work, std::vector<std::string>& notes) {
  drop_and_note(raw, work, zero_area_triangles(work.mesh), "zero-area", notes);
  drop_and_note(raw, work, duplicate_triangles(work.mesh.triangles), "duplicate", notes);
  drop_and_note(raw, work, excess_triangles(work.mesh.triangles), "out-of-manifold", notes);
  split_fans(raw, work, notes);
  orient(raw, work, notes);
  drop_isolated_vertices(work, notes);
}

}  // namespace piecework::mesh
