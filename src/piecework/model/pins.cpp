#include <piecework/model/pins.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

namespace piecework::model {

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
