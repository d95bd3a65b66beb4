// Cameras: the view basis and the exact fit of a box into a frustum.

#include <renderer/view.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <piecework/core/error.hpp>

namespace piecework::render {
namespace {

constexpr double kMargin = 0.86;  // part of the picture's half width that the box may fill; chosen

double radians(double degrees) { return degrees * std::numbers::pi / 180.0; }

void check_fov(double fov_degrees) {
  if (!(fov_degrees >= 1.0 && fov_degrees <= 170.0)) {
    throw InputError("camera: fov_degrees: must be within 1 ... 170");
  }
}

/// Unit vector across `direction`: the part of `up` at right angles to it, or any other vector at
/// right angles where `up` is parallel to it.
Vec3 orthogonal_up(const Vec3& direction, const Vec3& up) {
  for (const Vec3& candidate : {up, Vec3(0, 0, -1), Vec3(1, 0, 0)}) {
    const double length = candidate.norm();
    if (!(length > 0) || !std::isfinite(length)) continue;
    const Vec3 unit = candidate / length;
    const Vec3 across = unit - unit.dot(direction) * direction;
    if (across.norm() > 1e-4) return across.normalized();
  }
  return Vec3(0, 1, 0);
}

/// Where to put the eye along one picture axis: limits |offset| <= slope * depth of all points.
struct AxisFit {
  double shift;     ///< of the eye across the view direction
  double distance;  ///< of the eye from the centre, at least
};

AxisFit fit_axis(const std::array<Vec3, 8>& points, int axis, double slope) {
  double plus = -std::numeric_limits<double>::infinity();
  double minus = plus;
  for (const Vec3& p : points) {  // p.z() is the depth relative to the centre
    plus = std::max(plus, p[axis] - slope * p.z());
    minus = std::max(minus, -p[axis] - slope * p.z());
  }
  return {(plus - minus) / 2, (plus + minus) / (2 * slope)};
}

}  // namespace

ViewBasis view_basis(const Camera& camera) {
  check_fov(camera.fov_degrees);
  if (!camera.eye.allFinite() || !camera.target.allFinite() || !camera.up.allFinite()) {
    throw InputError("camera: eye, target and up must be finite numbers");
  }
  const Vec3 forward = camera.target - camera.eye;
  const double distance = forward.norm();
  if (!(distance > 0) || !std::isfinite(distance)) {
    throw InputError("camera: eye and target are the same point; move one of them");
  }
  ViewBasis basis;
  basis.forward = forward / distance;
  basis.up = orthogonal_up(basis.forward, camera.up);
  basis.right = basis.forward.cross(basis.up);
  basis.slope = std::tan(radians(camera.fov_degrees) / 2);
  return basis;
}

Camera frame_box(const Vec3& low, const Vec3& high, double aspect, double azimuth_degrees,
                 double elevation_degrees, double fov_degrees) {
  check_fov(fov_degrees);
  if (!low.allFinite() || !high.allFinite() || !(high.array() >= low.array()).all()) {
    throw InputError("camera: the box to frame is empty or not finite");
  }
  if (!(aspect > 0) || !std::isfinite(aspect) || !std::isfinite(azimuth_degrees) ||
      !std::isfinite(elevation_degrees)) {
    throw InputError("camera: aspect must be positive, azimuth and elevation finite");
  }
  const double azimuth = radians(azimuth_degrees);
  const double elevation = radians(std::clamp(elevation_degrees, -90.0, 90.0));
  const Vec3 back(std::cos(elevation) * std::sin(azimuth), std::sin(elevation),
                  std::cos(elevation) * std::cos(azimuth));
  const Vec3 centre = low / 2 + high / 2;
  Camera camera;
  camera.fov_degrees = fov_degrees;
  // From straight above or below, "up" in the picture is where the viewer would look to.
  const bool vertical = std::abs(back.y()) > 0.9999;
  camera.up = vertical ? Vec3(-std::sin(azimuth), 0, -std::cos(azimuth)) : Vec3(0, 1, 0);
  camera.eye = centre + back;
  camera.target = centre;
  const ViewBasis basis = view_basis(camera);

  std::array<Vec3, 8> corners;
  for (int i = 0; i < 8; ++i) {
    const Vec3 corner((i & 1) != 0 ? high.x() : low.x(), (i & 2) != 0 ? high.y() : low.y(),
                      (i & 4) != 0 ? high.z() : low.z());
    const Vec3 offset = corner - centre;
    corners[i] = {offset.dot(basis.right), offset.dot(basis.up), offset.dot(basis.forward)};
  }
  const AxisFit across = fit_axis(corners, 0, kMargin * basis.slope * aspect);
  const AxisFit along = fit_axis(corners, 1, kMargin * basis.slope);
  double distance = std::max(across.distance, along.distance);
  if (!(distance > 0)) distance = 1.0;  // a point: any distance shows it
  camera.target = centre + across.shift * basis.right + along.shift * basis.up;
  camera.eye = camera.target + distance * back;
  return camera;
}

}  // namespace piecework::render
