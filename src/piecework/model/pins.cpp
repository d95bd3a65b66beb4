#include <piecework/model/pins.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include <piecework/core/error.hpp>

namespace piecework::model {
namespace {

bool move_alike(const Pin& p, const Pin& q) {
  return p.velocity == q.velocity && p.axis == q.axis && p.center == q.center && p.rate == q.rate &&
         p.start == q.start && p.stop == q.stop && p.release == q.release;
}

/// A carrier that a pin holds because of a slave.
struct Held {
  std::size_t pin;
  int slave;
  int carrier;
};

void refuse_conflicts(const std::vector<Pin>& pins, const std::vector<Held>& through_seams,
                      const PinNames& names) {
  for (const Held& held : through_seams)
    for (std::size_t q = 0; q < pins.size(); ++q) {
      const auto& others = pins[q].vertices;
      if (q == held.pin || move_alike(pins[q], pins[held.pin]) ||
          !std::binary_search(others.begin(), others.end(), held.carrier))
        continue;
      throw InputError(fmt::format(
          "{}: holds {}, which is sewn onto {}; that is held by {} as well, which moves or ends "
          "differently; give both the same motion, or pin one side of the seam only",
          names.pin(held.pin), names.vertex(held.slave), names.vertex(held.carrier), names.pin(q)));
    }
}

}  // namespace

std::vector<Pin> pins_on_carriers(std::vector<Pin> pins, const mesh::SeamMap& seams,
                                  const PinNames& names) {
  if (seams.empty()) return pins;
  std::vector<Held> through_seams;
  for (std::size_t p = 0; p < pins.size(); ++p) {
    std::vector<int> vertices;
    for (const int v : pins[p].vertices)
      seams.visit_carriers(v, [&](int carrier, double) {
        vertices.push_back(carrier);
        if (carrier != v) through_seams.push_back({p, v, carrier});
      });
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    pins[p].vertices = std::move(vertices);
  }
  refuse_conflicts(pins, through_seams, names);
  return pins;
}

PinScript::PinScript(std::vector<Pin> pins, const Positions& start)
    : pins_(std::move(pins)), start_(start) {
  for (Pin& pin : pins_) pin.axis.normalize();
}

bool PinScript::holds(const Pin& pin, double time) { return !pin.release || time < *pin.release; }

std::vector<char> PinScript::fixed_at(double time) const {
  std::vector<char> fixed(static_cast<std::size_t>(start_.rows()), 0);
  for (const Pin& pin : pins_)
    if (holds(pin, time))
      for (const int vertex : pin.vertices) fixed[static_cast<std::size_t>(vertex)] = 1;
  return fixed;
}

void PinScript::place(double time, Positions& x) const {
  for (const Pin& pin : pins_) {
    if (!holds(pin, time)) continue;
    const double end = pin.stop.value_or(std::numeric_limits<double>::infinity());
    const double moved = std::max(0.0, std::min(time, end) - pin.start);
    const Mat3 rotation = Eigen::AngleAxisd(pin.rate * moved, pin.axis).toRotationMatrix();
    for (const int vertex : pin.vertices) {
      const Vec3 from = start_.row(vertex).transpose();
      // A pin that does not move keeps its start position to the last bit.
      const Vec3 turned = pin.rate == 0 ? from : Vec3(rotation * (from - pin.center) + pin.center);
      x.row(vertex) = (turned + moved * pin.velocity).transpose();
    }
  }
}

}  // namespace piecework::model
