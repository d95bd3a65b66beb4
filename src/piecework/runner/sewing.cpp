#include <piecework/runner/sewing.hpp>

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/LU>

#include <piecework/core/error.hpp>
#include <piecework/mesh/seams.hpp>
#include <piecework/mesh/topology.hpp>

#include "seam_file.hpp"

namespace piecework::runner {
namespace {

using Edges = std::vector<std::array<int, 2>>;

/// An open seam that needs no time to close, in mean edge lengths. Chosen: a curved border and its
/// chords differ by less.
constexpr double kClosedGap = 0.5;

/// Collects the stitches of all seams.
class Seamstress {
 public:
  explicit Seamstress(World& world) : world_(world) {
    around_ = mesh::vertex_triangles(world.model.triangles, world.model.num_vertices());
    names_.vertex = [&world](int v) { return world.vertex_name(v); };
  }

  void add(const scene::Seam& seam, const std::string& where) {
    const std::size_t first = stitches_.size();
    from_ = part(seam.cloth);
    to_ = seam.to.empty() ? from_ : part(seam.to);
    name_seam(where, seam.name);
    if (!seam.stitches.empty()) add_stitches(seam.stitches, where + "/stitches");
    if (!seam.chain.empty())
      add_chains(numbers(from_, seam.chain, where + "/chain"),
                 numbers(to_, seam.to_chain, where + "/to_chain"), where);
    if (!seam.set.empty()) add_sets(seam, where);
    if (seam.distance) add_near(*seam.distance, where);
    if (!seam.file.empty()) add_file(seam.file, where);
    for (std::size_t i = first; i < stitches_.size(); ++i)
      stitches_[i].close_time = seam.close_time.value_or(0);
  }

  void finish() {
    const model::ClothModel& model = world_.model;
    mesh::SeamMap map = mesh::resolve_seams(stitches_, model.num_vertices(), names_);
    if (map.dropped > 0)
      world_.notes.push_back(
          fmt::format("{} stitches found by distance were left out: their vertices are sewn "
                      "already, or carry what they would follow",
                      map.dropped));
    note_collapsed(map);
    world_.model.sewing = model::Sewing(std::move(map), model.start);
    check_closed();
    world_.seam_neighbors = mesh::seam_neighbors(model.triangles, model.sewing.map());
  }

 private:
  [[nodiscard]] std::size_t part(const std::string& cloth) const {
    const auto& parts = world_.model.parts;
    const auto found = std::find_if(parts.begin(), parts.end(), [&](const auto& p) {
      return cloth.empty() || p.name == cloth;
    });
    return static_cast<std::size_t>(found - parts.begin());  // the scene module knows the names
  }

  void name_seam(const std::string& where, const std::string& name) {
    names_.seams.push_back(name.empty() ? where : fmt::format("{} ({})", where, name));
  }

  [[nodiscard]] int current_seam() const { return static_cast<int>(names_.seams.size()) - 1; }

  [[nodiscard]] std::vector<int> numbers(std::size_t part, const std::vector<int>& file_vertices,
                                         const std::string& where) const {
    std::vector<int> vertices;
    for (const int v : file_vertices) vertices.push_back(world_.vertex(part, v, where));
    return vertices;
  }

  void add_all(std::vector<mesh::Stitch> stitches) {
    for (mesh::Stitch& stitch : stitches) {
      stitch.seam = current_seam();
      stitches_.push_back(stitch);
    }
  }

  void add_stitches(const std::vector<std::array<double, 4>>& stitches, const std::string& where) {
    for (std::size_t i = 0; i < stitches.size(); ++i) {
      const std::string here = fmt::format("{}/{}", where, i);
      const auto vertex = [&](std::size_t p, double v) {
        return world_.vertex(p, static_cast<int>(v), here);
      };
      const auto& [v, a, b, ratio] = stitches[i];
      add_all(
          {{.vertex = vertex(from_, v), .a = vertex(to_, a), .b = vertex(to_, b), .ratio = ratio}});
    }
  }

  void add_chains(const std::vector<int>& a, const std::vector<int>& b, const std::string& where) {
    add_all(mesh::stitch_chains(measured(a, where), measured(b, where), where));
  }

  /// Length of an edge in the flat rest shape of a triangle on it, m.
  [[nodiscard]] double rest_length(int u, int v, const std::string& where) const {
    for (int k = around_.begin[static_cast<std::size_t>(u)];
         k < around_.begin[static_cast<std::size_t>(u) + 1]; ++k) {
      const auto t = static_cast<std::size_t>(around_.item[static_cast<std::size_t>(k)]);
      const model::StretchConstraint& c = world_.model.stretch[t];
      const auto corner = [&](int vertex) {
        return std::find(c.vertices.begin(), c.vertices.end(), vertex) - c.vertices.begin();
      };
      if (corner(v) == 3) continue;
      Eigen::Matrix<double, 2, 3> place = Eigen::Matrix<double, 2, 3>::Zero();
      place.rightCols<2>() = c.rest_inverse.inverse();
      return (place.col(corner(u)) - place.col(corner(v))).norm();
    }
    throw InputError(fmt::format(
        "{}: {} and {} follow each other in a chain, but no edge joins them; list every "
        "vertex along the border",
        where, world_.vertex_name(u), world_.vertex_name(v)));
  }

  [[nodiscard]] mesh::SeamChain measured(std::vector<int> vertices,
                                         const std::string& where) const {
    mesh::SeamChain chain{std::move(vertices), {0.0}};
    for (std::size_t i = 1; i < chain.vertices.size(); ++i)
      chain.arc.push_back(chain.arc.back() +
                          rest_length(chain.vertices[i - 1], chain.vertices[i], where));
    return chain;
  }

  [[nodiscard]] Edges border(std::size_t part) const {
    const int first = world_.model.parts[part].first_vertex;
    Edges edges;
    for (const mesh::Edge& edge : mesh::find_edges(world_.documents[part].mesh.triangles))
      if (edge.triangles[1] < 0)
        edges.push_back({edge.vertices[0] + first, edge.vertices[1] + first});
    return edges;
  }

  /// A vertex set as a path along the border, from the end with the lower number.
  [[nodiscard]] std::vector<int> path(std::size_t part, const std::string& set,
                                      const std::string& where) const {
    const auto& sets = world_.documents[part].vertex_sets;
    const auto found = sets.find(set);
    if (found == sets.end()) {
      std::vector<std::string> known;
      for (const auto& [name, vertices] : sets) known.push_back(name);
      throw InputError(fmt::format("{}: the mesh has no vertex set \"{}\"; it has: {}", where, set,
                                   fmt::join(known, ", ")));
    }
    std::vector<int> members = found->second;
    for (int& v : members) v += world_.model.parts[part].first_vertex;
    Edges edges = border(part);
    std::erase_if(edges, [&](const auto& edge) {
      return !std::binary_search(members.begin(), members.end(), edge[0]) ||
             !std::binary_search(members.begin(), members.end(), edge[1]);
    });
    const auto degree = [&](int v) {
      return std::count_if(edges.begin(), edges.end(),
                           [&](const auto& e) { return e[0] == v || e[1] == v; });
    };
    const auto start =
        std::find_if(members.begin(), members.end(), [&](int v) { return degree(v) == 1; });
    std::vector<int> walk;
    for (int v = start == members.end() ? -1 : *start; v >= 0;) {
      walk.push_back(v);
      const auto next = std::find_if(edges.begin(), edges.end(),
                                     [&](const auto& e) { return e[0] == v || e[1] == v; });
      if (next == edges.end()) break;
      v = (*next)[0] == v ? (*next)[1] : (*next)[0];
      edges.erase(next);
    }
    if (walk.size() != members.size() || !edges.empty())
      throw InputError(fmt::format(
          "{}: the vertex set \"{}\" is no single path along a border; list the vertices "
          "with chain and to_chain",
          where, set));
    return walk;
  }

  void add_sets(const scene::Seam& seam, const std::string& where) {
    const std::vector<int> a = path(from_, seam.set, where + "/set");
    std::vector<int> b = path(to_, seam.to_set, where + "/to_set");
    if (seam.reversed) std::reverse(b.begin(), b.end());
    add_chains(a, b, where);
  }

  void add_near(double distance, const std::string& where) {
    auto stitches = mesh::stitch_near(world_.model.start, border(from_), border(to_), distance);
    if (stitches.empty())
      throw InputError(
          fmt::format("{}/distance: no border vertex lies within {} m of the other border in the "
                      "start shape; choose a larger distance, or name the vertices",
                      where, distance));
    add_all(std::move(stitches));
  }

  void add_file(const std::string& file, const std::string& where) {
    for (const FileSeam& seam : read_seam_file(file)) {
      const std::string here = fmt::format("{}/file: {}: {}", where, file, seam.name);
      name_seam(here, "");
      if (!seam.chain.empty() || !seam.to_chain.empty())
        add_chains(numbers(from_, seam.chain, here), numbers(from_, seam.to_chain, here), here);
      add_stitches(seam.stitches, here);
    }
  }

  /// Patterns of real garments do that at the ends of pleats; a triangle without area is allowed.
  void note_collapsed(const mesh::SeamMap& map) {
    const std::vector<int> collapsed = mesh::collapsed_triangles(world_.model.triangles, map);
    if (collapsed.empty()) return;
    const auto [i, j, k] = world_.model.triangles[static_cast<std::size_t>(collapsed.front())];
    world_.notes.push_back(fmt::format(
        "seams sew two corners of one triangle to each other, {} times; the first is "
        "{}, {}, {}: these triangles have no area",
        collapsed.size(), world_.vertex_name(i), world_.vertex_name(j), world_.vertex_name(k)));
  }

  void check_closed() const {
    const model::Sewing& sewing = world_.model.sewing;
    const double allowed = kClosedGap * world_.model.mean_edge;
    for (int s = 0; s < sewing.map().num_slaves(); ++s) {
      const auto i = static_cast<std::size_t>(s);
      const double gap = sewing.gap(world_.model.start, s);
      if (sewing.map().close_time[i] > 0 || gap <= allowed) continue;
      const int slave = sewing.map().slaves[i];
      const auto stitch = std::find_if(stitches_.begin(), stitches_.end(),
                                       [&](const auto& st) { return st.vertex == slave; });
      throw InputError(fmt::format(
          "{}: {} starts {:.3g} m from its place on the seam; give the seam a "
          "close_time, or bring the two sides together",
          stitch == stitches_.end() ? names_.seams.front()
                                    : names_.seams[static_cast<std::size_t>(stitch->seam)],
          world_.vertex_name(slave), gap));
    }
  }

  World& world_;
  mesh::Adjacency around_;
  mesh::SeamNames names_;
  std::vector<mesh::Stitch> stitches_;
  std::size_t from_ = 0, to_ = 0;  ///< parts of the seam in hand
};

}  // namespace

void sew(World& world) {
  const auto& seams = world.scene.seams;
  if (seams.empty()) return;
  Seamstress seamstress(world);
  for (std::size_t i = 0; i < seams.size(); ++i)
    seamstress.add(seams[i], fmt::format("{}: /seams/{}", world.scene.source, i));
  seamstress.finish();
}

void hold_seams(World& world) {
  if (world.model.sewing.empty()) return;
  std::vector<std::string> names;
  for (std::size_t c = 0; c < world.scene.cloths.size(); ++c)
    for (std::size_t p = 0; p < world.scene.cloths[c].pins.size(); ++p)
      names.push_back(fmt::format("{}: /cloths/{}/pins/{}", world.scene.source, c, p));
  world.pins = model::pins_on_carriers(
      std::move(world.pins), world.model.sewing.map(),
      {[&](std::size_t p) { return names[p]; }, [&](int v) { return world.vertex_name(v); }});
}

}  // namespace piecework::runner
