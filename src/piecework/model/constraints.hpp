#pragma once

// Cloth as projective-dynamics constraints: what is constant during a simulation.
// Symbols and citation keys: docs/architecture.md.

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <piecework/core/types.hpp>
#include <piecework/mesh/topology.hpp>
#include <piecework/model/sewing.hpp>

namespace piecework::model {

/// Elastic constants of one cloth.
struct Material {
  double density = 0.5;           ///< rho, kg/m^2
  double stretching = 2e4;        ///< k_s = Young's modulus * thickness, N/m
  std::optional<double> bending;  ///< D, flexural rigidity, N m; absent: no bending constraints
};

/// In-plane strain constraint of one triangle, energy w/2 |F - R|^2 with F = X_t^T G (3 x 2) and R
/// its closest isometry [Lu25, Eq. 1 with method of Bouaziz 2014].
struct StretchConstraint {
  Triangle vertices;
  /// Dm^-1: the deformation gradient is F = [x1 - x0, x2 - x0] rest_inverse.
  Mat2 rest_inverse;
  double weight;  ///< w = k_s A, J
};

/// Quadratic bending of one hinge [Bergou et al. 2006], energy w/2 |c^T x - y|^2.
/// The customary 3 D / (A0 + A1) makes a cylinder three times too stiff (docs/architecture.md, D6).
struct BendConstraint {
  std::array<int, 4> vertices;        ///< x0 x1 shared edge, x2 and x3 opposite
  std::array<double, 4> coefficient;  ///< c, dimensionless; sums to zero
  double weight;                      ///< w = D / (A0 + A1), N/m
  double rest_length;                 ///< |c^T x_rest|, m; 0 for a flat rest shape: then y = 0
};

/// Flat rest shape of each triangle, m, and optionally the rest shape in space.
struct RestShape {
  std::vector<std::array<Vec2, 3>> corners;  ///< per triangle
  /// |V| x 3, m: gives hinges their rest angle. Empty: flat (sewing patterns).
  Positions positions;
};

/// Rest shape equal to a mesh in space.
/// \throws InputError "<name>: triangle ...: zero area" if a triangle has no area.
RestShape rest_from_positions(const Positions& positions, const Triangles& triangles,
                              const std::string& name);

/// Rest shape from texture coordinates in metres, three per triangle.
/// \throws InputError if there are none, or a triangle has no area in them.
RestShape rest_from_uv(const std::vector<Vec2>& corner_uv, const Triangles& triangles,
                       const std::string& name);

/// One cloth of a scene.
struct ClothPart {
  std::string name;
  Triangles triangles;  ///< of this part: vertices from 0
  RestShape rest;
  Positions start;  ///< |V| x 3, m
  Material material;
};

/// All cloths of a scene with one numbering of vertices, part after part.
struct ClothModel {
  struct Range {
    std::string name;
    int first_vertex = 0, num_vertices = 0;
    int first_triangle = 0, num_triangles = 0;
  };

  std::vector<Range> parts;
  Triangles triangles;
  std::vector<mesh::Hinge> hinges;         ///< every interior edge
  std::vector<std::uint8_t> hinge_bends;   ///< per hinge: has a bending constraint
  std::vector<StretchConstraint> stretch;  ///< one per triangle, in order
  std::vector<BendConstraint> bend;        ///< those hinges that bend, in order
  Eigen::VectorXd mass;                    ///< m, |V|, kg: a third of each triangle's rho A
  std::vector<double> triangle_mass;       ///< per triangle, rho A, kg
  Positions start;                         ///< |V| x 3, m; also orients degenerate triangles
  double mean_edge = 0;                    ///< mean rest edge length, m
  Sewing sewing;                           ///< seams between and within parts; empty: none

  [[nodiscard]] int num_vertices() const { return static_cast<int>(mass.size()); }
  /// Vertices that are no slaves of a seam.
  [[nodiscard]] int num_free() const { return num_vertices() - sewing.map().num_slaves(); }
};

/// Builds the constraints of all parts.
/// \throws InputError that names the part and the value if a material constant is not finite or
///         not positive (stretching and bending may be zero), or sizes do not match.
ClothModel build_model(const std::vector<ClothPart>& parts);

/// Coefficients c of a hinge from the rest shapes of its two triangles (x0, x1, x2 and x0, x1, x3).
std::array<double, 4> hinge_coefficients(const std::array<Vec2, 3>& t0,
                                         const std::array<Vec2, 3>& t1);

}  // namespace piecework::model
