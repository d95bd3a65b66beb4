#pragma once

// A scene as plain data: what the JSON says, defaults filled in. Nothing here computes.
// The keys, their defaults, ranges and docs are declared once, in scene_fields.hpp, from which the
// reader, the JSON Schema, the resolved scene and the reference page are all made.

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <piecework/scene/bodies.hpp>

namespace piecework::scene {

struct Step {
  double h = 1.0 / 120.0;  ///< time step, s
  int steps = 60;          ///< steps to simulate
  int output_every = 1;    ///< steps per frame

  bool operator==(const Step&) const = default;
};

/// Membrane k_s = stretching * thickness [N/m]; with the default thickness of 1 the numbers are
/// those of the paper's Table 1.
struct Material {
  double density = 0.5;           ///< kg/m^2
  double stretching = 2e4;        ///< Pa
  double thickness = 1.0;         ///< m
  std::optional<double> bending;  ///< flexural rigidity D, N m; absent: no bending

  bool operator==(const Material&) const = default;
};

struct Wind {
  std::array<double, 3> velocity{0, 0, 0};  ///< m/s
  double air_density = 1.2;                 ///< kg/m^3
  double normal_drag = 1.0;                 ///< coefficient for flow through the cloth
  double tangential_drag = 0.05;
  double gust_amplitude = 0;  ///< fraction of velocity
  double gust_period = 1.0;   ///< s

  bool operator==(const Wind&) const = default;
};

/// Which vertices: the union of everything named.
struct Region {
  std::vector<int> vertices;      ///< in the order of the mesh's file
  std::vector<std::string> sets;  ///< "border", "corners", "left", ..., group names
  std::optional<std::array<std::array<double, 3>, 2>>
      box;                                      ///< start positions within [min, max], m
  std::optional<std::array<double, 4>> sphere;  ///< start positions within (x, y, z, radius), m

  bool operator==(const Region&) const = default;
};

/// Vertices held in place or moved by script. Rotation acts first, then translation.
struct Pin {
  Region region;
  std::array<double, 3> velocity{0, 0, 0};  ///< m/s
  std::array<double, 3> axis{0, 1, 0};      ///< direction of the axis of rotation
  std::array<double, 3> center{0, 0, 0};    ///< point on the axis, m
  double rate = 0;                          ///< rad/s
  double start = 0;                         ///< motion begins, s
  std::optional<double> stop;               ///< motion ends, s
  std::optional<double> release;            ///< vertices become free, s

  bool operator==(const Pin&) const = default;
};

/// A force that acts on a patch for a while.
struct Load {
  Region region;
  std::array<double, 3> force{0, 0, 0};  ///< N, shared by the patch's vertices by mass
  double start = 0;                      ///< s
  std::optional<double> stop;            ///< s

  bool operator==(const Load&) const = default;
};

struct Cloth {
  std::string name = "cloth";
  Mesh mesh;
  std::string material;       ///< key in Scene::materials
  std::string rest = "self";  ///< "self", "uv" (texture coordinates in metres), or "file"
  std::string rest_file;      ///< with rest == "file": same topology, rest positions
  std::array<double, 3> translate{0, 0, 0};  ///< m; after rotate and scale
  std::array<double, 3> rotate{0, 0, 0};     ///< degrees about x, then y, then z
  std::array<double, 3> scale{1, 1, 1};      ///< of the start shape (rest shape unchanged)
  std::array<double, 3> velocity{0, 0, 0};   ///< m/s at the start
  std::vector<Pin> pins;
  std::vector<Load> loads;

  bool operator==(const Cloth&) const = default;
};

/// Vertices of one cloth sewn to another cloth, or to itself.
struct Seam {
  std::string name;
  std::string cloth;                            ///< empty: the only one
  std::string to;                               ///< empty: `cloth`
  std::vector<std::array<double, 4>> stitches;  ///< vertex, a, b, ratio
  std::vector<int> chain, to_chain;
  std::string set, to_set;
  bool reversed = false;
  std::string file;                  ///< relative to the scene's folder
  std::optional<double> distance;    ///< m
  std::optional<double> close_time;  ///< s; absent: closed from the start

  bool operator==(const Seam&) const = default;
};

struct Solver {
  std::string method = "dd_pd";
  std::string global = "tree";
  std::string local = "jacobi";
  int domains = 32;
  std::vector<double> domain_weights;  ///< per domain; empty: equal
  double corner_fraction = 0.5;
  std::string interface = "recursive";
  std::string seams = "elimination";
  std::string contact = "refactor";
  int threads = 0;  ///< 0: what the machine allows
  std::string hessian = "projected";
  std::string linear = "cholmod";
  std::optional<double> chebyshev_rho;  ///< absent: from inertia

  bool operator==(const Solver&) const = default;
};

/// Accuracy dials.
struct Quality {
  std::string stop =
      "error";              ///< "error" | "gradient" | "dx_2" | "dx_rms" | "dx_inf" | "iterations"
  double tolerance = 1e-2;  ///< unit depends on stop; see the reference
  int max_iterations = 200;
  int min_iterations = 1;
  std::string accelerate = "lbfgs_kn";
  int window = 5;                       ///< remembered iterates
  std::string precision = "automatic";  ///< "automatic" | "double" | "single"
  std::string ccd = "halley";
  std::string newton = "touching";
  int friction_renewals = 1;
  double pcg_tol = 1e-2;
  int pcg_max = 50;
  int sd_iterations = 1;
  std::string preset = "default";  ///< which row of quality_presets() the other members start from

  bool operator==(const Quality&) const = default;
};

/// How things touch; matters only where something can (self_collision, colliders).
struct Contact {
  std::optional<double> distance;   ///< m; absent: from the mesh
  std::optional<double> stiffness;  ///< N/m; absent: from the stiffness of the cloth
  std::string barrier = "two_stage";
  double slip_speed = 1e-3;  ///< m/s
  bool check = true;
  int untangle = 100;  ///< rounds at most; 0: off

  bool operator==(const Contact&) const = default;
};

struct Camera {
  std::optional<std::array<double, 3>> position;  ///< m; absent: framed automatically
  std::optional<std::array<double, 3>> target;    ///< m
  double fov = 35;                                ///< vertical, degrees
  double azimuth = 35;                            ///< degrees about y, for automatic framing
  double elevation = 20;                          ///< degrees above the horizon
  std::optional<double> ground;  ///< height of the ground plane, m; absent: below the cloth

  bool operator==(const Camera&) const = default;
};

struct Render {
  std::string color = "domain";
  std::array<int, 2> size{1280, 720};
  bool borders = true;
  bool mesh_lines = false;

  bool operator==(const Render&) const = default;
};

/// What must be true after the run: min <= quantity <= max, at a time (default: the end).
struct Expectation {
  std::string quantity;       ///< see the reference: "lowest_y", "max_strain", "vertex_y", ...
  std::optional<double> at;   ///< s
  std::optional<int> vertex;  ///< for vertex_* quantities, file order of `cloth`
  std::string cloth;          ///< empty: all
  std::optional<double> min, max;

  bool operator==(const Expectation&) const = default;
};

struct Scene {
  std::string name;
  std::string description;
  Step step;
  std::optional<std::array<double, 3>> gravity =
      std::array<double, 3>{0, -9.81, 0};  ///< m/s^2; null: off
  std::optional<Wind> wind;
  std::optional<double> damping;  ///< velocity damping rate, 1/s; absent: off
  bool self_collision = false;
  std::optional<double> friction;          ///< coefficient; absent: none
  std::optional<double> kinetic_friction;  ///< coefficient; absent: `friction`
  Contact contact;
  Solver solver;
  Quality quality;
  std::map<std::string, Material> materials;
  std::vector<Cloth> cloths;
  std::vector<Seam> seams;
  std::vector<Collider> colliders;
  Camera camera;
  Render render;
  std::vector<Expectation> expect;

  std::string source;  ///< file it was read from, for messages; not a key

  bool operator==(const Scene&) const = default;
};

}  // namespace piecework::scene
