#pragma once

// Extended position-based dynamics [Macklin et al. 2016], with our energies as compliant
// constraints.

#include <vector>

#include <piecework/baselines/coloring.hpp>
#include <piecework/local/jacobi.hpp>
#include <piecework/model/convergence.hpp>
#include <piecework/model/reduction.hpp>
#include <piecework/model/stepper.hpp>

namespace piecework::baselines {

/// What the stretch of a triangle is as a constraint; both have the energy w/2 |F - R|^2.
enum class XpbdStretch {
  Norm,   ///< the number |F - R|, as games would have it
  Frame,  ///< the six numbers F - R with R held during each solve, together
};

struct XpbdOptions {
  /// Frame by default: on a hanging sheet of 2.5K vertices Norm stays 10 % of the step's motion
  /// away from the minimum, Frame is as near after 200 sweeps and at 1e-3 after 1000. (Before 50
  /// sweeps Norm is the nearer one.)
  XpbdStretch stretch = XpbdStretch::Frame;
};

/// From x = z and lambda = 0, constraint after constraint (Gauss-Seidel by colours, in parallel):
///     dlambda = -(grad C M^-1 grad C^T + a)^-1 (C + a lambda),  a = 1 / (w h^2)
///     dx = M^-1 grad C^T dlambda
/// for C of a triangle as XpbdStretch says, C = |c^T x| - L of a hinge that is curved at rest, and
/// the three coordinates of c^T x of one that is flat: then w |C|^2 / 2 is the energy of
/// model::ClothModel.
///
/// Its limit: what the constraints have moved x by is never compared with M (x - z) = grad C^T
/// lambda at the x that was reached (their g = 0 is assumed). Where gradients turn during the
/// iterations, as that of |F - R| does, the end is no minimum of the incremental potential, however
/// many follow: stop rules on increments are met, the rule `gradient` may never be. Constraints
/// with constant gradients, Frame and flat hinges, are exact. With seams the mass of a slave is
/// lumped onto its carriers, which is another approximation.
///
/// Phases: all is local. The last gradient and energy are measured once, at the end, unless the
/// stop rule asks for them in each iteration.
class Xpbd final : public model::Minimizer {
 public:
  /// \param model    must outlive this object
  /// \param h        time step, s
  /// \param gravity  magnitude that turns forces into weights for `gradient`, m/s^2
  Xpbd(const model::ClothModel& model, double h, double gravity, model::StopOptions stop,
       XpbdOptions options = {});

  void prepare(const std::vector<char>& fixed) override;
  [[nodiscard]] model::SetupReport setup_report() const override { return {}; }
  /// \param x  in: the prediction, on the seams if there are any, as model::Integrator gives it
  model::StepReport minimize(const model::StepProblem& problem, Positions& x) override;
  [[nodiscard]] std::string description() const override;

  /// sum w/2 |C + a lambda|^2 over the constraints at the end of the last step, J: what the
  /// iterations bring to zero.
  [[nodiscard]] double constraint_residual() const;

 private:
  /// What a constraint sees of a vertex that carries it (a held one included): G for triangles
  /// (1/m), c for hinges (in the first place). They sum to zero over the constraint.
  struct Touch {
    int vertex;
    Vec2 factor;
  };
  /// Constraints of one kind in the order of their colours.
  struct Kind {
    Coloring coloring;
    std::vector<int> begin;  ///< per place in coloring.item: offsets into touch
    std::vector<Touch> touch;
    Positions multiplier;  ///< per place; constraints with one number use the first (triangles: two
                           ///< rows each)
    Positions offset;      ///< open seams: their part of F (two rows each) or of c^T x
  };

  template <std::size_t N, class Factor>
  void add_touches(const std::array<int, N>& vertices, const Factor& factor,
                   std::vector<Touch>& touches) const;
  template <class Touches>
  [[nodiscard]] Kind make_kind(std::size_t count, const Touches& touches_of) const;
  void set_offsets();
  void sweep(const model::StepProblem& problem);
  void solve_triangle(std::size_t i, const model::StepProblem& problem);
  /// dlambda of a triangle as a 2 x 3 matrix P: a vertex moves by M^-1 G^T P.
  [[nodiscard]] Eigen::Matrix<double, 2, 3> norm_impulse(std::size_t i, const Mat32& difference,
                                                         double stiffness);
  [[nodiscard]] Eigen::Matrix<double, 2, 3> frame_impulse(std::size_t i, const Mat32& difference,
                                                          double stiffness);
  void solve_hinge(std::size_t i);
  [[nodiscard]] Mat32 gradient_of_deformation(std::size_t i) const;
  [[nodiscard]] Vec3 curvature(std::size_t i) const;
  [[nodiscard]] double triangle_residual(std::size_t i) const;
  [[nodiscard]] double hinge_residual(std::size_t i) const;
  void follow_seams();
  void measure(const model::StepProblem& problem, model::StepReport& report);

  const model::ClothModel& model_;
  XpbdOptions options_;
  double h_sq_;
  model::Convergence convergence_;
  std::vector<char> fixed_;
  model::Reduction reduction_;
  Eigen::VectorXd inverse_mass_;  ///< |V|, 1/kg; 0 for held vertices and slaves
  Kind triangles_, hinges_;
  Positions seam_offset_;  ///< per slave, x_s - (T x)_s at the start of the step, m
  local::JacobiStep local_;
  Positions x_, before_, previous_, gradient_;
  model::Unknowns increment_;
};

}  // namespace piecework::baselines
