#include <piecework/runner/methods.hpp>

#include <algorithm>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include <piecework/baselines/newton.hpp>
#include <piecework/baselines/pd_jacobi.hpp>
#include <piecework/baselines/vanilla_pd.hpp>
#include <piecework/baselines/xpbd.hpp>
#include <piecework/contact/contact.hpp>
#include <piecework/core/error.hpp>
#include <piecework/model/assembly.hpp>
#include <piecework/pd/dd_pd.hpp>
#include <piecework/pd/primal_dual_step.hpp>

namespace piecework::runner {
namespace {

model::StopRule stop_rule(const std::string& name) {
  if (name == "gradient") return model::StopRule::Gradient;
  if (name == "dx_2") return model::StopRule::Dx2;
  if (name == "dx_rms") return model::StopRule::DxRms;
  if (name == "dx_inf") return model::StopRule::DxInf;
  if (name == "iterations") return model::StopRule::Iterations;
  return model::StopRule::Error;
}

global::Precision tree_precision(const scene::Scene& scene) {
  const std::string& asked = scene.quality.precision;
  const bool single = asked == "single" || (asked == "automatic" && scene.solver.method == "dd_pd");
  return single ? global::Precision::Single : global::Precision::Double;
}

pd::AccelerationOptions acceleration(const scene::Quality& quality) {
  using enum pd::AccelerationKind;
  pd::AccelerationOptions options{.kind = Lbfgs, .window = quality.window};
  if (quality.accelerate == "none") options.kind = None;
  if (quality.accelerate == "chebyshev") options.kind = Chebyshev;
  if (quality.accelerate == "anderson") options.kind = Anderson;
  return options;
}

/// What every method is made from.
struct MethodContext {
  const World& world;
  double gravity;  ///< magnitude, m/s^2
  model::StopOptions stop;
};

MethodContext method_context(const World& world) {
  constexpr double kStandardGravity = 9.81;  // m/s^2: turns forces into weights where there is none
  const double gravity = world.forces.gravity ? world.forces.gravity->norm() : 0;
  const scene::Quality& quality = world.scene.quality;
  return {world,
          gravity > 0 ? gravity : kStandardGravity,
          {.rule = stop_rule(quality.stop),
           .tolerance = quality.tolerance,
           .max_iterations = quality.max_iterations,
           .min_iterations = quality.min_iterations}};
}

std::unique_ptr<model::Minimizer> make_newton(const MethodContext& context) {
  const scene::Solver& solver = context.world.scene.solver;
  return std::make_unique<baselines::Newton>(
      context.world.model, context.world.scene.step.h, context.gravity, context.stop,
      baselines::NewtonOptions{
          .hessian = solver.hessian == "unprojected" ? model::HessianForm::Unprojected
                                                     : model::HessianForm::Projected,
          .linear = solver.linear == "pcg" ? baselines::NewtonLinear::Pcg
                                           : baselines::NewtonLinear::Cholmod});
}

std::unique_ptr<model::Minimizer> make_vanilla_pd(const MethodContext& context) {
  return std::make_unique<baselines::VanillaPd>(context.world.model, context.world.scene.step.h,
                                                context.gravity, context.stop,
                                                make_exact_solver(context.world));
}

std::unique_ptr<model::Minimizer> make_pd_jacobi(const MethodContext& context) {
  return std::make_unique<baselines::PdJacobi>(
      context.world.model, context.world.scene.step.h, context.gravity, context.stop,
      baselines::PdJacobiOptions{.rho = context.world.scene.solver.chebyshev_rho,
                                 .gamma = std::nullopt});
}

std::unique_ptr<model::Minimizer> make_xpbd(const MethodContext& context) {
  return std::make_unique<baselines::Xpbd>(context.world.model, context.world.scene.step.h,
                                           context.gravity, context.stop);
}

std::optional<local::SweepOptions> sweeps(const scene::Solver& solver) {
  if (solver.local == "jacobi") return std::nullopt;
  return local::SweepOptions{.form = solver.local == "literal_eq12" ? local::SweepForm::LiteralEq12
                                                                    : local::SweepForm::Corrected};
}

global::DiagonalMethod contact_method(const std::string& name) {
  for (int i = 0; i < global::kNumDiagonalMethods; ++i) {
    const auto method = static_cast<global::DiagonalMethod>(i);
    if (name == to_string(method)) return method;
  }
  return global::DiagonalMethod::Refactor;
}

/// \throws InputError if the scene's global solve has no tree to solve on.
pd::ContactSolve contact_solve(const World& world) {
  const scene::Scene& scene = world.scene;
  pd::ContactSolve solve{.method = contact_method(scene.solver.contact),
                         .options = {},
                         .tolerance = scene.quality.pcg_tol,
                         .max_iterations = scene.quality.pcg_max};
  solve.options.domains = std::max(1, scene.solver.domains);
  solve.options.steps = scene.quality.sd_iterations;
  if (solve.method == global::DiagonalMethod::SteepestDescent)
    solve.options.elastic_weight =
        model::assemble_system(world.model, scene.step.h).diagonal().mean();
  if (solve.method != global::DiagonalMethod::Refactor && scene.solver.global != "tree")
    throw InputError(fmt::format(
        "{}: /solver/contact: \"{}\" works on the tree only; take `global: tree`, or `contact: "
        "refactor`",
        scene.source, scene.solver.contact));
  return solve;
}

std::unique_ptr<model::Minimizer> make_dd_pd(const MethodContext& context) {
  const scene::Scene& scene = context.world.scene;
  return std::make_unique<pd::DdPd>(
      context.world.model,
      pd::DdPdOptions{.h = scene.step.h,
                      .gravity = context.gravity,
                      .stop = context.stop,
                      .acceleration = acceleration(scene.quality),
                      .normals = scene.quality.accelerate == "lbfgs_kn" ? pd::NormalPart::Automatic
                                                                        : pd::NormalPart::Never,
                      .newton = scene.quality.newton == "never" ? pd::NewtonUse::Never
                                                                : pd::NewtonUse::Touching,
                      .contact_solve = contact_solve(context.world),
                      .friction_renewals = scene.quality.friction_renewals,
                      .sweeps = sweeps(scene.solver)},
      make_exact_solver(context.world), &context.world.domains);
}

contact::Barrier barrier(const std::string& name) {
  if (name == "none") return contact::Barrier::None;
  if (name == "ipc") return contact::Barrier::Ipc;
  if (name == "exponential") return contact::Barrier::Exponential;
  return contact::Barrier::TwoStage;
}

/// \throws InputError if the scene's solver would move cloth without asking contact.
void require_contact_solver(const scene::Scene& scene) {
  constexpr const char* kRemedy = "or leave out \"self_collision\" and \"colliders\"";
  if (scene.solver.method != "dd_pd")
    throw InputError(
        fmt::format("{}: /solver/method: \"{}\" knows nothing of contact; choose \"dd_pd\", {}",
                    scene.source, scene.solver.method, kRemedy));
  if (scene.solver.local != "jacobi")
    throw InputError(fmt::format(
        "{}: /solver/local: \"{}\" moves vertices without asking contact; write \"jacobi\", {}",
        scene.source, scene.solver.local, kRemedy));
}

}  // namespace

std::unique_ptr<global::ExactSolver> make_exact_solver(const World& world) {
  const scene::Solver& solver = world.scene.solver;
  if (solver.global == "single") return global::make_cholmod_solver();
  if (solver.global == "primal_dual") {
    pd::PrimalDualStepOptions options{.corner_fraction = solver.corner_fraction};
    options.seams = solver.seams == "dual" ? pd::SeamForm::Dual : pd::SeamForm::Elimination;
    options.solver.interface = solver.interface == "dense"    ? global::InterfaceKind::Dense
                               : solver.interface == "sparse" ? global::InterfaceKind::Sparse
                                                              : global::InterfaceKind::Recursive;
    return pd::make_primal_dual_solver(world.model, world.domains, world.scene.step.h, options);
  }
  global::VertexTree domains;
  if (world.domains.num_domains > 1) {
    for (const auto& node : world.domains.nodes) domains.node_parent.push_back(node.parent);
    domains.vertex_node = world.domains.vertex_node;
  }
  return global::make_tree_solver(std::move(domains), {.precision = tree_precision(world.scene)});
}

std::unique_ptr<model::Minimizer> make_minimizer(const World& world) {
  const MethodContext context = method_context(world);
  const std::string& method = world.scene.solver.method;
  if (method == "vanilla_pd") return make_vanilla_pd(context);
  if (method == "newton") return make_newton(context);
  if (method == "pd_jacobi") return make_pd_jacobi(context);
  if (method == "xpbd") return make_xpbd(context);
  return make_dd_pd(context);
}

double contact_distance(const World& world) {
  const double mean_edge = world.model.mean_edge;
  if (!world.scene.contact.distance) return std::min(1e-3, 0.25 * mean_edge);
  const double distance = *world.scene.contact.distance;
  if (distance <= 0.5 * mean_edge) return distance;
  throw InputError(fmt::format(
      "{}: /contact/distance: {:g} m is more than half of the mean edge length, {:g} m: neighbours "
      "would touch each other; take less, or a coarser mesh",
      world.scene.source, distance, mean_edge));
}

bool may_touch(const World& world) {
  return world.scene.self_collision || !world.analytic_colliders.empty() ||
         !world.mesh_colliders.empty();
}

void require_contact(const World& world) {
  if (!may_touch(world)) return;
  require_contact_solver(world.scene);
  (void)contact_distance(world);
}

std::unique_ptr<model::ContactTerms> make_contact(const World& world) {
  if (!may_touch(world)) return nullptr;
  require_contact(world);
  const scene::Scene& scene = world.scene;
  contact::ContactOptions options;
  options.h = scene.step.h;
  options.self = scene.self_collision;
  options.activation = {.barrier = barrier(scene.contact.barrier),
                        .distance = contact_distance(world),
                        .stiffness = scene.contact.stiffness
                                         ? *scene.contact.stiffness
                                         : contact::default_stiffness(world.model, scene.step.h)};
  if (scene.friction)
    options.friction = {*scene.friction, scene.kinetic_friction.value_or(*scene.friction)};
  options.slip_speed = scene.contact.slip_speed;
  options.ccd.method =
      scene.quality.ccd == "newton" ? collision::CcdMethod::Newton : collision::CcdMethod::Halley;
  options.check = scene.contact.check;
  return std::make_unique<contact::Contact>(
      world.model, options, contact::Colliders{world.analytic_colliders, world.mesh_colliders});
}

std::unique_ptr<model::Integrator> make_integrator(const World& world) {
  return std::make_unique<model::Integrator>(
      world.model, world.forces, world.pins,
      model::IntegratorOptions{.h = world.scene.step.h, .damping = world.scene.damping},
      make_minimizer(world), make_contact(world));
}

}  // namespace piecework::runner
