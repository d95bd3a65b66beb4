// Methods with a factor of K alone, and Jacobi's with none: nothing is factored when D changes.

#include <algorithm>
#include <cmath>

#include <piecework/core/parallel.hpp>

#include "column_sums.hpp"
#include "diagonal_methods.hpp"

namespace piecework::global {
namespace {

using Row3 = Eigen::Array<double, 1, 3>;

/// Steps of Chebyshev's iteration on the contacts: two do what an exact inverse does. Measured.
constexpr int kChebyshevSteps = 2;

/// Chebyshev's interval reaches from its upper end down to this part of it at least. Chosen.
constexpr double kLeastPart = 1.0 / 30;

/// Digits after which the dual iteration starts again from the true residual: K^-1 may be one of
/// 32 bits, in which the dual residual says nothing beyond.
constexpr double kDualReduction = 1e-4;

template <class Body>
void for_each(const std::vector<int>& rows, const Body& body) {
  parallel_for(rows.size(), [&](std::size_t i) { body(rows[i]); });
}

class Jacobi final : public DiagonalUpdateSolver {
  void precondition(const Positions& r, Positions& z) override {
    z.resize(r.rows(), 3);
    for_each_row(r.rows(), [&](Eigen::Index v) { z.row(v) = inverse_[v] * r.row(v); });
  }
};

class InverseK final : public DiagonalUpdateSolver {
 public:
  InverseK(bool steepest_descent, const DiagonalOptions& options)
      : steps_(steepest_descent ? (options.recompute ? options.steps : std::min(options.steps, 1))
                                : 0),
        recompute_(options.recompute),
        elastic_weight_(options.elastic_weight) {}

 private:
  void precondition(const Positions& r, Positions& z) override { apply_inverse(r, z); }

  /// dx_v = r_v / (D_v + w_i) on the contacts, which is what [Lu25, Eq. 23-24] come to in the
  /// residual form; with `recompute` steps along D^-1 r_c with an exact line search, which stays
  /// symmetric for weights that differ.
  void start(const Positions& b, Positions& x) override {
    Positions d = Positions::Zero(x.rows(), 3);
    for (int step = 0; step < steps_; ++step) {
      multiply(x, r_);
      for_each(contacts_, [&](int v) {
        r_.row(v) = b.row(v) - r_.row(v);
        d.row(v) = r_.row(v) / (diagonal_[v] + (recompute_ ? 0 : elastic_weight_));
      });
      const Row3 length = recompute_ ? line_search(d) : Row3(1, 1, 1);
      for_each(contacts_, [&](int v) { x.row(v).array() += length * d.row(v).array(); });
    }
  }

  /// Of d, which lives on the contacts: d . r / d . (K + D) d.
  [[nodiscard]] Row3 line_search(const Positions& d) const {
    const auto over_contacts = [&](const auto& term) {
      return parallel_sum<ColumnSums>(contacts_.size(),
                                      [&](std::size_t i) { return ColumnSums{term(contacts_[i])}; })
          .value;
    };
    const Row3 slope =
        over_contacts([&](int v) -> Row3 { return d.row(v).array() * r_.row(v).array(); });
    const Row3 curvature = over_contacts([&](int v) -> Row3 {
      return d.row(v).array() * (elastic_row(d, v) + diagonal_[v] * d.row(v)).array();
    });
    return safe_ratio(slope, curvature);
  }

  int steps_;
  bool recompute_;
  double elastic_weight_;
  Positions r_;
};

/// z = M r + (I - M A) K^-1 (I - A M) r with A = K + D and M = (K_cc + D)^-1 on the contacts,
/// nearly. SPD for every SPD M: where M's part vanishes, v_c = 0 and K^-1's does not.
class Hybrid final : public DiagonalUpdateSolver {
 private:
  SolveStatus update_method() override {
    in_contacts_ = (diagonal_.array() > 0).cast<double>();
    // Gershgorin's interval of diag^-1 (K_cc + D).
    const double radius = parallel_max(contacts_.size(), [&](std::size_t i) {
      const int v = contacts_[i];
      double sum = 0;
      for (SparseMatrix::InnerIterator entry(*K_, v); entry; ++entry)
        if (entry.row() != v) sum += std::abs(entry.value()) * in_contacts_[entry.row()];
      return sum * inverse_[v];
    });
    high_ = 1 + radius;
    low_ = std::max(1 - radius, kLeastPart * high_);
    return SolveStatus::Ok;
  }

  void precondition(const Positions& r, Positions& z) override {
    correct(r, first_);
    multiply(first_, image_);
    rest_.resize(r.rows(), 3);
    for_each_row(r.rows(), [&](Eigen::Index v) { rest_.row(v) = r.row(v) - image_.row(v); });
    apply_inverse(rest_, z);
    multiply(z, image_);
    correct(image_, second_);
    for_each_row(r.rows(), [&](Eigen::Index v) { z.row(v) += first_.row(v) - second_.row(v); });
  }

  /// u = M r: Chebyshev's iteration from zero, a polynomial that is positive up to high_.
  void correct(const Positions& r, Positions& u) {
    const double middle = (high_ + low_) / 2;
    const double half = (high_ - low_) / 2;
    u.resize(r.rows(), 3);
    step_.resize(r.rows(), 3);
    for_each_row(r.rows(), [&](Eigen::Index v) {
      u.row(v) = in_contacts_[v] * inverse_[v] / middle * r.row(v);
      step_.row(v) = u.row(v);
    });
    double rho = half / middle;
    for (int k = 1; k < kChebyshevSteps && half > 0; ++k) {
      const double next = 1 / (2 * middle / half - rho);
      for_each(contacts_, [&](int v) {
        const Eigen::RowVector3d left = r.row(v) - elastic_row(u, v) - diagonal_[v] * u.row(v);
        step_.row(v) = next * rho * step_.row(v) + 2 * next / half * inverse_[v] * left;
      });
      for_each(contacts_, [&](int v) { u.row(v) += step_.row(v); });
      rho = next;
    }
  }

  Eigen::ArrayXd in_contacts_;
  double low_ = 1, high_ = 1;
  Positions first_, second_, image_, rest_, step_;
};

/// CG on (D^-1 + W) f = g, W the contact block of K^-1, for changes f of the contact forces; x
/// follows as K^-1 (b - forces), and g = -r_c / D is how far x and the forces disagree. Weights
/// that differ are no matter: this form is symmetric, [Lu25, Eq. 18] with I + D^-1 W^-1 is not.
/// Preconditioned by K's contact block, the lumped form of W^-1.
class Dual final : public DiagonalUpdateSolver {
 private:
  void precondition(const Positions& r, Positions& z) override { apply_inverse(r, z); }

  void iterate(Positions& x, Positions& r, const DiagonalLimits& limits) override {
    if (contacts_.empty()) {
      DiagonalUpdateSolver::iterate(x, r, limits);
      return;
    }
    // The force of the start is the one that x has, so that only contacts are left with a residual.
    z_ = r;
    for_each(contacts_, [&](int v) { z_.row(v).setZero(); });
    apply_inverse(z_, q_);
    multiply(q_, Aq_);
    advance(Row3(-1, -1, -1), x, r);
    g_ = Positions::Zero(x.rows(), 3);
    z_ = g_;
    for_each(contacts_, [&](int v) { g_.row(v) = -r.row(v) / diagonal_[v]; });
    lump();
    Row3 zg = column_dots(z_, g_);
    const Row3 enough = kDualReduction * kDualReduction * zg;
    p_ = z_;
    while ((zg > enough).any()) {
      apply_inverse(p_, q_);
      multiply(q_, Aq_);
      for_each(contacts_, [&](int v) { image_row(v); });
      const Row3 pHp = column_dots(p_, z_);
      const Row3 alpha = safe_ratio(zg, pHp);
      advance(alpha, x, r);
      for_each(contacts_, [&](int v) { g_.row(v).array() -= alpha * z_.row(v).array(); });
      if (!go_on(x, r, limits)) return;
      lump();
      const Row3 before = zg;
      zg = column_dots(z_, g_);
      const Row3 beta = safe_ratio(zg, before);
      for_each(contacts_, [&](int v) { p_.row(v) = z_.row(v).array() + beta * p_.row(v).array(); });
    }
  }

  /// x -= length q and r to match.
  void advance(const Row3& length, Positions& x, Positions& r) const {
    for_each_row(x.rows(), [&](Eigen::Index v) {
      x.row(v).array() -= length * q_.row(v).array();
      r.row(v).array() += length * Aq_.row(v).array();
    });
  }

  /// z = K_cc g.
  void lump() {
    for_each(contacts_, [&](int v) { z_.row(v) = elastic_row(g_, v); });
  }
  /// z = (D^-1 + W) p, given q = K^-1 p.
  void image_row(int v) { z_.row(v) = p_.row(v) / diagonal_[v] + q_.row(v); }

  Positions g_, z_, p_, q_, Aq_;
};

}  // namespace

std::unique_ptr<DiagonalUpdateSolver> make_inverse_k(bool steepest_descent,
                                                     const DiagonalOptions& options) {
  return std::make_unique<InverseK>(steepest_descent, options);
}

std::unique_ptr<DiagonalUpdateSolver> make_jacobi() { return std::make_unique<Jacobi>(); }
std::unique_ptr<DiagonalUpdateSolver> make_hybrid() { return std::make_unique<Hybrid>(); }
std::unique_ptr<DiagonalUpdateSolver> make_dual() { return std::make_unique<Dual>(); }

}  // namespace piecework::global
