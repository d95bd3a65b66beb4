#include <piecework/global/interface_dofs.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include <piecework/core/error.hpp>

namespace piecework::global {
namespace {

void check_options(const CornerOptions& options) {
  if (!(options.corner_fraction >= 0 && options.corner_fraction <= 1))
    throw InputError(
        fmt::format("corner_fraction = {}: give a value in [0, 1]", options.corner_fraction));
  if (options.floating_corners < 0)
    throw InputError(
        fmt::format("floating_corners = {}: give a value >= 0", options.floating_corners));
}

void check_domain(const DomainMatrix& domain, std::size_t number, int num_rows) {
  const auto size = static_cast<Eigen::Index>(domain.rows.size());
  if (domain.K.rows() != size || domain.K.cols() != size)
    throw InputError(fmt::format("domain {}: a matrix of {} x {} for {} rows", number,
                                 domain.K.rows(), domain.K.cols(), size));
  for (std::size_t i = 0; i < domain.rows.size(); ++i)
    if (domain.rows[i] < 0 || domain.rows[i] >= num_rows ||
        (i > 0 && domain.rows[i] <= domain.rows[i - 1]))
      throw InputError(fmt::format("domain {}: row {} at place {} is not ascending in [0, {})",
                                   number, domain.rows[i], i, num_rows));
}

class Classifier {
 public:
  Classifier(std::span<const DomainMatrix> domains, int num_rows);
  void promote_along_curves(double fraction);
  void promote_floating(int wanted);
  InterfaceDofs number();

 private:
  [[nodiscard]] std::span<const DofCopy> copies(int row) const {
    const auto r = static_cast<std::size_t>(row);
    return std::span(copies_).subspan(copies_begin_[r], copies_begin_[r + 1] - copies_begin_[r]);
  }
  [[nodiscard]] DofClass& dof_class(int row) {
    return result_.dof_class[static_cast<std::size_t>(row)];
  }

  std::vector<int> walk_curve(int start);
  std::vector<int> walk_part(const DomainMatrix& domain, std::vector<int> sources);
  void promote_part(const DomainMatrix& domain, const std::vector<int>& part, int wanted);
  void number_class(std::size_t d, DofClass wanted);

  std::span<const DomainMatrix> domains_;
  std::vector<std::size_t> copies_begin_;
  std::vector<DofCopy> copies_;  ///< per row; `local` is the place in DomainMatrix::rows
  std::vector<int> group_;     ///< per row of a curve still to be walked: its pair's number, or -1
  std::vector<char> seen_;     ///< per row: scratch of walk_curve(), all zero between calls
  std::vector<int> distance_;  ///< per local row: steps, see walk_part()
  std::vector<int> index_;     ///< per row: number among its class, once classes are final
  std::vector<std::vector<DofCopy>> corner_copies_;
  InterfaceDofs result_;
};

Classifier::Classifier(std::span<const DomainMatrix> domains, int num_rows) : domains_(domains) {
  const auto n = static_cast<std::size_t>(num_rows);
  result_.num_rows = num_rows;
  copies_begin_.assign(n + 1, 0);
  for (std::size_t d = 0; d < domains.size(); ++d) {
    check_domain(domains[d], d, num_rows);
    for (const int row : domains[d].rows) ++copies_begin_[static_cast<std::size_t>(row) + 1];
  }
  for (std::size_t r = 0; r < n; ++r) {
    const std::size_t count = copies_begin_[r + 1];
    if (count == 0)
      throw InputError(
          fmt::format("domains: row {} belongs to no domain; add it to one of them", r));
    result_.dof_class.push_back(count == 1   ? DofClass::Internal
                                : count == 2 ? DofClass::Duplicate
                                             : DofClass::Corner);
    copies_begin_[r + 1] += copies_begin_[r];
  }
  copies_.resize(copies_begin_[n]);
  std::vector<std::size_t> next(copies_begin_.begin(), copies_begin_.end() - 1);
  for (std::size_t d = 0; d < domains.size(); ++d)
    for (std::size_t i = 0; i < domains[d].rows.size(); ++i)
      copies_[next[static_cast<std::size_t>(domains[d].rows[i])]++] = {static_cast<int>(d),
                                                                       static_cast<int>(i)};
  group_.assign(n, -1);
  seen_.assign(n, 0);
}

/// Rows of the start's group that hang together with it, breadth first from the start.
std::vector<int> Classifier::walk_curve(int start) {
  const int group = group_[static_cast<std::size_t>(start)];
  std::vector<int> order{start};
  seen_[static_cast<std::size_t>(start)] = 1;
  for (std::size_t i = 0; i < order.size(); ++i)
    for (const DofCopy& copy : copies(order[i])) {
      const DomainMatrix& domain = domains_[static_cast<std::size_t>(copy.domain)];
      for (SparseMatrix::InnerIterator it(domain.K, copy.local); it; ++it) {
        const auto row = static_cast<std::size_t>(domain.rows[static_cast<std::size_t>(it.row())]);
        if (group_[row] != group || seen_[row]) continue;
        seen_[row] = 1;
        order.push_back(static_cast<int>(row));
      }
    }
  for (const int row : order) seen_[static_cast<std::size_t>(row)] = 0;
  return order;
}

void Classifier::promote_along_curves(double fraction) {
  if (fraction == 0) return;
  using Pair = std::pair<int, int>;
  std::vector<std::pair<Pair, int>> rows;  // (domains, row) of all two-domain rows
  for (int row = 0; row < result_.num_rows; ++row)
    if (dof_class(row) == DofClass::Duplicate)
      rows.push_back({{copies(row)[0].domain, copies(row)[1].domain}, row});
  std::sort(rows.begin(), rows.end());
  for (std::size_t i = 0, group = 0; i < rows.size(); ++i) {
    if (i > 0 && rows[i].first != rows[i - 1].first) ++group;
    group_[static_cast<std::size_t>(rows[i].second)] = static_cast<int>(group);
  }
  for (const auto& [pair, seed] : rows) {
    if (group_[static_cast<std::size_t>(seed)] < 0) continue;
    // The row that a walk reaches last is an end of the curve (of a closed one: any row).
    const std::vector<int> curve = walk_curve(walk_curve(seed).back());
    for (std::size_t k = 0; k < curve.size(); ++k) {
      group_[static_cast<std::size_t>(curve[k])] = -1;
      const auto before = static_cast<double>(k);
      if (std::floor((before + 1) * fraction + 0.5) <= std::floor(before * fraction + 0.5))
        continue;
      dof_class(curve[k]) = DofClass::Corner;
      ++result_.num_promoted;
    }
  }
}

/// The local rows that hang together with the sources, breadth first, with their steps from the
/// nearest source in distance_, which is -1 at them before.
std::vector<int> Classifier::walk_part(const DomainMatrix& domain, std::vector<int> sources) {
  for (const int local : sources) distance_[static_cast<std::size_t>(local)] = 0;
  std::vector<int>& order = sources;
  for (std::size_t i = 0; i < order.size(); ++i)
    for (SparseMatrix::InnerIterator it(domain.K, order[i]); it; ++it) {
      int& distance = distance_[static_cast<std::size_t>(it.row())];
      if (distance >= 0) continue;
      distance = distance_[static_cast<std::size_t>(order[i])] + 1;
      order.push_back(static_cast<int>(it.row()));
    }
  return std::move(order);
}

/// Makes up to `wanted` duplicates of a part corners, each as far as possible from those before.
void Classifier::promote_part(const DomainMatrix& domain, const std::vector<int>& part,
                              int wanted) {
  const auto class_of = [&](int local) -> DofClass& {
    return dof_class(domain.rows[static_cast<std::size_t>(local)]);
  };
  std::vector<int> duplicates;
  for (const int local : part) {
    if (class_of(local) == DofClass::Corner) return;
    if (class_of(local) == DofClass::Duplicate) duplicates.push_back(local);
  }
  std::sort(duplicates.begin(), duplicates.end());
  const int count = std::min(wanted, static_cast<int>(duplicates.size()));
  // The first walk starts from an arbitrary duplicate, so that it ends at an outer one.
  std::vector<int> sources(duplicates.begin(), duplicates.begin() + std::min(count, 1));
  for (int promoted = 0; promoted < count; ++promoted) {
    for (const int local : part) distance_[static_cast<std::size_t>(local)] = -1;
    walk_part(domain, sources);
    const auto farthest = std::max_element(duplicates.begin(), duplicates.end(), [&](int a, int b) {
      return distance_[static_cast<std::size_t>(a)] < distance_[static_cast<std::size_t>(b)];
    });
    if (promoted == 0) sources.clear();
    sources.push_back(*farthest);
    class_of(*farthest) = DofClass::Corner;
    duplicates.erase(farthest);
  }
  result_.num_floating_promoted += count;
}

void Classifier::promote_floating(int wanted) {
  for (const DomainMatrix& domain : domains_) {
    distance_.assign(domain.rows.size(), -1);
    for (std::size_t seed = 0; seed < domain.rows.size(); ++seed)
      if (distance_[seed] < 0)
        promote_part(domain, walk_part(domain, {static_cast<int>(seed)}), wanted);
  }
}

/// Adds the rows of one class to a domain's numbering and the domain to the copies of those rows.
void Classifier::number_class(std::size_t d, DofClass wanted) {
  DomainDofs& dofs = result_.domains[d];
  for (const int row : domains_[d].rows) {
    if (dof_class(row) != wanted) continue;
    const int index = index_[static_cast<std::size_t>(row)];
    const DofCopy copy{static_cast<int>(d), static_cast<int>(dofs.rows.size())};
    dofs.rows.push_back(row);
    if (wanted == DofClass::Internal) {
      ++dofs.num_internal;
    } else if (wanted == DofClass::Corner) {
      ++dofs.num_corners;
      dofs.corner.push_back(index);
      corner_copies_[static_cast<std::size_t>(index)].push_back(copy);
    } else {
      const bool lower = copies(row)[0].domain == copy.domain;
      ++dofs.num_duplicates;
      dofs.multiplier.push_back(index);
      dofs.sign.push_back(lower ? 1 : -1);
      result_.duplicate_copies[static_cast<std::size_t>(index)][lower ? 0 : 1] = copy;
    }
  }
}

InterfaceDofs Classifier::number() {
  index_.assign(result_.dof_class.size(), -1);
  for (int row = 0; row < result_.num_rows; ++row) {
    if (dof_class(row) == DofClass::Internal) continue;
    auto& rows = dof_class(row) == DofClass::Corner ? result_.corner_rows : result_.duplicate_rows;
    index_[static_cast<std::size_t>(row)] = static_cast<int>(rows.size());
    rows.push_back(row);
  }
  corner_copies_.resize(result_.corner_rows.size());
  result_.duplicate_copies.resize(result_.duplicate_rows.size());
  result_.domains.resize(domains_.size());
  for (std::size_t d = 0; d < domains_.size(); ++d)
    for (const DofClass wanted : {DofClass::Internal, DofClass::Duplicate, DofClass::Corner})
      number_class(d, wanted);
  result_.corner_copies_begin.push_back(0);
  for (const auto& list : corner_copies_) {
    result_.corner_copies.insert(result_.corner_copies.end(), list.begin(), list.end());
    result_.corner_copies_begin.push_back(static_cast<int>(result_.corner_copies.size()));
  }
  return std::move(result_);
}

}  // namespace

InterfaceDofs classify_dofs(std::span<const DomainMatrix> domains, int num_rows,
                            const CornerOptions& options) {
  check_options(options);
  Classifier classifier(domains, num_rows);
  classifier.promote_along_curves(options.corner_fraction);
  classifier.promote_floating(options.floating_corners);
  return classifier.number();
}

}  // namespace piecework::global
