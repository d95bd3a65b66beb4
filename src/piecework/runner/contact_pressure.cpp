#include <piecework/runner/contact_pressure.hpp>

#include <cmath>
#include <limits>

#include <piecework/core/parallel.hpp>
#include <piecework/runner/methods.hpp>

namespace piecework::runner {

std::vector<float> contact_pressure(const World& world, const Positions& x, double time) {
  const model::ClothModel& model = world.model;
  // A step of no length: everything is where it is at `time`.
  const std::vector<char> held(static_cast<std::size_t>(model.num_vertices()), 0);
  const model::StepProblem still{.predicted = &x, .fixed = &held, .previous = &x};
  const auto contact = make_contact(world);
  contact->begin_step(still, time, time, {});
  Positions force = Positions::Zero(x.rows(), 3);
  contact->evaluate(x, force);

  std::vector<double> area(held.size(), 0);  // of a vertex: a third of its triangles at rest
  for (const model::StretchConstraint& c : model.stretch)
    for (const int v : c.vertices)
      area[static_cast<std::size_t>(v)] += 1 / (6 * std::abs(c.rest_inverse.determinant()));
  std::vector<float> pressure(model.stretch.size());
  parallel_for(pressure.size(), [&](std::size_t t) {
    double sum = 0;
    for (const int v : model.stretch[t].vertices)
      sum += force.row(v).norm() / area[static_cast<std::size_t>(v)] / 3;
    pressure[t] =
        std::isfinite(sum) ? static_cast<float>(sum) : std::numeric_limits<float>::infinity();
  });
  return pressure;
}

}  // namespace piecework::runner
