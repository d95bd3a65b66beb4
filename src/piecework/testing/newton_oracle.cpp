#include <piecework/testing/newton_oracle.hpp>

#include <array>
#include <functional>
#include <map>
#include <stdexcept>
#include <utility>
#include <vector>

#include <Eigen/Dense>
#include <Eigen/LU>
#include <Eigen/SVD>

namespace piecework::testing {
namespace {

using Real = long double;
using Point = Eigen::Matrix<Real, 3, 1>;
using Points = std::vector<Point>;

/// An energy term of a few vertices.
struct Element {
  std::vector<int> vertices;
  std::function<Real(const Points&)> energy;
};

Point point(const Positions& x, int v) { return x.row(v).transpose().cast<Real>(); }

Real area(const Point& a, const Point& b, const Point& c) {
  return (b - a).cross(c - a).norm() / 2;
}

Real cot(const Point& at, const Point& p, const Point& q) {
  return (p - at).dot(q - at) / (p - at).cross(q - at).norm();
}

Element membrane(const mesh::TriangleMesh& rest, const Triangle& t, Real stiffness) {
  const Point a = point(rest.positions, t[0]);
  const Point b = point(rest.positions, t[1]);
  const Point c = point(rest.positions, t[2]);
  // Rest edges in an orthonormal frame of the rest plane.
  const Point e1 = (b - a).normalized();
  const Point e2 = (b - a).cross(c - a).cross(b - a).normalized();
  Eigen::Matrix<Real, 2, 2> rest_edges;
  rest_edges << (b - a).dot(e1), (c - a).dot(e1), (b - a).dot(e2), (c - a).dot(e2);
  const Eigen::Matrix<Real, 2, 2> inverse = rest_edges.inverse();
  const Real weight = stiffness * area(a, b, c);
  return {{t[0], t[1], t[2]}, [=](const Points& x) {
            Eigen::Matrix<Real, 3, 2> edges;
            edges << x[1] - x[0], x[2] - x[0];
            const Eigen::Matrix<Real, 3, 2> F = edges * inverse;
            const Eigen::JacobiSVD<Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>> svd(F);
            const auto sigma = svd.singularValues();
            return weight / 2 * ((sigma[0] - 1) * (sigma[0] - 1) + (sigma[1] - 1) * (sigma[1] - 1));
          }};
}

Element bending(const mesh::TriangleMesh& rest, const std::array<int, 4>& v, Real stiffness) {
  Points r;
  for (const int vertex : v) r.push_back(point(rest.positions, vertex));
  const std::array<Real, 4> c{cot(r[1], r[0], r[2]) + cot(r[1], r[0], r[3]),
                              cot(r[0], r[1], r[2]) + cot(r[0], r[1], r[3]),
                              -cot(r[0], r[1], r[2]) - cot(r[1], r[0], r[2]),
                              -cot(r[0], r[1], r[3]) - cot(r[1], r[0], r[3])};
  const auto bend = [c](const Points& x) {
    return Point(c[0] * x[0] + c[1] * x[1] + c[2] * x[2] + c[3] * x[3]).norm();
  };
  const Real rest_bend = bend(r);
  const Real weight = stiffness / (area(r[0], r[1], r[2]) + area(r[0], r[1], r[3]));
  return {{v[0], v[1], v[2], v[3]}, [=](const Points& x) {
            const Real difference = bend(x) - rest_bend;
            return weight / 2 * difference * difference;
          }};
}

std::vector<Element> elements_of(const OracleProblem& problem) {
  const mesh::TriangleMesh& rest = *problem.rest;
  std::vector<Element> elements;
  std::map<std::pair<int, int>, int> opposite;
  for (const Triangle& t : rest.triangles) {
    elements.push_back(membrane(rest, t, problem.material.stretching));
    for (std::size_t k = 0; k < 3 && problem.material.bending; ++k) {
      const int a = t[k];
      const int b = t[(k + 1) % 3];
      const int c = t[(k + 2) % 3];
      const auto [it, is_new] = opposite.try_emplace(std::minmax(a, b), c);
      if (!is_new)
        elements.push_back(bending(rest, {a, b, it->second, c}, *problem.material.bending));
    }
  }
  std::vector<Real> mass(static_cast<std::size_t>(rest.num_vertices()), 0);
  for (const Triangle& t : rest.triangles)
    for (const int v : t)
      mass[static_cast<std::size_t>(v)] +=
          static_cast<Real>(problem.material.density) *
          area(point(rest.positions, t[0]), point(rest.positions, t[1]),
               point(rest.positions, t[2])) /
          3;
  for (int v = 0; v < rest.num_vertices(); ++v) {
    if (problem.fixed[static_cast<std::size_t>(v)]) continue;
    const Real factor = mass[static_cast<std::size_t>(v)] /
                        (2 * static_cast<Real>(problem.h) * static_cast<Real>(problem.h));
    const Point z = point(problem.predicted, v);
    elements.push_back({{v}, [=](const Points& x) { return factor * (x[0] - z).squaredNorm(); }});
  }
  return elements;
}

Points local_points(const Element& element, const Positions& x) {
  Points points;
  for (const int v : element.vertices) points.push_back(point(x, v));
  return points;
}

Real shifted(const Element& element, Points& points, std::size_t i, Real by_i, std::size_t j,
             Real by_j) {
  points[i / 3][static_cast<Eigen::Index>(i % 3)] += by_i;
  points[j / 3][static_cast<Eigen::Index>(j % 3)] += by_j;
  const Real energy = element.energy(points);
  points[i / 3][static_cast<Eigen::Index>(i % 3)] -= by_i;
  points[j / 3][static_cast<Eigen::Index>(j % 3)] -= by_j;
  return energy;
}

}  // namespace

double oracle_energy(const OracleProblem& problem, const Positions& x) {
  Real energy = 0;
  for (const Element& element : elements_of(problem))
    energy += element.energy(local_points(element, x));
  return static_cast<double>(energy);
}

Positions oracle_gradient(const OracleProblem& problem, const Positions& x) {
  constexpr Real step = 1e-6L;
  Eigen::Matrix<Real, Eigen::Dynamic, 3, Eigen::RowMajor> gradient(x.rows(), 3);
  gradient.setZero();
  for (const Element& element : elements_of(problem)) {
    Points points = local_points(element, x);
    for (std::size_t i = 0; i < 3 * points.size(); ++i)
      gradient(element.vertices[i / 3], static_cast<Eigen::Index>(i % 3)) +=
          (shifted(element, points, i, step, i, 0) - shifted(element, points, i, -step, i, 0)) /
          (2 * step);
  }
  for (Eigen::Index v = 0; v < x.rows(); ++v)
    if (problem.fixed[static_cast<std::size_t>(v)]) gradient.row(v).setZero();
  return gradient.cast<double>();
}

Positions oracle_minimize(const OracleProblem& problem, Positions x) {
  constexpr Real step = 1e-5L;
  const auto elements = elements_of(problem);
  for (int iteration = 0; iteration < 50; ++iteration) {
    Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(x.size(), x.size());
    for (const Element& element : elements) {
      Points points = local_points(element, x);
      for (std::size_t i = 0; i < 3 * points.size(); ++i)
        for (std::size_t j = 0; j < 3 * points.size(); ++j) {
          const Real second = (shifted(element, points, i, step, j, step) -
                               shifted(element, points, i, step, j, -step) -
                               shifted(element, points, i, -step, j, step) +
                               shifted(element, points, i, -step, j, -step)) /
                              (4 * step * step);
          hessian(3 * element.vertices[i / 3] + static_cast<int>(i % 3),
                  3 * element.vertices[j / 3] + static_cast<int>(j % 3)) +=
              static_cast<double>(second);
        }
    }
    const Positions gradient = oracle_gradient(problem, x);
    for (Eigen::Index v = 0; v < x.rows(); ++v) {
      if (!problem.fixed[static_cast<std::size_t>(v)]) continue;
      hessian.middleRows(3 * v, 3).setZero();
      hessian.middleCols(3 * v, 3).setZero();
      hessian.block(3 * v, 3 * v, 3, 3).setIdentity();
    }
    const Eigen::VectorXd rhs =
        -Eigen::Map<const Eigen::VectorXd>(gradient.data(), gradient.size());
    const Eigen::VectorXd dx = hessian.partialPivLu().solve(rhs);
    x += Eigen::Map<const Positions>(dx.data(), x.rows(), 3);
    if (dx.cwiseAbs().maxCoeff() < 1e-12) return x;
  }
  throw std::runtime_error("the oracle's Newton iteration did not converge");
}

}  // namespace piecework::testing
