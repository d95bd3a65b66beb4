#include <piecework/global/primal_dual.hpp>

#include <algorithm>
#include <cmath>
#include <new>
#include <utility>

#include <fmt/format.h>

#include <piecework/core/clock.hpp>
#include <piecework/core/error.hpp>
#include <piecework/core/parallel.hpp>
#include <piecework/global/domain_matrices.hpp>

namespace piecework::global {
namespace {

void check_options(const PrimalDualOptions& options) {
  if (!(options.refine_tolerance >= 0))
    throw InputError(fmt::format("refine_tolerance = {}: give a value >= 0 (infinity: never)",
                                 options.refine_tolerance));
  if (options.max_refinements < 0)
    throw InputError(
        fmt::format("max_refinements = {}: give a value >= 0", options.max_refinements));
}

void check_domains(std::span<const DomainMatrix> domains, const InterfaceDofs& dofs) {
  bool fits = domains.size() == dofs.domains.size();
  for (std::size_t d = 0; fits && d < domains.size(); ++d) {
    std::vector<int> rows = dofs.domains[d].rows;
    std::sort(rows.begin(), rows.end());
    const auto size = static_cast<Eigen::Index>(domains[d].rows.size());
    fits = domains[d].K.rows() == size && domains[d].K.cols() == size &&
           std::all_of(domains[d].rows.begin(), domains[d].rows.end(),
                       [&](int row) { return row >= 0 && row < dofs.num_rows; }) &&
           rows == dofs.unknowns(domains[d].rows);
  }
  if (!fits)
    throw InputError(
        "primal-dual solver: the classes of rows belong to other domains; make them with "
        "classify_dofs() of the same domains");
}

bool all_finite(const SparseMatrix& K) {
  for (int column = 0; column < K.outerSize(); ++column)
    for (SparseMatrix::InnerIterator it(K, column); it; ++it)
      if (!std::isfinite(it.value())) return false;
  return true;
}

/// Largest magnitude in a column; NaN if there is one (Eigen's norm may pass over it).
double max_norm(const RightHandSides& values, int column) {
  return parallel_max(static_cast<std::size_t>(values.rows()), [&](std::size_t i) {
    return std::abs(values(static_cast<Eigen::Index>(i), column));
  });
}

/// The first status that is not Ok, in domain order.
SolveStatus first_failure(const std::vector<SolveStatus>& statuses) {
  for (const SolveStatus status : statuses)
    if (status != SolveStatus::Ok) return status;
  return SolveStatus::Ok;
}

/// b <- T^T b: in the order of the slaves, whose rows become zero.
void fold(const mesh::SeamMap& seams, RightHandSides& b) {
  for (const int slave : seams.slaves) {
    seams.visit_carriers(
        slave, [&](int carrier, double weight) { b.row(carrier) += weight * b.row(slave); });
    b.row(slave).setZero();
  }
}

/// B_C^jT K^j B_C^j in the order [internal | dual | corners]: as reorder(), and slaves that are
/// corners are replaced by what carries them.
SparseMatrix condense(const DomainMatrix& domain, const DomainDofs& domain_dofs,
                      const InterfaceDofs& dofs) {
  std::vector<std::pair<int, int>> place;  // (row, local), ascending
  for (int local = 0; local < domain_dofs.size(); ++local)
    place.emplace_back(domain_dofs.rows[static_cast<std::size_t>(local)], local);
  std::sort(place.begin(), place.end());
  std::vector<Eigen::Triplet<double, int>> triplets;
  for (std::size_t i = 0; i < domain.rows.size(); ++i)
    dofs.visit_unknowns(domain.rows[i], [&](int row, double weight) {
      const auto found = std::lower_bound(place.begin(), place.end(), std::pair(row, 0));
      triplets.emplace_back(static_cast<int>(i), found->second, weight);
    });
  SparseMatrix B(domain.K.rows(), domain_dofs.size());
  B.setFromTriplets(triplets.begin(), triplets.end());
  const SparseMatrix KB = domain.K * B;
  return B.transpose() * KB;
}

/// K^j from ascending rows to the order [internal | dual | corners].
SparseMatrix reorder(const DomainMatrix& domain, const DomainDofs& dofs) {
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> to_local(dofs.size());
  for (int local = 0; local < dofs.size(); ++local) {
    const int row = dofs.rows[static_cast<std::size_t>(local)];
    const auto place = std::lower_bound(domain.rows.begin(), domain.rows.end(), row);
    to_local.indices()[place - domain.rows.begin()] = local;
  }
  SparseMatrix result;
  result = domain.K.twistedBy(to_local);
  return result;
}

}  // namespace

struct PrimalDual::Impl {
  std::vector<SparseMatrix> prepare(std::span<const DomainMatrix> matrices);
  SolveStatus analyze(const std::vector<SparseMatrix>& matrices);
  SolveStatus factorize(const std::vector<SparseMatrix>& matrices);
  SolveStatus apply(RightHandSides& x);
  SolveStatus reduce_domains(const RightHandSides& b);
  SolveStatus expand_domains(RightHandSides& x);
  void gather_interface(const RightHandSides& b);
  double residual(const RightHandSides& b, const RightHandSides& solution);
  SolveStatus refine(const RightHandSides& b, RightHandSides& solution);

  InterfaceDofs dofs;
  PrimalDualOptions options;
  SparseMatrix K;     ///< the sum, for residuals; with seams T^T K T
  double norm_K = 0;  ///< ||K||_inf
  bool analyzed = false;
  bool factored = false;
  std::vector<Eigen::Index> nonzeros;  ///< of each domain's matrix, to recognise another pattern
  std::vector<std::unique_ptr<DualDomain>> domains;
  InterfaceSystem interface;
  std::vector<RightHandSides> work;  ///< per domain, see DualDomain
  RightHandSides multipliers;        ///< b_R*, then lambda
  RightHandSides corners;            ///< b_C*, then x_C
  RightHandSides result;             ///< of solve(), so that b stays until all went well
  RightHandSides folded;             ///< T^T b; empty without seams
  RightHandSides r;                  ///< of residual()
  PrimalDualReport report;
  PrimalDualTimes times;
};

/// Local orders, the sum and its norm.
std::vector<SparseMatrix> PrimalDual::Impl::prepare(std::span<const DomainMatrix> matrices) {
  factored = false;
  std::vector<SparseMatrix> ordered(matrices.size());
  parallel_for(
      matrices.size(),
      [&](std::size_t d) {
        ordered[d] = dofs.condensed_slaves.empty() ? reorder(matrices[d], dofs.domains[d])
                                                   : condense(matrices[d], dofs.domains[d], dofs);
      },
      1);
  K = sum_matrices(matrices, dofs.num_rows);
  if (!dofs.seams.empty()) K = fold_matrix(K, dofs.seams);
  norm_K = parallel_max(static_cast<std::size_t>(K.cols()), [&](std::size_t column) {
    double sum = 0;
    for (SparseMatrix::InnerIterator it(K, static_cast<Eigen::Index>(column)); it; ++it)
      sum += std::abs(it.value());
    return sum;
  });
  return ordered;
}

SolveStatus PrimalDual::Impl::analyze(const std::vector<SparseMatrix>& matrices) {
  analyzed = false;
  domains.clear();
  work.clear();
  interface = InterfaceSystem();
  for (std::size_t d = 0; d < matrices.size(); ++d) {
    domains.push_back(make_dual_domain(options.form, options.backend));
    work.emplace_back(RightHandSides::Zero(dofs.domains[d].size(), 3));
    const SolveStatus status = domains[d]->analyze(matrices[d], dofs.domains[d]);
    if (status != SolveStatus::Ok) return status;
  }
  multipliers.resize(dofs.num_multipliers(), 3);
  corners.resize(dofs.num_corners(), 3);
  analyzed = true;
  return SolveStatus::Ok;
}

SolveStatus PrimalDual::Impl::factorize(const std::vector<SparseMatrix>& matrices) {
  Stopwatch watch;
  std::vector<DomainBlocks> blocks(domains.size());
  std::vector<SolveStatus> statuses(domains.size(), SolveStatus::Ok);
  parallel_for(
      domains.size(),
      [&](std::size_t d) { statuses[d] = domains[d]->factorize(matrices[d], blocks[d]); }, 1);
  report.num_domains = static_cast<int>(domains.size());
  report.num_multipliers = dofs.num_multipliers();
  report.num_seam_multipliers = static_cast<int>(dofs.seam_slaves.size());
  report.num_corners = dofs.num_corners();
  report.domains_ms = watch.lap();
  SolveStatus status = first_failure(statuses);
  if (status != SolveStatus::Ok) return status;
  report.domain_bytes = 0;
  report.domain_nonzeros = 0;
  for (const auto& domain : domains) {
    report.domain_bytes += domain->bytes();
    report.domain_nonzeros += domain->nonzeros();
  }
  status = interface.factor(dofs, blocks,
                            {.kind = options.interface,
                             .max_bytes = options.max_interface_bytes,
                             .max_w_bytes = static_cast<double>(report.domain_bytes)});
  report.interface_ms = watch.lap();
  report.interface_bytes = interface.bytes();
  report.interface_nonzeros = interface.nonzeros();
  report.stores_w = interface.stores_w();
  factored = status == SolveStatus::Ok;
  return status;
}

SolveStatus PrimalDual::Impl::reduce_domains(const RightHandSides& b) {
  std::vector<SolveStatus> statuses(domains.size(), SolveStatus::Ok);
  parallel_for(
      domains.size(),
      [&](std::size_t d) {
        const DomainDofs& domain = dofs.domains[d];
        for (int i = 0; i < domain.size(); ++i) {
          const bool is_duplicate =
              i >= domain.num_internal && i < domain.num_internal + domain.num_duplicates;
          const double share = is_duplicate ? 0.5 : i < domain.num_remainder() ? 1 : 0;
          work[d].row(i) = share * b.row(domain.rows[static_cast<std::size_t>(i)]);
        }
        statuses[d] = domains[d]->reduce(work[d]);
      },
      1);
  return first_failure(statuses);
}

/// b_R* and b_C* from what reduce() left, domains ascending.
void PrimalDual::Impl::gather_interface(const RightHandSides& b) {
  const auto value = [&](const DofCopy& copy) {
    return work[static_cast<std::size_t>(copy.domain)].row(copy.local);
  };
  parallel_for(static_cast<std::size_t>(dofs.num_multipliers()), [&](std::size_t m) {
    Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
    dofs.visit_copies(static_cast<int>(m), [&](const DofCopy& copy, double coefficient) {
      sum += coefficient * value(copy);
    });
    multipliers.row(static_cast<Eigen::Index>(m)) = sum;
  });
  parallel_for(dofs.corner_rows.size(), [&](std::size_t c) {
    Eigen::RowVector3d sum = b.row(dofs.corner_rows[c]);
    const auto first = static_cast<std::size_t>(dofs.corner_copies_begin[c]);
    const auto last = static_cast<std::size_t>(dofs.corner_copies_begin[c + 1]);
    for (std::size_t i = first; i < last; ++i) sum += value(dofs.corner_copies[i]);
    corners.row(static_cast<Eigen::Index>(c)) = sum;
  });
}

SolveStatus PrimalDual::Impl::expand_domains(RightHandSides& x) {
  std::vector<SolveStatus> statuses(domains.size(), SolveStatus::Ok);
  parallel_for(
      domains.size(),
      [&](std::size_t d) {
        const DomainDofs& domain = dofs.domains[d];
        auto forces = work[d].middleRows(domain.num_internal, domain.num_dual());
        forces.setZero();
        domain.visit_entries([&](int multiplier, int dual, double coefficient) {
          forces.row(dual) += coefficient * multipliers.row(multiplier);
        });
        for (std::size_t i = 0; i < domain.corner.size(); ++i)
          work[d].row(domain.num_remainder() + static_cast<Eigen::Index>(i)) =
              corners.row(domain.corner[i]);
        statuses[d] = domains[d]->expand(work[d]);
        const int first_sewn = domain.num_internal + domain.num_duplicates;
        for (int i = 0; i < domain.num_remainder(); ++i)
          if (i < domain.num_internal || i >= first_sewn)
            x.row(domain.rows[static_cast<std::size_t>(i)]) = work[d].row(i);
      },
      1);
  const auto value = [&](const DofCopy& copy) {
    return work[static_cast<std::size_t>(copy.domain)].row(copy.local);
  };
  parallel_for(dofs.duplicate_rows.size(), [&](std::size_t m) {
    const auto& [plus, minus] = dofs.duplicate_copies[m];
    x.row(dofs.duplicate_rows[m]) = 0.5 * (value(plus) + value(minus));
  });
  for (std::size_t c = 0; c < dofs.corner_rows.size(); ++c)
    x.row(dofs.corner_rows[c]) = corners.row(static_cast<Eigen::Index>(c));
  for (const int slave : dofs.condensed_slaves) {
    Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
    dofs.seams.visit_carriers(slave,
                              [&](int carrier, double weight) { sum += weight * x.row(carrier); });
    x.row(slave) = sum;
  }
  return first_failure(statuses);
}

/// One primal-dual solve, x in place of b.
SolveStatus PrimalDual::Impl::apply(RightHandSides& x) {
  Stopwatch watch;
  SolveStatus status = reduce_domains(x);
  times.domains_ms += watch.lap();
  if (status != SolveStatus::Ok) return status;
  gather_interface(x);
  status = interface.solve(multipliers, corners);
  times.interface_ms += watch.lap();
  if (status != SolveStatus::Ok) return status;
  status = expand_domains(x);
  times.domains_ms += watch.lap();
  return status;
}

/// r = b - K solution; returns the backward error, 0 for 0 / 0.
double PrimalDual::Impl::residual(const RightHandSides& b, const RightHandSides& solution) {
  r.resize(b.rows(), 3);
  parallel_for(static_cast<std::size_t>(b.rows()), [&](std::size_t i) {
    const auto row = static_cast<Eigen::Index>(i);  // K is symmetric: column i is row i
    Eigen::RowVector3d sum = b.row(row);
    for (SparseMatrix::InnerIterator it(K, row); it; ++it)
      sum -= it.value() * solution.row(it.row());
    r.row(row) = sum;
  });
  double worst = 0;
  for (int k = 0; k < 3; ++k) {
    const double scale = norm_K * max_norm(solution, k) + max_norm(b, k);
    if (scale == 0) continue;
    const double error = max_norm(r, k) / scale;
    if (!(error <= worst)) worst = error;  // also if it is NaN
  }
  return worst;
}

/// Iterative refinement; a step that does not lower the backward error is taken back.
SolveStatus PrimalDual::Impl::refine(const RightHandSides& b, RightHandSides& solution) {
  Stopwatch watch;
  times.first_error = times.error = residual(b, solution);
  times.residual_ms += watch.elapsed_ms();
  while (times.refinements < options.max_refinements && std::isfinite(times.error) &&
         times.error > options.refine_tolerance) {
    RightHandSides better = r;
    const SolveStatus status = apply(better);
    if (status != SolveStatus::Ok) return status;
    better += solution;
    watch.lap();
    const double error = residual(b, better);
    times.residual_ms += watch.elapsed_ms();
    if (!(error < times.error)) break;
    solution.swap(better);
    times.error = error;
    ++times.refinements;
  }
  return SolveStatus::Ok;
}

PrimalDual::PrimalDual() : impl_(std::make_unique<Impl>()) {}
PrimalDual::~PrimalDual() = default;
PrimalDual::PrimalDual(PrimalDual&&) noexcept = default;
PrimalDual& PrimalDual::operator=(PrimalDual&&) noexcept = default;

SolveStatus PrimalDual::factor(std::span<const DomainMatrix> domains, InterfaceDofs dofs,
                               const PrimalDualOptions& options) {
  check_options(options);
  check_domains(domains, dofs);
  InterfaceSystem::check_size(
      dofs, {.kind = options.interface, .max_bytes = options.max_interface_bytes});
  Impl& impl = *impl_;
  impl.dofs = std::move(dofs);
  impl.options = options;
  impl.report = {};
  impl.analyzed = impl.factored = false;
  try {
    Stopwatch watch;
    for (const DomainMatrix& domain : domains)
      if (!all_finite(domain.K)) return SolveStatus::NotPositiveDefinite;
    const std::vector<SparseMatrix> ordered = impl.prepare(domains);
    Stopwatch analysis;
    impl.nonzeros.clear();
    for (const DomainMatrix& domain : domains) impl.nonzeros.push_back(domain.K.nonZeros());
    SolveStatus status = impl.analyze(ordered);
    impl.report.analyze_ms = analysis.elapsed_ms();
    if (status == SolveStatus::Ok) status = impl.factorize(ordered);
    impl.report.factor_ms = watch.elapsed_ms();
    return status;
  } catch (const std::bad_alloc&) {
    impl.factored = false;
    return SolveStatus::OutOfMemory;
  }
}

SolveStatus PrimalDual::refactor(std::span<const DomainMatrix> domains) {
  Impl& impl = *impl_;
  if (!impl.analyzed) return SolveStatus::NotFactored;
  check_domains(domains, impl.dofs);
  for (std::size_t d = 0; d < domains.size(); ++d)
    if (domains[d].K.nonZeros() != impl.nonzeros[d])
      throw InputError(
          fmt::format("primal-dual solver: domain {} has {} entries, not the {} of the last "
                      "factor(); call factor()",
                      d, domains[d].K.nonZeros(), impl.nonzeros[d]));
  impl.factored = false;
  try {
    Stopwatch watch;
    for (const DomainMatrix& domain : domains)
      if (!all_finite(domain.K)) return SolveStatus::NotPositiveDefinite;
    impl.report.analyze_ms = 0;
    const SolveStatus status = impl.factorize(impl.prepare(domains));
    impl.report.factor_ms = watch.elapsed_ms();
    return status;
  } catch (const std::bad_alloc&) {
    impl.factored = false;
    return SolveStatus::OutOfMemory;
  }
}

SolveStatus PrimalDual::solve(RightHandSides& b) {
  Impl& impl = *impl_;
  if (!impl.factored) return SolveStatus::NotFactored;
  PIECEWORK_ASSERT(b.rows() == impl.dofs.num_rows);
  impl.times = {};
  try {
    const bool estimate = std::isfinite(impl.options.refine_tolerance);
    impl.result = b;
    fold(impl.dofs.seams, impl.result);
    if (!impl.dofs.seams.empty() && estimate) impl.folded = impl.result;
    SolveStatus status = impl.apply(impl.result);
    if (status == SolveStatus::Ok && estimate)
      status = impl.refine(impl.dofs.seams.empty() ? b : impl.folded, impl.result);
    if (status == SolveStatus::Ok) b = impl.result;
    return status;
  } catch (const std::bad_alloc&) {
    return SolveStatus::OutOfMemory;
  }
}

const PrimalDualReport& PrimalDual::report() const { return impl_->report; }
const PrimalDualTimes& PrimalDual::last_times() const { return impl_->times; }

}  // namespace piecework::global
