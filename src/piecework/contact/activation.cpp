#include <piecework/contact/activation.hpp>

#include <algorithm>
#include <cmath>

namespace piecework::contact {
namespace {

ActivationValue quadratic(double kappa, double gap) {
  return {0.5 * kappa * gap * gap, -kappa * gap, kappa};
}

ActivationValue two_stage(double kappa, double dhat, double d) {
  const double tau = 0.5 * dhat;
  if (d >= tau) return quadratic(kappa, dhat - d);
  // -a ln d with slope and curvature of the parabola at tau: a / tau = kappa tau.
  const double a = kappa * tau * tau;
  return {0.5 * kappa * tau * tau + a * std::log(tau / d), -a / d, a / (d * d)};
}

ActivationValue logarithmic(double kappa, double dhat, double d) {
  // Curvature of (1 - r)^2 ln(1 / r) at r = 1/2 is 2 ln 2 + 5.
  const double c = kappa / (2 * std::log(2.0) + 5);
  const double r = d / dhat, gap = 1 - r, log_r = std::log(r);
  return {-c * dhat * dhat * gap * gap * log_r, c * dhat * (2 * gap * log_r - gap * gap / r),
          c * (-2 * log_r + 4 * gap / r + gap * gap / (r * r))};
}

ActivationValue exponential(double kappa, double dhat, double d) {
  constexpr double kSteepness = 4;
  const double rate = kSteepness / dhat;
  const double u = rate * (dhat - d);
  const double c = kappa / (rate * rate * std::exp(0.5 * kSteepness));
  return {c * (std::expm1(u) - u), -c * rate * std::expm1(u), c * rate * rate * std::exp(u)};
}

}  // namespace

ActivationValue Activation::operator()(double d) const {
  switch (barrier) {
    case Barrier::None:
      return quadratic(stiffness, distance - d);
    case Barrier::TwoStage:
      return two_stage(stiffness, distance, d);
    case Barrier::Ipc:
      return logarithmic(stiffness, distance, d);
    case Barrier::Exponential:
      return exponential(stiffness, distance, d);
  }
  return {};
}

FrictionValue smoothed_friction(double y, double slip, double sliding) {
  const double r = y / slip;
  if (y < slip) return {slip * r * r * (1 - r / 3), (2 - r) / slip};
  // The force loses (1 - sliding) t^2 (3 - 2 t) until t = 1; the energy loses the integral of that.
  const double t = std::min(r - 1, 1.0), past = std::max(y - 2 * slip, 0.0);
  const double lost = slip * t * t * t * (1 - 0.5 * t) + past;
  return {y - slip / 3 - (1 - sliding) * lost, (1 - (1 - sliding) * t * t * (3 - 2 * t)) / y};
}

}  // namespace piecework::contact
