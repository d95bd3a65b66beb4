#pragma once

// Cloth domains: one recursive weighted bisection of the triangles gives the coloured domains
// (leaves), the separators (vertices shared across a cut) and the elimination tree that the
// domain-decomposed solvers follow. A function of the mesh and the scene only: never of the number
// of threads, a clock or a machine.

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/mesh/seams.hpp>
#include <piecework/mesh/topology.hpp>

namespace piecework::decomposition {

/// What is to be divided.
struct Elements {
  std::span<const Triangle> triangles;
  /// Every interior edge of the mesh as a hinge: the adjacency of triangles.
  std::span<const mesh::Hinge> hinges;
  /// Per hinge: 1 if it carries a bending constraint. Empty: all do.
  std::span<const std::uint8_t> hinge_bends;
  int num_vertices = 0;
  /// Vertices that follow others: a constraint acts on what carries its vertices. Null: none.
  const mesh::SeamMap* seams = nullptr;
  /// Pairs of triangles that face each other across seams (mesh::seam_neighbors), neighbours like
  /// those that share an edge: what is sewn together is divided together.
  std::span<const std::array<int, 2>> seam_neighbors;
};

/// Seed handed to METIS; recorded in run.json. Chosen.
inline constexpr int kDefaultSeed = 1;

struct Options {
  int domains = 32;
  int seed = kDefaultSeed;
  /// Per domain: its share of the work, in any unit. Empty: equal shares.
  std::vector<double> domain_weights;
};

/// A node of the bisection tree. Leaves are domains; an inner node owns its cut's separator.
struct TreeNode {
  int parent = -1;
  std::array<int, 2> children{-1, -1};  ///< -1, -1 for a leaf
  int first_domain = 0;                 ///< domains below: first_domain ... + num_domains - 1
  int num_domains = 1;
  [[nodiscard]] bool is_leaf() const { return children[0] < 0; }
};

/// How many domains a vertex belongs to [Lu25, Sec. 4.1]: one (internal), two (duplicate), more.
enum class DofClass : std::uint8_t { Internal, Duplicate, Corner };

/// A vertex belongs to every domain that owns a constraint on it, or on a slave that it carries.
struct Decomposition {
  int num_domains = 0;
  std::vector<int> triangle_domain;  ///< per triangle
  /// Per hinge: the lower domain of its two triangles (the rule under which every domain matrix
  /// stays positive definite; see docs/architecture.md, D2).
  std::vector<int> hinge_domain;
  std::vector<TreeNode> nodes;  ///< parents before children; nodes[0] is the root
  /// Per vertex: the deepest node under which all its domains lie. Every constraint's vertices lie
  /// on one path from its domain's leaf to the root, so `nodes` is an elimination tree of K. With
  /// seams that holds for what carries them, and of K~ = T^T K T; a slave has no row: -1.
  std::vector<int> vertex_node;
  mesh::Adjacency vertex_domains;  ///< per vertex: its domains, ascending; slaves have none
  int seed = kDefaultSeed;
  std::vector<std::string> notes;  ///< e.g. that fewer domains were made than asked for

  [[nodiscard]] DofClass dof_class(int vertex) const;
};

/// Sizes as users know them (conventions: distinct vertices).
struct Summary {
  int domains = 0;
  int corner = 0;             ///< |C|: vertices of more than two domains
  int boundary = 0;           ///< |B|: vertices of more than one domain, corners included
  int remainder = 0;          ///< |R|: all vertices but corners and slaves
  std::int64_t edge_cut = 0;  ///< interior mesh edges between two domains
  double balance = 1;         ///< largest / mean number of constraints per domain
};

/// Divides the triangles into connected, balanced domains (METIS, recursive bisection).
/// Components are divided separately; with more components than domains, whole components share a
/// domain. More domains than triangles are reduced to one per triangle, with a note.
/// With options.domain_weights every cut divides the work as the sums of the weights on its two
/// sides; weights that are all the same give the bits of none.
/// \throws InputError if options.domains < 1, there is no triangle, or the weights are not one
///         positive finite number per domain.
Decomposition decompose(const Elements& elements, const Options& options);

/// Per vertex: the domains that own a constraint on it, ascending; with `elements.seams`, on it or
/// on what it carries, and none for slaves. `decomposition` needs its owners of triangles and
/// hinges.
mesh::Adjacency constraint_domains(const Elements& elements, const Decomposition& decomposition);

/// Counts, edge cut and balance of a decomposition of `elements`.
Summary summarize(const Decomposition& decomposition, const Elements& elements);

/// "METIS 5.1.0".
std::string library_version();

/// Pairs of domains that share a mesh edge or face each other across a seam, each once, ascending.
std::vector<std::array<int, 2>> adjacent_domains(
    const Decomposition& decomposition, std::span<const mesh::Hinge> hinges,
    std::span<const std::array<int, 2>> seam_neighbors = {});

}  // namespace piecework::decomposition
