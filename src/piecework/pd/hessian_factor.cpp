#include <piecework/pd/hessian_factor.hpp>

#include <cmath>

#include <piecework/core/parallel.hpp>
#include <piecework/global/eigen_views.hpp>

namespace piecework::pd {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// A preconditioner: its error is not estimated.
constexpr global::TreeOptions kOptions = {
    .precision = global::Precision::Single, .factor_in_single = true, .contraction_limit = 0};

}  // namespace

HessianFactor::HessianFactor() : tree_(kOptions) {}

double HessianFactor::price(const global::FactorReport& system, const HessianProduct& hessian) {
  constexpr double kFlopsPerByte = 4;  // of dense 32-bit kernels, while memory delivers one byte
  constexpr double kCube = 27;
  const double factors = 2 * 2 * sizeof(float) * system.nonzeros;  // K~ and Kn, there and back
  const double vectors = 12 * 3 * sizeof(double) * static_cast<double>(hessian.count());
  return kCube * system.flops / (kFlopsPerByte * (factors + hessian.bytes() + vectors));
}

/// |sum_k beta_k u_k|^2 <= sum |beta| sum_k |beta_k| |u_k|^2 in any norm; the same for carriers.
void HessianFactor::add_contact(std::span<const model::ContactBlock> contact,
                                const model::ClothModel& model, const model::Reduction& reduction) {
  bound_.assign(at(reduction.count()), Mat3::Zero());
  for (const model::ContactBlock& block : contact) {
    double sum = 0;
    for (std::size_t k = 0; k < at(block.count); ++k) sum += std::abs(block.beta[k]);
    for (std::size_t k = 0; k < at(block.count); ++k)
      model.sewing.map().visit_carriers(block.vertices[k], [&](int carrier, double weight) {
        const int unknown = reduction.number(carrier);
        if (unknown >= 0)
          bound_[at(unknown)] += weight * sum * std::abs(block.beta[k]) * block.stiffness;
      });
  }
}

bool HessianFactor::factor(model::HessianMatrix& hessian,
                           std::span<const model::ContactBlock> contact,
                           const model::ClothModel& model, const model::Reduction& reduction) {
  hessian.complete();
  const SparseMatrix& lower = hessian.scalars();
  if (!analysed_) tree_.analyze(global::pattern_of(lower));
  analysed_ = true;
  add_contact(contact, model, reduction);
  values_.assign(lower.valuePtr(), lower.valuePtr() + lower.nonZeros());
  // A column of the lower triangle begins with its diagonal; the block's other rows follow it.
  parallel_for(bound_.size(), [&](std::size_t unknown) {
    for (int c = 0; c < 3; ++c)
      for (int r = c; r < 3; ++r)
        values_[at(lower.outerIndexPtr()[3 * unknown + at(c)] + r - c)] += bound_[unknown](r, c);
  });
  return tree_.factor(values_) == global::SolveStatus::Ok;
}

void HessianFactor::apply(const Positions& g, Positions& d) {
  d.resize(g.rows(), 3);
  (void)tree_.solve(g.data(), d.data(), 1, 1, 1);
}

}  // namespace piecework::pd
