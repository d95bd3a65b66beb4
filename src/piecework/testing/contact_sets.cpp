#include <piecework/testing/contact_sets.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include <piecework/core/random.hpp>
#include <piecework/testing/small_cloths.hpp>

namespace piecework::testing {
namespace {

constexpr int kPatches = 12;

double distance_to_patches(double x, double z) {
  Random centres(3);
  double least = 2;
  for (int k = 0; k < kPatches; ++k) {
    const double centre_x = centres.uniform();
    const double centre_z = centres.uniform();
    least = std::min(least, std::hypot(x - centre_x, z - centre_z));
  }
  return least;
}

/// Small deep inside the set.
double depth(ContactSet set, double x, double z, Random& random) {
  switch (set) {
    case ContactSet::Disk:
      return std::hypot(x - 0.5, z - 0.5);
    case ContactSet::Patches:
      return distance_to_patches(x, z);
    case ContactSet::Folds:
      return std::abs(std::sin(3 * std::numbers::pi * x) * std::cos(2 * std::numbers::pi * z));
    case ContactSet::Scattered:
      break;
  }
  return random.uniform();
}

}  // namespace

std::string_view to_string(ContactSet set) {
  switch (set) {
    case ContactSet::Disk:
      return "disk";
    case ContactSet::Patches:
      return "patches";
    case ContactSet::Folds:
      return "folds";
    case ContactSet::Scattered:
      break;
  }
  return "scattered";
}

std::vector<int> contact_vertices(const Positions& X, ContactSet set, int count) {
  Random random(5);
  std::vector<double> depths;
  for (Eigen::Index v = 0; v < X.rows(); ++v)
    depths.push_back(depth(set, X(v, 0), X(v, 2), random));
  std::vector<int> order(depths.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return depths[static_cast<std::size_t>(a)] < depths[static_cast<std::size_t>(b)];
  });
  order.resize(static_cast<std::size_t>(count));
  return order;
}

Positions contact_forces(const Positions& X, const std::vector<double>& D) {
  Positions b = random_positions(static_cast<int>(X.rows()), 0.005, 1);
  for (Eigen::Index v = 0; v < X.rows(); ++v) {
    const double smooth = 0.01 * (std::sin(7 * X(v, 0)) * std::cos(5 * X(v, 2)) + 0.5);
    b.row(v) += Eigen::RowVector3d(smooth, -2 * smooth, smooth * X(v, 0));
    b.row(v) *= D[static_cast<std::size_t>(v)];
  }
  return b;
}

}  // namespace piecework::testing
