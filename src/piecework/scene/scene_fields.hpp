#pragma once

// Private to the module: the one declaration of every key of a scene. A visitor is handed each
// key with the member it fills; the reader, the resolved scene, the JSON Schema and the reference
// page are four visitors. Defaults are those of the structs in scene.hpp.
//
// A visitor has
//   about(const char* title, const char* doc)     first, once per struct
//   value(const Key&, T&, const Range& = {})      T: double, int, bool, std::string, and
//   std::array,
//                                                 std::vector, std::optional of these
//   choice(const Key&, std::string&, const Choices&)
//   preset(const Key&, std::string&, T& target, const Presets<T>&)    a choice that sets the
//                                                 defaults of the keys declared after it
//   object(const Key&, T&)                        T: a struct, or std::optional of one
//   list(const Key&, std::vector<T>&)             structs in order
//   map(const Key&, std::map<std::string, T>&)    structs by name
//   exactly_one(const Names&), at_least_one(const Names&)    which keys must be given
//
// Whether a key `applies` may depend on members declared before it.

#include <piecework/scene/body_fields.hpp>
#include <piecework/scene/scene.hpp>
#include <piecework/scene/scene_keys.hpp>

namespace piecework::scene {

template <class V>
void fields(V& v, Step& s) {
  v.about("Step", "Time stepping: implicit Euler with a fixed step.");
  v.value({"h", "time step", "s"}, s.h, above(0, 10));
  v.value({"steps", "steps to simulate"}, s.steps, between(0, 1e9));
  v.value({"output_every", "steps per frame"}, s.output_every, between(1, 1e9));
}

template <class V>
void fields(V& v, Material& m) {
  v.about("Material",
          "What a cloth is made of. The membrane stiffness is k_s "
          "= stretching * thickness (N/m): "
          "with the default thickness of 1 m, stretching is k_s "
          "itself, as in the paper's tables.");
  v.value({"density", "mass per area", "kg/m^2"}, m.density, above(0, 1e6));
  v.value({"stretching", "Young's modulus Y of the membrane", "Pa"}, m.stretching, above(0, 1e15));
  v.value({"thickness", "thickness t; scales stretching only", "m"}, m.thickness, above(0, 1e3));
  v.value({"bending",
           "flexural rigidity D = Y t^3 / (12 (1 - nu^2)), not derived from "
           "thickness; hinges have "
           "the weight D / (A0 + A1), A0 and A1 the areas of the two "
           "triangles; absent: no bending",
           "N m"},
          m.bending, above(0, 1e12));
}

template <class V>
void fields(V& v, Wind& w) {
  v.about("Wind",
          "Moving air that drags the cloth along: per triangle of area A the force rho/2 A |u| "
          "(C_n u_n + "
          "C_t u_t), u the air's velocity relative to the cloth, u_n and u_t its parts normal and "
          "tangential to the triangle. Absent: no air at all.");
  v.value({"velocity", "velocity of the air", "m/s"}, w.velocity, between(-1e3, 1e3));
  v.value({"air_density", "mass per volume rho of the air", "kg/m^3"}, w.air_density,
          above(0, 1e4));
  v.value({"normal_drag", "drag coefficient C_n for flow through the cloth"}, w.normal_drag,
          between(0, 1e3));
  v.value({"tangential_drag", "drag coefficient C_t for flow along the cloth"}, w.tangential_drag,
          between(0, 1e3));
  v.value({"gust_amplitude",
           "strength a of gusts: at time t the air moves "
           "with velocity * (1 + a sin(2 pi t / "
           "gust_period))"},
          w.gust_amplitude, between(0, 100));
  v.value({"gust_period", "time between gusts", "s"}, w.gust_period, above(0, 1e6));
}

template <class V>
void fields(V& v, Region& r) {
  v.about("Region",
          "Vertices of a cloth: all that any of these keys names. "
          "Positions are those of the start "
          "shape, after scale, rotate and translate.");
  v.value({"vertices", "vertex numbers from 0, in the order of the mesh's file"}, r.vertices,
          indices());
  v.value({"sets",
           "named sets: border (every mesh); corners, left, right, bottom, top "
           "(sheet, strip); "
           "bottom, top (tube); center (disc); and the groups of a file"},
          r.sets, not_empty());
  v.value({"box", "[[x, y, z], [x, y, z]]: lowest and highest corner of a box", "m"}, r.box,
          kLengths);
  v.value({"sphere", "[x, y, z, radius] of a ball", "m"}, r.sphere, kLengths);
  v.at_least_one({"vertices", "sets", "box", "sphere"});
}

template <class V>
void fields(V& v, Pin& p) {
  v.about("Pin",
          "Vertices that are held, or moved by script: from start to "
          "stop they turn about an axis "
          "and are carried along a velocity (the rotation acts first), "
          "before and after they stand "
          "still; after release they are free.");
  v.object(Key{"region", "vertices to hold"}.needed(), p.region);
  v.value({"velocity", "velocity of the motion", "m/s"}, p.velocity, between(-1e4, 1e4));
  v.value({"axis", "direction of the axis of rotation, of any length but 0"}, p.axis, kLengths);
  v.value({"center", "a point on the axis of rotation", "m"}, p.center, kLengths);
  v.value({"rate", "angular velocity about the axis", "rad/s"}, p.rate, between(-1e4, 1e4));
  v.value({"start", "time at which the motion begins", "s"}, p.start, kTimes);
  v.value({"stop", "time at which the motion ends; absent: never", "s"}, p.stop, kTimes);
  v.value({"release", "time at which the vertices become free; absent: never", "s"}, p.release,
          kTimes);
}

template <class V>
void fields(V& v, Load& l) {
  v.about("Load", "A force that acts on some vertices for a while.");
  v.object(Key{"region", "vertices it acts on"}.needed(), l.region);
  v.value(
      Key{"force", "total force, shared by the vertices in proportion to their mass", "N"}.needed(),
      l.force, between(-1e9, 1e9));
  v.value({"start", "time at which it begins", "s"}, l.start, kTimes);
  v.value({"stop", "time at which it ends; absent: never", "s"}, l.stop, kTimes);
}

template <class V>
void fields(V& v, Cloth& c) {
  v.about("Cloth",
          "One piece of cloth. Its start shape is the mesh scaled, "
          "then rotated, then translated; "
          "its rest shape is what it is unstrained.");
  v.value({"name", "unique among the cloths"}, c.name, not_empty());
  v.object(Key{"mesh", "triangles"}.needed(), c.mesh);
  v.value(Key{"material", "name of an entry of materials"}.needed(), c.material, not_empty());
  v.choice({"rest", "rest shape"}, c.rest,
           {{"self", "the mesh as it was made or read, before scale"},
            {"uv", "flat: the texture coordinates of the mesh, in metres"},
            {"file", "positions from rest_file"}});
  v.value(Key{"rest_file",
              "mesh file of the same topology; a relative name "
              "starts at the folder of the scene"}
              .only(c.rest == "file", "\"rest\": \"file\""),
          c.rest_file, not_empty());
  v.value({"translate", "shift of the start shape", "m"}, c.translate, kLengths);
  v.value({"rotate", "rotation of the start shape about x, then y, then z", "degrees"}, c.rotate,
          between(-3600, 3600));
  v.value({"scale", "factors along x, y and z of the start shape, not of the rest shape"}, c.scale,
          above(0, 1e6));
  v.value({"velocity", "velocity at the start", "m/s"}, c.velocity, between(-1e4, 1e4));
  v.list({"pins", "vertices that are held or moved"}, c.pins);
  v.list({"loads", "forces on some of the vertices"}, c.loads);
}

template <class V>
void fields(V& v, Seam& s) {
  v.about("Seam",
          "Sewing. A vertex that is sewn onto an edge, onto any of its points, follows it exactly: "
          "seams need not conform, and cost no stiffness. They have no bending stiffness either. "
          "The side with more vertices follows (the second, `to`, if equal). Vertices that "
          "coincide become one; a vertex may be sewn onto one edge only. A pin on a sewn vertex "
          "holds the vertices that it follows.");
  v.value({"name", "for messages"}, s.name, not_empty());
  v.value({"cloth", "name of the cloth that is sewn; absent: the only one"}, s.cloth, not_empty());
  v.value({"to", "name of the cloth that it is sewn to; absent: itself"}, s.to, not_empty());
  v.value({"stitches",
           "list of [vertex, a, b, r], vertex of cloth, a and b of to, numbers from 0 in the order "
           "of the mesh's file: x_vertex = (1 - r) x_a + r x_b with r from 0 to 1"},
          s.stitches, indices());
  v.value({"chain",
           "vertices of cloth along a border, in order, each joined to the next by an edge; a "
           "closed chain ends with its first"},
          s.chain, indices());
  v.value(Key{"to_chain",
              "vertices of to, first to first and last to last, by fraction of the length at rest: "
              "the longer side is gathered"}
              .only(!s.chain.empty(), "chain"),
          s.to_chain, indices());
  v.value({"set",
           "name of a vertex set of cloth that runs along a border; it starts at the end with the "
           "lower number"},
          s.set, not_empty());
  v.value(Key{"to_set", "the same for to"}.only(!s.set.empty(), "set"), s.to_set, not_empty());
  v.value(Key{"reversed", "the first vertex of set meets the last one of to_set"}.only(
              !s.set.empty(), "set"),
          s.reversed);
  v.value({"file",
           "JSON file with chains (seams: a.verts, b.verts) or stitches (seam_stitches: lists of "
           "[vertex, a, b, r]) of cloth's mesh; a relative name starts at the folder of the scene"},
          s.file, not_empty());
  v.value({"distance",
           "border vertices within this distance of a border edge of to, in the start shape, are "
           "sewn onto it, unless they are already; at most an edge length",
           "m"},
          s.distance, above(0, 1e6));
  v.exactly_one({"stitches", "chain", "set", "file", "distance"});
  v.value({"close_time",
           "time in which an open seam closes; absent: it is closed from the start, and may be "
           "open by half a mean edge length there",
           "s"},
          s.close_time, above(0, 1e9));
}

template <class V>
void fields(V& v, Solver& s) {
  v.about("Solver",
          "How a step is solved; changes the speed, not the result "
          "that is approached.");
  v.choice(
      {"method", "time integrator"}, s.method,
      {{"dd_pd",
        "projective dynamics by domains, with an outer loop that `quality.accelerate` chooses"},
       {"vanilla_pd",
        "projective dynamics: local and global steps in "
        "turn, not accelerated"},
       {"newton",
        "Newton's method with a line search, for comparison: few iterations, each with a matrix "
        "of three times as many rows; `global`, `local` and domains play no part"},
       {"pd_jacobi",
        "projective dynamics with Jacobi sweeps and Chebyshev weights instead of the global "
        "solve, for comparison: many iterations, nothing is factored"},
       {"xpbd",
        "extended position-based dynamics, for comparison: constraint after constraint. It "
        "approaches the result of the others, but on seams and curved rest shapes only nearly"}});
  v.choice(
      {"hessian", "`method: newton`: second derivative of the energy"}, s.hessian,
      {{"projected", "made positive semidefinite, triangle by triangle"},
       {"unprojected",
        "as it is, and projected where that is not positive definite: quadratic convergence"}});
  v.choice({"linear", "`method: newton`: how the linear system is solved"}, s.linear,
           {{"cholmod", "sparse Cholesky factor in each iteration, on one thread"},
            {"pcg", "conjugate gradients with 3 x 3 diagonal blocks, in parallel, inexactly"}});
  v.value(
      {"chebyshev_rho",
       "`method: pd_jacobi`: spectral radius that the weights are made for; absent: from inertia"},
      s.chebyshev_rho, between(0, 0.999999));
  v.choice({"global", "global solve"}, s.global,
           {{"tree",
             "exact and parallel: nested dissection whose top cuts are the borders of the domains"},
            {"primal_dual",
             "exact and by domains, as the paper has it (corrected): multipliers where two domains "
             "meet, corners where more do"},
            {"single",
             "one sparse Cholesky factor of the whole system (CHOLMOD), on one thread: the "
             "baseline"}});
  v.choice(
      {"local", "local step"}, s.local,
      {{"jacobi", "all constraints projected at the same positions, in parallel"},
       {"gauss_seidel",
        "`method: dd_pd`: before that, constraint after constraint inside each domain, domains in "
        "parallel: the paper's local step, corrected. Fewer iterations, each dearer"},
       {"literal_eq12",
        "`method: dd_pd`, `accelerate: none`: the paper's Eq. 12 as printed. Biased: it does not "
        "approach the result of the others. For comparison only"}});
  v.value({"domains", "domains to divide the cloths into (1: undivided)"}, s.domains,
          between(1, 65536));
  v.value({"domain_weights",
           "share of the work that each domain gets, in any unit, one number per domain; absent: "
           "equal. `piecework tune` proposes them for processors with cores of several speeds"},
          s.domain_weights, between(1e-3, 1e3));
  v.value({"corner_fraction",
           "`global: primal_dual`: share of the vertices of two domains that become corners"},
          s.corner_fraction, between(0, 1));
  v.choice({"interface", "`global: primal_dual`: how the matrix of the multipliers is solved"},
           s.interface,
           {{"recursive", "sparse, by nested dissection, in parallel"},
            {"sparse", "sparse, by CHOLMOD on one thread"},
            {"dense", "dense, as the paper says; memory grows with vertices times domains"}});
  v.choice(
      {"seams", "how sewn vertices follow what carries them"}, s.seams,
      {{"elimination", "they have no unknowns; what acts on them acts on what carries them"},
       {"dual",
        "with `global: primal_dual` only: they keep unknowns of their own, and multipliers hold "
        "them in place, as the paper has it (corrected)"}});
  v.choice(
      {"contact",
       "`global: tree`: how the system with what contact adds to its diagonal is solved"},
      s.contact,
      {{"refactor", "exactly: the matrix is factored anew when the metric is"},
       {"adaptive", "conjugate gradients on the last factor until counts speak for a new one"},
       {"pcg_last_factor", "conjugate gradients on the first factor with contact"},
       {"low_rank", "the last factor, and Woodbury's formula for the few vertices that changed"},
       {"frozen_schur",
        "conjugate gradients; the interiors of the domains are factored anew, what joins them not"},
       {"woodbury_sd_pcg",
        "the paper's: steepest descent on the contacts, then conjugate gradients on the factor "
        "without contact; in residual form, so without its bias"},
       {"kinv_pcg", "conjugate gradients on the factor without contact"},
       {"jacobi_pcg", "conjugate gradients on the diagonal"},
       {"hybrid", "the same on the factor without contact, corrected on the contacts"},
       {"dual", "conjugate gradients on the contact forces"}});
  v.value({"threads", "worker threads; 0: what affinity and cgroup quota allow"}, s.threads,
          between(0, 1024));
}

/// The one table of what the presets mean. The numbers are chosen, not yet measured.
inline const Presets<Quality>& quality_presets() {
  static const Presets<Quality> presets = {
      {"preview", "for a first look", {.stop = "error", .tolerance = 1e-1, .max_iterations = 20}},
      {"default", "for results", {}},
      {"reference",
       "for a run that others are measured against",
       {.stop = "gradient", .tolerance = 1e-6, .max_iterations = 2000}}};
  return presets;
}

template <class V>
void fields(V& v, Quality& q) {
  v.about("Quality", "How accurately each step is solved.");
  v.preset({"preset", "defaults of the other keys; a key that is given wins over the preset"},
           q.preset, q, quality_presets());
  v.choice({"stop", "rule that ends the iterations of a step"}, q.stop,
           {{"error",
             "estimated position error 2 max(1, q / (1 - q)) |dx| <= tolerance * mean edge length; "
             "|dx| is the largest of the last 3 increments of a vertex, q their mean decay over up "
             "to 8 iterations"},
            {"gradient",
             "rms nodal force residual over free vertices <= "
             "tolerance * mean nodal weight"},
            {"dx_2",
             "2-norm of the increment over all vertices <= tolerance, "
             "lengths in units of the "
             "largest extent of the start shape's bounding box (the "
             "paper's unit box)"},
            {"dx_rms", "the same for the root mean square over the vertices"},
            {"dx_inf", "the same for the largest increment of a vertex"},
            {"iterations", "always max_iterations; tolerance is not used"}});
  v.value({"tolerance",
           "threshold, a pure number whose scale depends on stop: mean edge "
           "lengths (error), mean "
           "nodal weights (gradient), unit boxes (dx_2, dx_rms, dx_inf)"},
          q.tolerance, above(0, 1e6));
  v.value({"max_iterations", "the step ends after so many iterations, converged or not"},
          q.max_iterations, between(1, 1e9));
  v.value({"min_iterations", "the rule is not asked before so many iterations"}, q.min_iterations,
          between(1, 1e9));
  v.choice(
      {"accelerate", "`method: dd_pd`: how a step gets from one iterate to the next"}, q.accelerate,
      {{"lbfgs_kn",
        "L-BFGS whose metric is the global solve and, in steps that would take many iterations "
        "without it, a second matrix for motion along the normals, factored once per step: few "
        "iterations for stiff and fine cloth as well"},
       {"lbfgs", "L-BFGS whose metric is the global solve"},
       {"anderson", "Anderson acceleration of local and global steps"},
       {"chebyshev", "Chebyshev semi-iteration on local and global steps"},
       {"none", "local and global steps in turn"}});
  v.value({"window", "iterates that `accelerate: lbfgs_kn, lbfgs, anderson` remember"}, q.window,
          between(1, 32));
  v.choice({"precision", "numbers in which `global: tree` stores its factor"}, q.precision,
           {{"automatic",
             "32 bits for `method: dd_pd`, where the factor shapes the way to the result and not "
             "the result; else 64"},
            {"double", "64 bits: exact to rounding"},
            {"single",
             "32 bits: half the memory and nearly half the time; each global step, solved for the "
             "increment, is exact to about 4 digits. Where that is not enough for the matrix, 64 "
             "bits are used and the run says so"}});
  v.choice({"ccd", "root finder of continuous collision detection; both are conservative"}, q.ccd,
           {{"halley", "third order, the paper's"}, {"newton", "second order"}});
  v.choice({"newton",
            "`method: dd_pd`: when Newton's direction, by conjugate gradients in the metric, takes "
            "the place of the accelerated one"},
           q.newton,
           {{"touching", "while anything touches: few iterations, so few detections"},
            {"never", "never: `accelerate` alone, with contact in the global solve"}});
  v.value({"friction_renewals",
           "times that a converged step takes up the pressure that it has found, which friction is "
           "proportional to, and converges again; 0: that of the step before alone"},
          q.friction_renewals, between(0, 100));
  v.value({"pcg_tol",
           "`solver.contact` by conjugate gradients: residual at which they end, relative, as a "
           "displacement"},
          q.pcg_tol, above(0, 1));
  v.value({"pcg_max", "the same: iterations at most"}, q.pcg_max, between(1, 100000));
  v.value({"sd_iterations", "`contact: woodbury_sd_pcg`: steps of steepest descent"},
          q.sd_iterations, between(0, 100));
}

template <class V>
void fields(V& v, Camera& c) {
  v.about("Camera",
          "Point of view of the pictures. Without position it frames "
          "all frames itself.");
  v.value({"position", "eye; absent: chosen from azimuth and elevation", "m"}, c.position,
          kLengths);
  v.value({"target", "point in the middle of the picture; absent: the middle of the cloths", "m"},
          c.target, kLengths);
  v.value({"fov", "vertical field of view", "degrees"}, c.fov, between(1, 170));
  v.value({"azimuth", "direction of the eye about y, for automatic framing", "degrees"}, c.azimuth,
          between(-360, 360));
  v.value({"elevation", "height of the eye above the horizon, for automatic framing", "degrees"},
          c.elevation, between(-90, 90));
  v.value({"ground", "height of the ground plane; absent: below the cloths", "m"}, c.ground,
          kLengths);
}

template <class V>
void fields(V& v, Render& r) {
  v.about("Render", "What the pictures show.");
  v.choice({"color", "colour of the triangles"}, r.color,
           {{"domain", "one colour per domain"},
            {"dof", "domains pale, shared vertices as dots: duplicates and corners"},
            {"strain", "largest principal strain, with a colour bar"},
            {"contact", "pressure of contact, with a colour bar; only where things can touch"},
            {"shaded", "one colour, lit"}});
  v.value({"size", "width and height", "pixels"}, r.size, between(16, 8192));
  v.value({"borders", "dark lines between domains"}, r.borders);
  v.value({"mesh_lines", "thin lines along all edges"}, r.mesh_lines);
}

inline const Choices& quantities() {
  static const Choices choices = {
      {"lowest_y", "lowest height of a vertex, m"},
      {"highest_y", "greatest height of a vertex, m"},
      {"center_x", "centre of mass, x, m"},
      {"center_y", "centre of mass, y, m"},
      {"center_z", "centre of mass, z, m"},
      {"vertex_x", "x of the vertex, m"},
      {"vertex_y", "y of the vertex, m"},
      {"vertex_z", "z of the vertex, m"},
      {"max_strain", "largest |sigma - 1| over the triangles, sigma a principal stretch"},
      {"mean_strain", "mean over the triangles of the largest |sigma - 1|"},
      {"kinetic_energy", "kinetic energy, J"},
      {"max_speed", "largest speed of a vertex, m/s"},
      {"momentum_x", "linear momentum, x, kg m/s"},
      {"momentum_y", "linear momentum, y, kg m/s"},
      {"momentum_z", "linear momentum, z, kg m/s"},
      {"reaction_force_y", "total force of the pins on the cloth, y, N"},
      {"seam_gap", "largest distance of a sewn vertex from its place on the seam, m"},
      {"sewn_vertices", "vertices that follow others because of a seam"},
      {"gradient",
       "largest over the steps so far: rms nodal force residual "
       "over free vertices / "
       "mean nodal weight"},
      {"iterations", "mean iterations per step so far"},
      {"converged_steps", "fraction of the steps so far that met the stop rule"}};
  return choices;
}

template <class V>
void fields(V& v, Contact& c) {
  v.about("Contact",
          "How cloth pushes off what it touches. Two surfaces closer than the contact distance "
          "repel each other, and no step moves anything through anything.");
  v.value({"distance",
           "distance d at which contact begins, about the thickness of the cloth; absent: 1 mm, or "
           "a quarter of the mean edge length where that is less. At most half of it",
           "m"},
          c.distance, above(0, 1e3));
  v.value({"stiffness",
           "stiffness of one contact at rest; absent: from the cloth. More of it means closer to "
           "the contact distance, and harder steps",
           "N/m"},
          c.stiffness, above(0, 1e12));
  v.choice({"barrier", "energy of a contact at distance x < d"}, c.barrier,
           {{"two_stage", "stiffness / 2 (d - x)^2 down to d / 2, then a logarithm without end"},
            {"ipc", "the logarithmic barrier of incremental potential contact"},
            {"exponential", "an exponential, finite at x = 0"},
            {"none", "stiffness / 2 (d - x)^2, the paper's: finite at x = 0"}});
  v.value({"slip_speed", "below this speed friction is not yet fully developed", "m/s"},
          c.slip_speed, above(0, 1e3));
  v.value(
      {"check",
       "count edges that pass through triangles after every step, by a test that shares nothing "
       "with what prevents them"},
      c.check);
  v.value({"untangle",
           "a start that intersects is taken apart before the first step, in so many rounds at "
           "most; 0: off"},
          c.untangle, between(0, 100000));
}

template <class V>
void fields(V& v, Expectation& e) {
  v.about("Expectation", "What must be true of the run: min <= quantity <= max at a time.");
  v.choice(Key{"quantity", "what is measured"}.needed(), e.quantity, quantities());
  v.value({"at", "time; absent: the end of the run", "s"}, e.at, kTimes);
  v.value(Key{"vertex", "vertex number, in the order of the mesh's file"}.only(
              e.quantity.starts_with("vertex_"), "a vertex_* quantity"),
          e.vertex, indices());
  const bool of_run =
      e.quantity == "gradient" || e.quantity == "iterations" || e.quantity == "converged_steps";
  v.value(Key{"cloth", "name of the cloth that is measured; absent: all together"}.only(
              !of_run, "a quantity other than gradient, iterations, converged_steps"),
          e.cloth, not_empty());
  v.value({"min", "lower bound, in the unit of the quantity"}, e.min);
  v.value({"max", "upper bound, in the unit of the quantity"}, e.max);
  v.at_least_one({"min", "max"});
}

template <class V>
void fields(V& v, Scene& s) {
  v.about("Scene", "The whole file.");
  v.value({"name", "name in reports; absent: the file's name without .json"}, s.name, not_empty());
  v.value({"description", "one sentence for people"}, s.description);
  v.object({"step", "time stepping"}, s.step);
  v.value(Key{"gravity", "acceleration of free fall; null: off", "m/s^2"}.on(), s.gravity,
          between(-1e6, 1e6));
  v.object({"wind", "moving air; absent: off"}, s.wind);
  v.value(
      {"damping", "rate d at which velocities decay, by exp(-d h) per step; absent: off", "1/s"},
      s.damping, above(0, 1e6));
  v.value({"self_collision", "cloth touches cloth, its own included"}, s.self_collision);
  v.value({"friction", "coefficient of dry friction between what touches; absent: none"},
          s.friction, above(0, 100));
  v.value({"kinetic_friction",
           "coefficient of friction of what slides, at most `friction`; absent: `friction`"},
          s.kinetic_friction, between(0, 100));
  v.object({"contact", "how things touch"}, s.contact);
  v.object({"solver", "how a step is solved"}, s.solver);
  v.object({"quality", "how accurately a step is solved"}, s.quality);
  v.map(Key{"materials", "materials by name; cloths share them"}.needed(), s.materials);
  v.list(Key{"cloths", "pieces of cloth, at least one"}.needed(), s.cloths);
  v.list({"seams", "what is sewn together"}, s.seams);
  v.list({"colliders", "bodies that the cloths collide with"}, s.colliders);
  v.object({"camera", "point of view"}, s.camera);
  v.object({"render", "what the pictures show"}, s.render);
  v.list({"expect",
          "what must be true of the run; piecework run reports each "
          "and the tests check "
          "those of the shipped scenes"},
         s.expect);
}

}  // namespace piecework::scene
