#include "extremes.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include <unistd.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <piecework/baselines/newton.hpp>
#include <piecework/core/atomic_file.hpp>
#include <piecework/core/clock.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/random.hpp>
#include <piecework/local/jacobi.hpp>
#include <piecework/model/assembly.hpp>
#include <piecework/model/convergence.hpp>
#include <piecework/model/measures.hpp>
#include <piecework/model/reduction.hpp>

namespace piecework::runner {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kStandardGravity = 9.81;  // m/s^2, as in make_minimizer()
constexpr int kSide = 20;                  // vertices
constexpr int kCells = (kSide - 1) * (kSide - 1);

/// "1e09", "0.5".
std::string name_of(double number) {
  std::string text = fmt::format("{:g}", number);
  std::erase(text, '+');
  return text;
}

bool is_driven(const World& world) {
  const auto moves = [](const model::Pin& pin) {
    return pin.rate != 0 || pin.velocity != Vec3::Zero();
  };
  return world.forces.wind || !world.forces.loads.empty() ||
         std::any_of(world.pins.begin(), world.pins.end(), moves);
}

/// Energies and momentum of a state, relative to the start: far from the origin too.
class Balance {
 public:
  Balance(const World& world, const model::State& start)
      : world_(world),
        start_(start.x),
        no_pins_(static_cast<std::size_t>(world.model.num_vertices()), 0),
        local_(world.model, world.scene.step.h),
        mass_(world.model.mass.sum()),
        gravity_(world.forces.gravity.value_or(Vec3::Zero())),
        momentum_(linear_momentum(world.model, start.v)),
        speed_(std::sqrt(start.v.rowwise().squaredNorm().maxCoeff())) {
    // A stop rule in lengths leaves energy: what a fall by one edge brings is the unit. Strains
    // are known to the rounding of coordinates; energies below that of such strains are 0.
    largest_ = mass_ * kStandardGravity * world.model.mean_edge;
    const double strain = 8 * kEpsilon * start.x.cwiseAbs().maxCoeff() / world.model.mean_edge;
    for (const model::StretchConstraint& c : world.model.stretch)
      largest_ += c.weight * strain * strain;
    energy_ = total(start);
  }

  /// Excess over the start, as a part of the largest energy so far.
  double drift(const model::State& state) {
    largest_ = std::max(largest_, moving(state));
    return largest_ > 0 ? (total(state) - energy_) / largest_ : 0;
  }

  [[nodiscard]] double momentum_error(const model::State& state) const {
    const Vec3 expected = momentum_ + mass_ * state.time * gravity_;
    const double speed = std::sqrt(2 * kinetic_energy(world_.model, state.v) / mass_);
    const double scale = mass_ * (std::max(speed, speed_) + state.time * gravity_.norm());
    return scale > 0 ? (linear_momentum(world_.model, state.v) - expected).norm() / scale : 0;
  }

 private:
  double moving(const model::State& state) {
    // Without inertia, since the "prediction" is x itself.
    const model::StepProblem still{&state.x, &no_pins_, &state.x};
    return kinetic_energy(world_.model, state.v) +
           local_.evaluate(state.x, still, gradient_).energy;
  }
  double total(const model::State& state) {
    const Vec3 lift = (state.x - start_).transpose() * world_.model.mass;
    return moving(state) - gravity_.dot(lift);
  }

  const World& world_;
  Positions start_, gradient_;
  std::vector<char> no_pins_;
  local::JacobiStep local_;
  double mass_;
  Vec3 gravity_, momentum_;
  double speed_, largest_ = 0, energy_ = 0;
};

/// A second opinion on each step: its gradient before and after, and where its minimum is.
class Referee {
 public:
  explicit Referee(const World& world)
      : world_(world),
        gravity_(world.forces.gravity && world.forces.gravity->norm() > 0
                     ? world.forces.gravity->norm()
                     : kStandardGravity),
        convergence_(world.model, gravity_, {}),
        local_(world.model, world.scene.step.h),
        stiffness_(assemble_system(world.model, world.scene.step.h).diagonal()) {}

  void begin(const model::StepProblem& problem) {
    predicted_ = *problem.predicted;
    fixed_ = *problem.fixed;
    previous_ = *problem.previous;
  }

  /// Gradient at x over that at the prediction; 0 where x is exact to rounding of positions.
  double left_of_gradient(const Positions& x, double time) {
    Positions start = predicted_;
    world_.model.sewing.settle(time, world_.model.mass, fixed_, start);
    const double before = gradient(start);
    const double after = gradient(x);
    return after <= rounding(x) ? 0 : after / before;
  }

  /// Distance to the minimum that Newton's method finds from x, in mean edges; 0 if it finds none.
  double error(const Positions& x) {
    Positions minimum = x;
    baselines::Newton newton(world_.model, world_.scene.step.h, gravity_,
                             {model::StopRule::Gradient, 1e-10, 30, 1});
    try {
      const auto report = newton.minimize({&predicted_, &fixed_, &previous_}, minimum);
      if (!std::isfinite(report.energy)) return 0;
    } catch (const Error&) {
      return 0;
    }
    return std::sqrt((minimum - x).rowwise().squaredNorm().maxCoeff()) / world_.model.mean_edge;
  }

  /// Gradients that rounding of coordinates alone can cause.
  [[nodiscard]] double rounding(const Positions& x) const {
    const double rms = std::sqrt(stiffness_.squaredNorm() / static_cast<double>(x.rows()));
    const double weight =
        world_.model.mass.sum() / static_cast<double>(world_.model.num_free()) * gravity_;
    return 4 * kEpsilon * x.cwiseAbs().maxCoeff() * rms / weight;
  }

 private:
  double gradient(const Positions& x) {
    local_.evaluate(x, {&predicted_, &fixed_, &previous_}, gradient_);
    model::StepReport report;
    convergence_.measure_gradient(model::Reduction(world_.model, fixed_), gradient_, report);
    return report.gradient;
  }

  const World& world_;
  double gravity_;
  model::Convergence convergence_;
  local::JacobiStep local_;
  Eigen::VectorXd stiffness_;
  Positions predicted_, previous_, gradient_;
  std::vector<char> fixed_;
};

void simulate(const Extreme& extreme, bool verify, ExtremeResult& result) {
  const auto world = build_world(extreme.scene);
  if (extreme.alter) extreme.alter(*world);
  const auto integrator = make_integrator(*world);
  model::State state = integrator->initial_state(world->part_velocity);
  integrator->prepare(state);
  Balance balance(*world, state);
  Referee referee(*world);
  integrator->observe([&](const model::StepProblem& problem) { referee.begin(problem); });
  while (state.step < extreme.scene.step.steps) {
    const model::StepReport report = integrator->step(state);
    ++result.steps;
    result.finite = result.finite && state.x.allFinite() && state.v.allFinite() &&
                    std::isfinite(report.gradient) && std::isfinite(report.energy);
    if (!result.finite) return;
    result.converged += report.converged ? 1 : 0;
    result.stalled += report.stalled ? 1 : 0;
    result.iterations += report.iterations;
    result.degenerate = std::max(result.degenerate, report.degenerate_projections);
    result.gradient = std::max(result.gradient, report.gradient);
    if (!report.converged)
      result.unsolved = std::max(result.unsolved, referee.left_of_gradient(state.x, state.time));
    else if (verify)
      result.error = std::max(result.error, referee.error(state.x));
    result.ms += report.step_ms;
    if (is_driven(*world)) continue;
    result.drift = std::max(result.drift, balance.drift(state));
    if (world->pins.empty())
      result.momentum = std::max(result.momentum, balance.momentum_error(state));
  }
}

// --- The scenes ---

scene::Cloth sheet(const std::string& name, const std::string& material) {
  scene::Cloth cloth{.name = name, .material = material};
  cloth.mesh.generator = "sheet";
  cloth.mesh.columns = cloth.mesh.rows = kSide;
  return cloth;
}

scene::Material& material(Extreme& extreme) { return extreme.scene.materials["cloth"]; }
scene::Cloth& cloth(Extreme& extreme) { return extreme.scene.cloths[0]; }

void stretch(Extreme& e, double value) {
  material(e).stretching = value;
  // The stop rule allows an error of position, whose energy grows with the stiffness.
  if (value >= 1e8) e.drift = 0.3;
}
void bending(Extreme& e, double value) { material(e).bending = value; }
void density(Extreme& e, double value) { material(e).density = value; }
void step_length(Extreme& e, double h) { e.scene.step.h = h; }

/// Cells that much longer than wide.
void slivers(Extreme& e, double aspect) { cloth(e).mesh.height /= aspect; }

void size(Extreme& e, double metres) {
  cloth(e).mesh.width *= metres;
  cloth(e).mesh.height *= metres;
}

void shrink_start(Extreme& e, std::array<double, 3> factors) { cloth(e).scale = factors; }

/// Also does to the world what another change does.
void also(Extreme& e, const std::function<void(World&)>& alter) {
  e.alter = [before = e.alter, alter](World& world) {
    if (before) before(world);
    alter(world);
  };
}

/// Triangles of which `soft` is true get 1e-8 of their stiffness.
void contrast(Extreme& e, const std::function<bool(std::size_t)>& soft) {
  also(e, [soft](World& world) {
    for (std::size_t t = 0; t < world.model.stretch.size(); ++t)
      if (soft(t)) world.model.stretch[t].weight *= 1e-8;
  });
}

/// A second sheet, of other cloth, sewn to the far side of the first.
void sew_on(Extreme& e, const scene::Material& other) {
  scene::Cloth second = sheet("other", "other");
  second.mesh = cloth(e).mesh;
  second.scale = cloth(e).scale;
  second.translate = cloth(e).translate;
  second.translate[2] += cloth(e).mesh.height;
  second.velocity = cloth(e).velocity;
  e.scene.materials["other"] = other;
  e.scene.cloths.push_back(second);
  e.scene.seams.push_back({.cloth = "sheet", .to = "other", .set = "top", .to_set = "bottom"});
}

/// Moves every vertex of the start by up to this far.
void shake(Extreme& e, double distance) {
  also(e, [distance](World& world) {
    Random random(7);
    for (Eigen::Index i = 0; i < world.model.start.size(); ++i)
      world.model.start.data()[i] += random.uniform(-distance, distance);
  });
}

/// Only the first triangle is left.
void one_triangle(Extreme& e) {
  const auto path =
      std::filesystem::temp_directory_path() / fmt::format("piecework_triangle_{}.obj", ::getpid());
  write_file_atomically(path, "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n");
  cloth(e).mesh = {};
  cloth(e).mesh.file = path.string();
  if (!cloth(e).pins.empty()) cloth(e).pins = {{.region = {.vertices = {0}}}};
}

void pin_everything(Extreme& e) {
  cloth(e).pins.clear();
  also(e, [](World& world) {
    model::Pin pin;
    for (int v = 0; v < world.model.num_vertices(); ++v) pin.vertices.push_back(v);
    world.pins = {pin};
  });
}

void wind(Extreme& e, double speed) { e.scene.wind = scene::Wind{.velocity = {0, speed, speed}}; }

/// Not held, and turned so that no edge is parallel to an axis.
void free_fall(Extreme& e) {
  cloth(e).pins.clear();
  cloth(e).rotate = {20, 30, 40};
}

}  // namespace

ExtremeResult run_extreme(const Extreme& extreme, bool verify) {
  ExtremeResult result;
  try {
    simulate(extreme, verify, result);
  } catch (const Error& error) {
    result.refusal = error.what();
  }
  return result;
}

std::string fault_of(const Extreme& extreme, const ExtremeResult& result) {
  if (!result.finite) return "not finite";
  if (!result.refusal.empty()) {
    // A reason and what to do about it are parted by a semicolon, everywhere.
    return result.refusal.find(';') == std::string::npos ? "refused without a remedy" : "";
  }
  const auto above = [](const char* what, double value, double limit) {
    return value <= limit ? std::string()
                          : fmt::format("{} {:.2g} is above {:.2g}; ", what, value, limit);
  };
  return above("energy drift", result.drift, extreme.drift) +
         above("momentum error", result.momentum, extreme.momentum) +
         above("rest of the gradient of unsolved steps", result.unsolved, extreme.unsolved) +
         above("error of solved steps", result.error, extreme.error);
}

Extreme ordinary_cloth() {
  Extreme extreme;
  scene::Scene& scene = extreme.scene;
  scene.step.steps = 4;
  scene.solver.domains = 4;
  scene.materials["cloth"] = {.density = 0.2, .stretching = 1e3, .bending = 1e-5};
  scene.cloths = {sheet("sheet", "cloth")};
  scene.cloths[0].pins = {{.region = {.vertices = {0, kSide - 1}}}};
  return extreme;
}

std::vector<Change> changes() {
  const auto value = [](const char* name, void (*function)(Extreme&, double), double number) {
    return Change{fmt::format("{}_{}", name, name_of(number)),
                  [=](Extreme& e) { function(e, number); }};
  };
  std::vector<Change> all;
  for (const double k : {1.0, 1e2, 1e5, 1e6, 1e7, 1e8, 1e9})
    all.push_back(value("stretch", stretch, k));
  for (const double d : {0.0, 1e-3, 1.0, 1e3}) all.push_back(value("bending", bending, d));
  for (const double rho : {1e-3, 1e2, 1e4}) all.push_back(value("density", density, rho));
  for (const double h : {1.0 / 2000, 1.0 / 30, 1.0 / 5}) all.push_back(value("h", step_length, h));
  for (const double aspect : {1e2, 1e4, 1e5}) all.push_back(value("slivers", slivers, aspect));
  for (const double metres : {1e-3, 1e3}) all.push_back(value("size", size, metres));
  all.push_back(value("wind", wind, 10));
  const auto add = [&](const char* name, std::function<void(Extreme&)> apply) {
    all.push_back({name, std::move(apply)});
  };
  add("far", [](Extreme& e) { cloth(e).translate = {1e6, 1e6, 1e6}; });
  add("contrast_halves", [](Extreme& e) { contrast(e, [](std::size_t t) { return t < kCells; }); });
  add("contrast_mixed",
      [](Extreme& e) { contrast(e, [](std::size_t t) { return t * 7 % 5 < 2; }); });
  add("seam_to_soft", [](Extreme& e) {
    sew_on(e, {.density = material(e).density, .stretching = 1e-8 * material(e).stretching});
  });
  add("seam_to_stiff", [](Extreme& e) {
    sew_on(e, {.density = material(e).density, .stretching = 1e9, .bending = 1.0});
  });
  for (const int domains : {1, 32, 2 * kCells})
    add(fmt::format("domains_{}", domains).c_str(),
        [=](Extreme& e) { e.scene.solver.domains = domains; });
  add("pinned", pin_everything);
  add("free", free_fall);
  add("one_triangle", one_triangle);
  add("two_triangles", [](Extreme& e) {
    cloth(e).mesh.columns = cloth(e).mesh.rows = 2;
    if (!cloth(e).pins.empty()) cloth(e).pins = {{.region = {.vertices = {0, 1}}}};
  });
  add("fast", [](Extreme& e) { cloth(e).velocity = {600, -600, 500}; });
  add("line", [](Extreme& e) { shrink_start(e, {1, 1, 0}); });
  add("point", [](Extreme& e) { shrink_start(e, {0, 0, 0}); });
  add("almost_line", [](Extreme& e) {
    shrink_start(e, {1, 1, 0});
    shake(e, 1e-9);
  });
  add("almost_point", [](Extreme& e) {
    shrink_start(e, {0, 0, 0});
    shake(e, 1e-9);
  });
  add("inflated", [](Extreme& e) { shrink_start(e, {100, 1, 100}); });
  add("crumpled", [](Extreme& e) { shake(e, 0.3); });
  add("no_gravity", [](Extreme& e) { e.scene.gravity.reset(); });
  add("single", [](Extreme& e) { e.scene.quality.precision = "single"; });
  add("double", [](Extreme& e) { e.scene.quality.precision = "double"; });
  add("primal_dual", [](Extreme& e) { e.scene.solver.global = "primal_dual"; });
  add("cholmod", [](Extreme& e) { e.scene.solver.global = "single"; });
  add("gradient_rule", [](Extreme& e) {
    e.scene.quality.stop = "gradient";
    e.scene.quality.tolerance = 1e-3;
  });
  return all;
}

Extreme changed_by(const std::vector<std::string>& names) {
  static const std::vector<Change> all = changes();
  Extreme extreme = ordinary_cloth();
  for (const std::string& name : names) {
    const auto found = std::find_if(all.begin(), all.end(),
                                    [&](const Change& change) { return change.name == name; });
    if (found == all.end())
      throw InputError(fmt::format("no change is named {}; see changes()", name));
    found->apply(extreme);
  }
  extreme.name = fmt::format("{}", fmt::join(names, "+"));
  extreme.scene.name = extreme.scene.source = extreme.name;
  return extreme;
}

std::vector<Extreme> extremes() {
  std::vector<Extreme> all;
  for (const Change& change : changes()) all.push_back(changed_by({change.name}));
  using Names = std::vector<std::string>;
  for (const Names& names : {
           // Positions known to 1e-10 m, strains to 1e-8, forces to 10 N: energies are noise.
           Names{"stretch_1e09", "far"},
           {"stretch_1e09", "far", "single", "gradient_rule"},
           {"stretch_1e09", "far", "h_0.0005"},
           {"slivers_10000", "far"},
           // Kn is noise in 32 bits: it led nowhere, or slowly, and the steps passed for solved.
           {"stretch_1e09", "wind_10"},
           {"stretch_1e09", "bending_0.001"},
           {"stretch_1e09", "fast"},
           {"slivers_10000", "single"},
           {"size_0.001", "bending_0.001"},
           {"size_0.001", "h_0.0333333"},
           {"size_0.001", "stretch_100"},
           // Contrast.
           {"contrast_mixed", "stretch_1e09", "primal_dual"},
           {"contrast_mixed", "stretch_1e09", "single"},
           {"contrast_halves", "h_0.2", "single"},
           {"contrast_halves", "stretch_1e09", "cholmod"},
           {"seam_to_soft", "stretch_1e09"},
           {"seam_to_stiff", "h_0.2", "primal_dual"},
           {"seam_to_stiff", "density_0.001", "wind_10"},
           // Free cloth.
           {"density_0.001", "wind_10", "single", "free"},
           {"free", "crumpled"},
           {"free", "crumpled", "stretch_1e08"},
           {"free", "inflated"},
           {"free", "point"},
           {"free", "fast", "stretch_1e09", "h_0.2"},
           {"one_triangle", "free", "fast"},
           {"one_triangle", "point"},
           {"pinned", "far", "primal_dual"},
           {"slivers_100000", "size_1000"},
           {"bending_1000", "crumpled"},
           {"domains_722", "primal_dual"},
       })
    all.push_back(changed_by(names));
  return all;
}

}  // namespace piecework::runner
