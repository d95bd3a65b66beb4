#pragma once

// Private to the module: the keys of how steps are solved, how accurately, and of contact, a part
// of the table in scene_fields.hpp.

#include <piecework/scene/scene.hpp>
#include <piecework/scene/scene_keys.hpp>

namespace piecework::scene {

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

/// The one table of what the presets mean. The numbers are points on the
/// measured front of time against error (results/tables/front.md).
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

}  // namespace piecework::scene
