#include <piecework/local/gauss_seidel.hpp>

#include <algorithm>
#include <array>

#include <Eigen/LU>

#include <piecework/core/parallel.hpp>
#include <piecework/local/constraint_orders.hpp>
#include <piecework/model/assembly.hpp>
#include <piecework/model/projection.hpp>

namespace piecework::local {
namespace {

using Vec4 = Eigen::Vector4d;
using Mat4 = Eigen::Matrix4d;
/// A projection or A x: two columns for triangles, one for hinges.
using Value = Mat32;

/// A constraint that is projected: A maps the positions of its vertices to columns of three
/// numbers.
struct Node {
  std::array<int, 4> vertex;           ///< -1: none
  std::array<int, 4> inner;            ///< its number in the domain, -1 if it never moves
  Eigen::Matrix<double, 4, 2> weight;  ///< A^T: row k for vertex k; rows sum to zero
  double stiffness;                    ///< w
  int triangle;                        ///< -1: a hinge ...
  double rest_length;                  ///< ... with this one
};

/// A x, by differences to vertex 0.
Value strain(const Node& n, const Positions& x) {
  const Vec3 x0 = x.row(n.vertex[0]).transpose();
  const Vec3 e1 = x.row(n.vertex[1]).transpose() - x0;
  const Vec3 e2 = x.row(n.vertex[2]).transpose() - x0;
  Value value;
  value.col(0) = n.weight(1, 0) * e1 + n.weight(2, 0) * e2;
  value.col(1) = n.weight(1, 1) * e1 + n.weight(2, 1) * e2;
  if (n.vertex[3] >= 0) value.col(0) += n.weight(3, 0) * (x.row(n.vertex[3]).transpose() - x0);
  return value;
}

Node triangle_node(const model::ClothModel& model, int t) {
  const model::StretchConstraint& c = model.stretch[static_cast<std::size_t>(t)];
  Node n{{c.vertices[0], c.vertices[1], c.vertices[2], -1}, {}, {}, c.weight, t, 0};
  n.weight.setZero();
  n.weight.middleRows<2>(1) = c.rest_inverse;
  n.weight.row(0) = -c.rest_inverse.colwise().sum();
  return n;
}

Node hinge_node(const model::BendConstraint& c) {
  Node n{c.vertices, {}, {}, c.weight, -1, c.rest_length};
  n.weight.setZero();
  for (std::size_t k = 0; k < 4; ++k) n.weight(static_cast<Eigen::Index>(k), 0) = c.coefficient[k];
  return n;
}

struct Entry {
  int column;
  double value;
};

/// A domain with its own numbering of the vertices that only it moves.
struct Domain {
  std::vector<int> vertex;  ///< of an inner vertex
  std::vector<int> row_begin;
  std::vector<Entry> entries;  ///< K between inner vertices, N/m
  std::vector<Node> nodes;
  std::vector<Node> flat;     ///< hinges without a projection
  std::vector<Mat4> inverse;  ///< per node: K_ii^-1, zero where nothing moves; LiteralEq12: its own
  std::vector<std::vector<int>> orders;
  std::vector<Vec4> residual;  ///< K x - b of inner vertices, N; the fourth number is void
  std::vector<Value> target;   ///< y of nodes
};

}  // namespace

struct GaussSeidel::Impl {
  Impl(const model::ClothModel& m, const decomposition::Decomposition& d,
       const std::vector<char>& prescribed, double h, const SweepOptions& o);

  void number_inner(const decomposition::Decomposition& d);
  void distribute(const decomposition::Decomposition& d);
  void copy_rows(Domain& domain, const SparseMatrix& K) const;
  void hold(const std::vector<char>& held);
  [[nodiscard]] Mat4 block(const Domain& domain, const Node& n) const;
  [[nodiscard]] Value project(const Node& n, const Value& value,
                              const model::StepProblem& problem) const;
  void begin(Domain& domain, const Positions& x, const model::StepProblem& problem) const;
  void relax(Domain& domain, std::size_t node, Positions& x,
             const model::StepProblem& problem) const;
  void relax_literally(const Domain& domain, std::size_t node, Positions& x,
                       const model::StepProblem& problem) const;

  const model::ClothModel& model;
  SweepOptions options;
  double inverse_h_sq;
  std::vector<char> interior;
  std::vector<int> number;  ///< per vertex: in its domain, -1 if it never moves
  std::vector<Domain> domains;
  std::vector<char> fixed;  ///< for which the inverses are
};

GaussSeidel::Impl::Impl(const model::ClothModel& m, const decomposition::Decomposition& d,
                        const std::vector<char>& prescribed, double h, const SweepOptions& o)
    : model(m), options(o), inverse_h_sq(1.0 / (h * h)) {
  domains.resize(static_cast<std::size_t>(d.num_domains));
  number_inner(d);
  distribute(d);
  const SparseMatrix K = model::assemble_system(model, h);
  parallel_for(
      domains.size(),
      [&](std::size_t j) {
        Domain& domain = domains[j];
        copy_rows(domain, K);
        std::vector<std::array<int, 4>> vertices;
        for (const Node& n : domain.nodes) vertices.push_back(n.vertex);
        domain.orders = depth_first_orders(
            vertices, prescribed, options.fixed_order ? 1 : options.num_orders, options.seed);
        domain.residual.resize(domain.vertex.size());
        domain.target.resize(domain.nodes.size());
      },
      1);
}

/// A vertex moves with its domain if it has one only and no seam touches it.
void GaussSeidel::Impl::number_inner(const decomposition::Decomposition& d) {
  const auto count = static_cast<std::size_t>(model.num_vertices());
  interior.assign(count, 1);
  const mesh::SeamMap& seams = model.sewing.map();
  for (const int v : seams.slaves) interior[static_cast<std::size_t>(v)] = 0;
  for (const int v : seams.carrier) interior[static_cast<std::size_t>(v)] = 0;
  number.assign(count, -1);
  for (std::size_t v = 0; v < count; ++v) {
    const int first = d.vertex_domains.begin[v];
    if (d.vertex_domains.begin[v + 1] - first != 1) interior[v] = 0;
    if (interior[v] == 0) continue;
    auto& own =
        domains[static_cast<std::size_t>(d.vertex_domains.item[static_cast<std::size_t>(first)])]
            .vertex;
    number[v] = static_cast<int>(own.size());
    own.push_back(static_cast<int>(v));
  }
}

void GaussSeidel::Impl::distribute(const decomposition::Decomposition& d) {
  const auto numbered = [&](Node n) {
    for (std::size_t k = 0; k < 4; ++k)
      n.inner[k] = n.vertex[k] < 0 ? -1 : number[static_cast<std::size_t>(n.vertex[k])];
    return n;
  };
  for (std::size_t t = 0; t < model.stretch.size(); ++t)
    domains[static_cast<std::size_t>(d.triangle_domain[t])].nodes.push_back(
        numbered(triangle_node(model, static_cast<int>(t))));
  std::size_t bend = 0;
  for (std::size_t i = 0; i < model.hinges.size(); ++i) {
    if (model.hinge_bends[i] == 0) continue;
    const Node n = numbered(hinge_node(model.bend[bend]));
    Domain& domain = domains[static_cast<std::size_t>(d.hinge_domain[i])];
    (n.rest_length > 0 ? domain.nodes : domain.flat).push_back(n);
    ++bend;
  }
}

void GaussSeidel::Impl::copy_rows(Domain& domain, const SparseMatrix& K) const {
  domain.row_begin.assign(1, 0);
  for (const int v : domain.vertex) {
    for (SparseMatrix::InnerIterator it(K, v); it; ++it)  // symmetric: a column is a row
      if (number[static_cast<std::size_t>(it.row())] >= 0)
        domain.entries.push_back({number[static_cast<std::size_t>(it.row())], it.value()});
    domain.row_begin.push_back(static_cast<int>(domain.entries.size()));
  }
}

/// K_ii, or the constraint's own part of it with the full mass.
Mat4 GaussSeidel::Impl::block(const Domain& domain, const Node& n) const {
  if (options.form == SweepForm::LiteralEq12) {
    Mat4 own = n.stiffness * n.weight * n.weight.transpose();
    for (std::size_t k = 0; k < 4; ++k)
      if (n.vertex[k] >= 0)
        own(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(k)) +=
            model.mass[n.vertex[k]] * inverse_h_sq;
    return own;
  }
  Mat4 K = Mat4::Zero();
  for (std::size_t a = 0; a < 4; ++a) {
    if (n.inner[a] < 0) continue;
    const auto row = static_cast<std::size_t>(n.inner[a]);
    for (int e = domain.row_begin[row]; e < domain.row_begin[row + 1]; ++e) {
      const Entry& entry = domain.entries[static_cast<std::size_t>(e)];
      for (std::size_t b = 0; b < 4; ++b)
        if (n.inner[b] == entry.column)
          K(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b)) = entry.value;
    }
  }
  return K;
}

/// Inverts the blocks of what moves when `held` does not.
void GaussSeidel::Impl::hold(const std::vector<char>& held) {
  fixed = held;
  parallel_for(
      domains.size(),
      [&](std::size_t j) {
        Domain& domain = domains[j];
        domain.inverse.resize(domain.nodes.size());
        for (std::size_t i = 0; i < domain.nodes.size(); ++i) {
          const Node& n = domain.nodes[i];
          std::vector<int> moving;
          for (int k = 0; k < 4; ++k) {
            const auto at = static_cast<std::size_t>(k);
            if (n.inner[at] >= 0 && held[static_cast<std::size_t>(n.vertex[at])] == 0)
              moving.push_back(k);
          }
          domain.inverse[i].setZero();
          if (moving.empty()) continue;
          const Eigen::MatrixXd K = block(domain, n)(moving, moving);
          const Eigen::MatrixXd inverse = K.inverse();
          domain.inverse[i](moving, moving) = inverse;
        }
      },
      1);
}

Value GaussSeidel::Impl::project(const Node& n, const Value& value,
                                 const model::StepProblem& problem) const {
  Value y = Value::Zero();
  if (n.triangle >= 0) {
    model::project_stretch(model.stretch[static_cast<std::size_t>(n.triangle)], value,
                           *problem.previous, model.start, y);
    return y;
  }
  const double length = value.col(0).norm();
  if (length > 1e-12 * n.rest_length) y.col(0) = n.rest_length / length * value.col(0);
  return y;
}

/// Every projection and the residual at the start of a sweep.
void GaussSeidel::Impl::begin(Domain& domain, const Positions& x,
                              const model::StepProblem& problem) const {
  for (std::size_t i = 0; i < domain.vertex.size(); ++i) {
    const int v = domain.vertex[i];
    domain.residual[i].setZero();
    domain.residual[i].head<3>() =
        model.mass[v] * inverse_h_sq * (x.row(v) - problem.predicted->row(v)).transpose();
  }
  const auto add = [&](const Node& n, const Value& difference) {
    for (std::size_t k = 0; k < 4; ++k)
      if (n.inner[k] >= 0)
        domain.residual[static_cast<std::size_t>(n.inner[k])].head<3>() +=
            n.stiffness * difference * n.weight.row(static_cast<Eigen::Index>(k)).transpose();
  };
  for (std::size_t i = 0; i < domain.nodes.size(); ++i) {
    const Value value = strain(domain.nodes[i], x);
    domain.target[i] = project(domain.nodes[i], value, problem);
    add(domain.nodes[i], value - domain.target[i]);
  }
  for (const Node& n : domain.flat) add(n, strain(n, x));
}

void GaussSeidel::Impl::relax(Domain& domain, std::size_t node, Positions& x,
                              const model::StepProblem& problem) const {
  const Node& n = domain.nodes[node];
  const Value y = project(n, strain(n, x), problem);
  const Value change = n.stiffness * (y - domain.target[node]);
  domain.target[node] = y;
  Mat4 r = Mat4::Zero();  // one column per vertex
  for (std::size_t k = 0; k < 4; ++k) {
    if (n.inner[k] < 0) continue;
    Vec4& residual = domain.residual[static_cast<std::size_t>(n.inner[k])];
    const auto column = static_cast<Eigen::Index>(k);
    residual.head<3>() -= change.col(0) * n.weight(column, 0) + change.col(1) * n.weight(column, 1);
    r.col(column) = residual;
  }
  const Mat4& inverse = domain.inverse[node];
  for (std::size_t k = 0; k < 4; ++k) {
    if (n.inner[k] < 0) continue;
    const auto column = static_cast<Eigen::Index>(k);
    Vec4 dx = -(inverse(0, column) * r.col(0) + inverse(1, column) * r.col(1) +
                inverse(2, column) * r.col(2));
    if (n.vertex[3] >= 0) dx -= inverse(3, column) * r.col(3);
    x.row(n.vertex[k]) += dx.head<3>().transpose();
    const auto row = static_cast<std::size_t>(n.inner[k]);
    for (int e = domain.row_begin[row]; e < domain.row_begin[row + 1]; ++e) {
      const Entry& entry = domain.entries[static_cast<std::size_t>(e)];
      domain.residual[static_cast<std::size_t>(entry.column)] += entry.value * dx;
    }
  }
}

void GaussSeidel::Impl::relax_literally(const Domain& domain, std::size_t node, Positions& x,
                                        const model::StepProblem& problem) const {
  const Node& n = domain.nodes[node];
  const Value value = strain(n, x);
  const Value force = n.stiffness * (value - project(n, value, problem));
  Eigen::Matrix<double, 4, 3> r = n.weight * force.transpose();
  for (std::size_t k = 0; k < 4; ++k)
    if (n.inner[k] >= 0)
      r.row(static_cast<Eigen::Index>(k)) +=
          model.mass[n.vertex[k]] * inverse_h_sq *
          (x.row(n.vertex[k]) - problem.predicted->row(n.vertex[k]));
  const Eigen::Matrix<double, 4, 3> step = -domain.inverse[node] * r;
  for (std::size_t k = 0; k < 4; ++k)
    if (n.inner[k] >= 0) x.row(n.vertex[k]) += step.row(static_cast<Eigen::Index>(k));
}

GaussSeidel::GaussSeidel(const model::ClothModel& model,
                         const decomposition::Decomposition& decomposition,
                         const std::vector<char>& prescribed, double h, const SweepOptions& options)
    : impl_(std::make_unique<Impl>(model, decomposition, prescribed, h, options)) {}
GaussSeidel::~GaussSeidel() = default;
GaussSeidel::GaussSeidel(GaussSeidel&&) noexcept = default;

const std::vector<char>& GaussSeidel::interior() const { return impl_->interior; }

void GaussSeidel::sweep(Positions& x, const model::StepProblem& problem, int iteration) {
  Impl& impl = *impl_;
  if (impl.fixed != *problem.fixed) impl.hold(*problem.fixed);
  const bool literal = impl.options.form == SweepForm::LiteralEq12;
  parallel_for(
      impl.domains.size(),
      [&](std::size_t j) {
        Domain& domain = impl.domains[j];
        if (!literal) impl.begin(domain, x, problem);
        const auto& order =
            domain.orders[static_cast<std::size_t>(iteration) % domain.orders.size()];
        for (const int node : order) {
          if (literal)
            impl.relax_literally(domain, static_cast<std::size_t>(node), x, problem);
          else
            impl.relax(domain, static_cast<std::size_t>(node), x, problem);
        }
      },
      1);
}

}  // namespace piecework::local
