#include "residual_pattern.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace piecework::bench {
namespace {

constexpr double kOffset = 1e-3;  // of the rms

bool is_free(const std::vector<char>& fixed, Eigen::Index v) {
  return fixed[static_cast<std::size_t>(v)] == 0;
}

/// Deviations from the mean over free vertices; 0 at others.
Eigen::VectorXd centred(const Eigen::VectorXd& values, const std::vector<char>& fixed) {
  double sum = 0;
  int count = 0;
  for (Eigen::Index v = 0; v < values.size(); ++v)
    if (is_free(fixed, v)) {
      sum += values[v];
      ++count;
    }
  Eigen::VectorXd result = Eigen::VectorXd::Zero(values.size());
  for (Eigen::Index v = 0; v < values.size(); ++v)
    if (is_free(fixed, v)) result[v] = values[v] - sum / count;
  return result;
}

}  // namespace

Edges edges_of(const Triangles& triangles) {
  Edges edges;
  for (const auto& t : triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const int a = t[k];
      const int b = t[(k + 1) % 3];
      edges.push_back({std::min(a, b), std::max(a, b)});
    }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

Eigen::VectorXd residual_pattern(const Positions& gradient, const Eigen::VectorXd& mass,
                                 const std::vector<char>& fixed) {
  Eigen::VectorXd size = Eigen::VectorXd::Zero(mass.size());
  double sum = 0;
  int count = 0;
  for (Eigen::Index v = 0; v < mass.size(); ++v)
    if (is_free(fixed, v)) {
      size[v] = gradient.row(v).norm() / mass[v];
      sum += size[v] * size[v];
      ++count;
    }
  const double rms = std::sqrt(sum / std::max(1, count));
  Eigen::VectorXd pattern = Eigen::VectorXd::Zero(mass.size());
  if (!(rms > 0)) return pattern;
  for (Eigen::Index v = 0; v < mass.size(); ++v)
    if (is_free(fixed, v)) pattern[v] = std::log10(size[v] / rms + kOffset);
  return pattern;
}

double moran(const Eigen::VectorXd& values, const Edges& edges, const std::vector<char>& fixed) {
  const Eigen::VectorXd d = centred(values, fixed);
  double product = 0;
  int pairs = 0;
  for (const auto& [a, b] : edges)
    if (is_free(fixed, a) && is_free(fixed, b)) {
      product += d[a] * d[b];
      ++pairs;
    }
  const auto count =
      static_cast<double>(std::count(fixed.begin(), fixed.end(), static_cast<char>(0)));
  const double variance = d.squaredNorm() / count;
  return variance > 0 && pairs > 0 ? product / pairs / variance : 0;
}

double correlation(const Eigen::VectorXd& a, const Eigen::VectorXd& b,
                   const std::vector<char>& fixed) {
  const Eigen::VectorXd da = centred(a, fixed);
  const Eigen::VectorXd db = centred(b, fixed);
  const double size = da.norm() * db.norm();
  return size > 0 ? da.dot(db) / size : 0;
}

}  // namespace piecework::bench
