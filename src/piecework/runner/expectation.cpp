#include <piecework/runner/expectation.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include <piecework/core/error.hpp>
#include <piecework/local/jacobi.hpp>
#include <piecework/model/measures.hpp>

namespace piecework::runner {
namespace {

/// Rows of one cloth, or of all.
struct Rows {
  int first = 0;
  int count = 0;
};

Rows vertices_of(const World& world, int part) {
  if (part < 0) return {0, world.model.num_vertices()};
  const auto& range = world.model.parts[static_cast<std::size_t>(part)];
  return {range.first_vertex, range.num_vertices};
}

Rows triangles_of(const World& world, int part) {
  if (part < 0) return {0, static_cast<int>(world.model.triangles.size())};
  const auto& range = world.model.parts[static_cast<std::size_t>(part)];
  return {range.first_triangle, range.num_triangles};
}

Eigen::Index axis_of(const std::string& quantity) { return quantity.back() - 'x'; }

/// Force of the pins on the cloth: what holds their vertices against elasticity and weight, N. What
/// pulls at sewn vertices pulls at their carriers.
Vec3 reaction(const World& world, const model::State& state, Rows rows) {
  const std::vector<char> held =
      model::PinScript(world.pins, world.model.start).fixed_at(state.time);
  const std::vector<char> none(held.size(), 0);
  local::JacobiStep local(world.model, 1.0);
  Positions elastic;
  local.evaluate(state.x, {&state.x, &none, &state.x}, elastic);  // z = x: no inertia
  if (world.forces.gravity) elastic -= world.model.mass * world.forces.gravity->transpose();
  world.model.sewing.fold(elastic);
  Vec3 sum = Vec3::Zero();
  for (int v = rows.first; v < rows.first + rows.count; ++v)
    if (held[static_cast<std::size_t>(v)]) sum += elastic.row(v).transpose();
  return sum;
}

double seam_gap(const World& world, const Positions& x, Rows rows) {
  const model::Sewing& sewing = world.model.sewing;
  double gap = 0;
  for (int s = 0; s < sewing.map().num_slaves(); ++s) {
    const int v = sewing.map().slaves[static_cast<std::size_t>(s)];
    if (v >= rows.first && v < rows.first + rows.count) gap = std::max(gap, sewing.gap(x, s));
  }
  return gap;
}

double sewn_vertices(const World& world, Rows rows) {
  const auto& slaves = world.model.sewing.map().slaves;
  return static_cast<double>(std::count_if(slaves.begin(), slaves.end(), [&](int v) {
    return v >= rows.first && v < rows.first + rows.count;
  }));
}

double of_frames(const std::string& quantity, const std::vector<FrameRecord>& frames) {
  if (quantity == "gradient") {
    double largest = 0;
    for (const FrameRecord& frame : frames) largest = std::max(largest, frame.gradient);
    return largest;
  }
  const Totals sum = totals(frames);
  const int counted = quantity == "iterations" ? sum.iterations : sum.converged_steps;
  return static_cast<double>(counted) / std::max(1, sum.steps);
}

std::string describe(const scene::Expectation& e) {
  std::string text = e.quantity;
  if (e.vertex) text += fmt::format(" of vertex {}", *e.vertex);
  if (!e.cloth.empty()) text += fmt::format(" of {}", e.cloth);
  text += e.at ? fmt::format(" at {:g} s", *e.at) : std::string(" at the end");
  const auto bound = [](const std::optional<double>& value) {
    return value ? fmt::format("{:.10g}", *value) : std::string("any");
  };
  return text + fmt::format(": {} to {}", bound(e.min), bound(e.max));
}

}  // namespace

ExpectationChecker::ExpectationChecker(const World& world) : world_(world) {
  for (std::size_t i = 0; i < world.scene.expect.size(); ++i) {
    const scene::Expectation& e = world.scene.expect[i];
    const std::string where = fmt::format("{}: /expect/{}", world.scene.source, i);
    Item item{.expectation = &e};
    item.result.text = describe(e);
    const auto& parts = world.model.parts;
    if (!e.cloth.empty()) {
      const auto found = std::find_if(parts.begin(), parts.end(),
                                      [&](const auto& part) { return part.name == e.cloth; });
      if (found == parts.end())
        throw InputError(fmt::format("{}/cloth: no cloth is called \"{}\"", where, e.cloth));
      item.part = static_cast<int>(found - parts.begin());
    }
    if (e.vertex)
      item.vertex = world.vertex(static_cast<std::size_t>(std::max(0, item.part)), *e.vertex,
                                 where + "/vertex");
    items_.push_back(std::move(item));
  }
}

void ExpectationChecker::observe(const model::State& state,
                                 const std::vector<FrameRecord>& frames) {
  const double half_step = 0.5000001 * world_.scene.step.h;
  for (Item& item : items_)
    if (!item.result.reached && item.expectation->at &&
        std::abs(state.time - *item.expectation->at) <= half_step)
      evaluate(item, state, frames);
}

void ExpectationChecker::finish(const model::State& state, const std::vector<FrameRecord>& frames) {
  for (Item& item : items_)
    if (!item.result.reached && !item.expectation->at) evaluate(item, state, frames);
}

std::vector<ExpectationResult> ExpectationChecker::results() const {
  std::vector<ExpectationResult> results;
  for (const Item& item : items_) results.push_back(item.result);
  return results;
}

void ExpectationChecker::restore(const std::vector<ExpectationResult>& results) {
  for (Item& item : items_)
    for (const ExpectationResult& result : results) {
      if (!item.expectation->at || result.text != item.result.text) continue;
      item.result = result;
    }
}

void ExpectationChecker::evaluate(Item& item, const model::State& state,
                                  const std::vector<FrameRecord>& frames) const {
  const scene::Expectation& e = *item.expectation;
  item.result.reached = true;
  item.result.value = measure(item, state, frames);
  const double infinity = std::numeric_limits<double>::infinity();
  item.result.holds = item.result.value >= e.min.value_or(-infinity) &&
                      item.result.value <= e.max.value_or(infinity);
}

double ExpectationChecker::measure(const Item& item, const model::State& state,
                                   const std::vector<FrameRecord>& frames) const {
  const std::string& quantity = item.expectation->quantity;
  const Rows rows = vertices_of(world_, item.part);
  const auto x = state.x.middleRows(rows.first, rows.count);
  const auto v = state.v.middleRows(rows.first, rows.count);
  const auto mass = world_.model.mass.segment(rows.first, rows.count);
  if (quantity == "lowest_y") return x.col(1).minCoeff();
  if (quantity == "highest_y") return x.col(1).maxCoeff();
  if (quantity.starts_with("center_"))
    return model::center_of_mass(world_.model, state.x, rows.first, rows.count)[axis_of(quantity)];
  if (quantity.starts_with("vertex_")) return state.x(item.vertex, axis_of(quantity));
  if (quantity.starts_with("momentum_")) return v.col(axis_of(quantity)).dot(mass);
  if (quantity == "kinetic_energy") return 0.5 * mass.dot(v.rowwise().squaredNorm());
  if (quantity == "max_speed") return v.rowwise().norm().maxCoeff();
  if (quantity == "reaction_force_y") return reaction(world_, state, rows).y();
  if (quantity == "seam_gap") return seam_gap(world_, state.x, rows);
  if (quantity == "sewn_vertices") return sewn_vertices(world_, rows);
  if (quantity == "max_strain" || quantity == "mean_strain") {
    const std::vector<float> strain = model::triangle_strain(world_.model, state.x);
    const Rows triangles = triangles_of(world_, item.part);
    const Eigen::Map<const Eigen::ArrayXf> part(strain.data() + triangles.first, triangles.count);
    return quantity == "max_strain" ? part.maxCoeff() : part.cast<double>().mean();
  }
  return of_frames(quantity, frames);
}

}  // namespace piecework::runner
