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

void check_seams(const mesh::SeamMap& seams, int num_rows) {
  if (seams.empty()) return;
  bool fits = seams.row.size() == static_cast<std::size_t>(num_rows) &&
              seams.begin.size() == seams.slaves.size() + 1 &&
              seams.carrier.size() == static_cast<std::size_t>(seams.begin.back()) &&
              seams.weight.size() == seams.carrier.size();
  for (std::size_t s = 0; fits && s < seams.slaves.size(); ++s)
    fits = seams.slaves[s] >= 0 && seams.slaves[s] < num_rows &&
           seams.begin[s] < seams.begin[s + 1] &&
           seams.row[static_cast<std::size_t>(seams.slaves[s])] == static_cast<int>(s);
  for (std::size_t k = 0; fits && k < seams.carrier.size(); ++k)
    fits =
        seams.carrier[k] >= 0 && seams.carrier[k] < num_rows && !seams.is_slave(seams.carrier[k]);
  if (!fits)
    throw InputError(
        fmt::format("seams: not a map of {} rows in which free rows carry every slave; resolve "
                    "them with resolve_seams() and number them like the rows",
                    num_rows));
}

/// Place of a row in a domain's own numbering.
enum class Block { Internal, Duplicate, Sewn, Corner };

class Classifier {
 public:
  Classifier(std::span<const DomainMatrix> domains, int num_rows, mesh::SeamMap seams);
  void promote_along_curves(double fraction);
  void promote_floating(int wanted);
  InterfaceDofs number();

 private:
  [[nodiscard]] std::span<const DofCopy> copies(int row) const {
    const auto r = static_cast<std::size_t>(row);
    return std::span(copies_).subspan(copies_begin_[r], copies_begin_[r + 1] - copies_begin_[r]);
  }
  [[nodiscard]] DofClass dof_class(int row) const {
    return result_.dof_class[static_cast<std::size_t>(row)];
  }
  [[nodiscard]] Block block(int row) const;
  [[nodiscard]] DofCopy numbered(int row, int domain) const;
  [[nodiscard]] DofCopy copy_near(int row, int domain) const;

  bool make_corner(int row);
  void sew_corners(int slave);
  std::vector<int> walk_curve(int start);
  std::vector<int> walk_part(const DomainMatrix& domain, std::vector<int> sources);
  void promote_part(const DomainMatrix& domain, const std::vector<int>& part, int wanted);
  void number_block(std::size_t d, const std::vector<int>& rows, Block wanted);
  void number_seams();
  void add_seam_entry(int multiplier, const DofCopy& copy, double coefficient);

  std::span<const DomainMatrix> domains_;
  std::vector<std::size_t> copies_begin_;
  std::vector<DofCopy> copies_;  ///< per row; `local` is the place in DomainMatrix::rows
  std::vector<int> group_;     ///< per row of a curve still to be walked: its pair's number, or -1
  std::vector<char> seen_;     ///< per row: scratch of walk_curve(), all zero between calls
  std::vector<int> distance_;  ///< per local row: steps, see walk_part()
  std::vector<char> sewn_;     ///< per row: a slave, or carries one; empty without seams
  std::vector<int> index_;     ///< per row: number among its class, once classes are final
  std::vector<std::vector<DofCopy>> corner_copies_;
  InterfaceDofs result_;
};

Classifier::Classifier(std::span<const DomainMatrix> domains, int num_rows, mesh::SeamMap seams)
    : domains_(domains) {
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
  result_.seams = std::move(seams);
  if (result_.seams.empty()) return;
  sewn_.assign(n, 0);
  for (const int row : result_.seams.slaves) sewn_[static_cast<std::size_t>(row)] = 1;
  for (const int row : result_.seams.carrier) sewn_[static_cast<std::size_t>(row)] = 1;
  for (const int slave : result_.seams.slaves)
    if (dof_class(slave) == DofClass::Corner) sew_corners(slave);
}

/// False if it is one already.
bool Classifier::make_corner(int row) {
  DofClass& now = result_.dof_class[static_cast<std::size_t>(row)];
  if (now == DofClass::Corner) return false;
  now = DofClass::Corner;
  if (result_.seams.is_slave(row)) sew_corners(row);
  return true;
}

/// What carries a corner are corners, so that x_C = B_C x~_C [Lu25, Sec. 4.4].
void Classifier::sew_corners(int slave) {
  result_.seams.visit_carriers(
      slave, [&](int carrier, double) { result_.num_sewn_promoted += make_corner(carrier); });
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
      result_.num_promoted += make_corner(curve[k]);
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

/// Makes up to `wanted` dual rows of a part corners, each as far as possible from those before.
void Classifier::promote_part(const DomainMatrix& domain, const std::vector<int>& part,
                              int wanted) {
  const auto row = [&](int local) { return domain.rows[static_cast<std::size_t>(local)]; };
  const auto is_corner = [&](int local) { return dof_class(row(local)) == DofClass::Corner; };
  if (std::any_of(part.begin(), part.end(), is_corner)) return;
  std::vector<int> dual;
  for (const int local : part)
    if (block(row(local)) != Block::Internal) dual.push_back(local);
  std::sort(dual.begin(), dual.end());
  // The first walk starts from an arbitrary dual row, so that it ends at an outer one.
  std::vector<int> sources(dual.begin(),
                           dual.begin() + std::min<std::ptrdiff_t>(std::ssize(dual), 1));
  for (int promoted = 0; promoted < wanted && !dual.empty(); ++promoted) {
    for (const int local : part) distance_[static_cast<std::size_t>(local)] = -1;
    walk_part(domain, sources);
    const auto farthest = std::max_element(dual.begin(), dual.end(), [&](int a, int b) {
      return distance_[static_cast<std::size_t>(a)] < distance_[static_cast<std::size_t>(b)];
    });
    if (promoted == 0) sources.clear();
    sources.push_back(*farthest);
    make_corner(row(*farthest));
    std::erase_if(dual, is_corner);  // a slave takes what carries it along
    ++result_.num_floating_promoted;
  }
}

void Classifier::promote_floating(int wanted) {
  for (const DomainMatrix& domain : domains_) {
    distance_.assign(domain.rows.size(), -1);
    for (std::size_t seed = 0; seed < domain.rows.size(); ++seed)
      if (distance_[seed] < 0)
        promote_part(domain, walk_part(domain, {static_cast<int>(seed)}), wanted);
  }
}

Block Classifier::block(int row) const {
  switch (dof_class(row)) {
    case DofClass::Corner:
      return Block::Corner;
    case DofClass::Duplicate:
      return Block::Duplicate;
    case DofClass::Internal:
      break;
  }
  return sewn_.empty() || !sewn_[static_cast<std::size_t>(row)] ? Block::Internal : Block::Sewn;
}

/// Adds the rows of one block to a domain's numbering and the domain to the copies of those rows.
void Classifier::number_block(std::size_t d, const std::vector<int>& rows, Block wanted) {
  DomainDofs& dofs = result_.domains[d];
  for (const int row : rows) {
    if (block(row) != wanted) continue;
    const int index = index_[static_cast<std::size_t>(row)];
    const DofCopy copy{static_cast<int>(d), static_cast<int>(dofs.rows.size())};
    dofs.rows.push_back(row);
    if (wanted == Block::Internal) {
      ++dofs.num_internal;
    } else if (wanted == Block::Sewn) {
      ++dofs.num_sewn;
    } else if (wanted == Block::Corner) {
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

/// A dual row's place in a domain that has it.
DofCopy Classifier::numbered(int row, int domain) const {
  const DomainDofs& dofs = result_.domains[static_cast<std::size_t>(domain)];
  const bool is_sewn = block(row) == Block::Sewn;
  const auto first = dofs.rows.begin() + dofs.num_internal + (is_sewn ? dofs.num_duplicates : 0);
  const auto last =
      is_sewn ? dofs.rows.begin() + dofs.num_remainder() : first + dofs.num_duplicates;
  return {domain, static_cast<int>(std::lower_bound(first, last, row) - dofs.rows.begin())};
}

/// The copy of a dual row in `domain`, if it is there, or in its lowest domain.
DofCopy Classifier::copy_near(int row, int domain) const {
  for (const DofCopy& copy : copies(row))
    if (copy.domain == domain) return numbered(row, domain);
  return numbered(row, copies(row)[0].domain);
}

void Classifier::add_seam_entry(int multiplier, const DofCopy& copy, double coefficient) {
  result_.seam_copies.push_back(copy);
  result_.seam_coefficients.push_back(coefficient);
  DomainDofs& domain = result_.domains[static_cast<std::size_t>(copy.domain)];
  domain.seam_entries.push_back({multiplier, copy.local - domain.num_internal, coefficient});
}

/// Rows of multipliers x_s - sum_k T_sk x_k = 0 for all slaves but condensed ones. Where a vertex
/// has two copies any will do, as their own multiplier makes them equal.
void Classifier::number_seams() {
  const mesh::SeamMap& seams = result_.seams;
  if (seams.empty()) return;
  result_.seam_copies_begin.push_back(0);
  for (const int slave : seams.slaves) {
    if (result_.is_condensed(slave)) {
      result_.condensed_slaves.push_back(slave);
      continue;
    }
    const int multiplier = result_.num_multipliers();
    const DofCopy own = numbered(slave, copies(slave)[0].domain);
    result_.seam_slaves.push_back(slave);
    add_seam_entry(multiplier, own, 1);
    seams.visit_carriers(slave, [&](int carrier, double weight) {
      if (dof_class(carrier) == DofClass::Corner)
        result_.seam_corners.push_back(
            {multiplier, index_[static_cast<std::size_t>(carrier)], -weight});
      else
        add_seam_entry(multiplier, copy_near(carrier, own.domain), -weight);
    });
    result_.seam_copies_begin.push_back(static_cast<int>(result_.seam_copies.size()));
  }
}

InterfaceDofs Classifier::number() {
  index_.assign(result_.dof_class.size(), -1);
  for (int row = 0; row < result_.num_rows; ++row) {
    if (dof_class(row) == DofClass::Internal || result_.is_condensed(row)) continue;
    auto& rows = dof_class(row) == DofClass::Corner ? result_.corner_rows : result_.duplicate_rows;
    index_[static_cast<std::size_t>(row)] = static_cast<int>(rows.size());
    rows.push_back(row);
  }
  corner_copies_.resize(result_.corner_rows.size());
  result_.duplicate_copies.resize(result_.duplicate_rows.size());
  result_.domains.resize(domains_.size());
  for (std::size_t d = 0; d < domains_.size(); ++d) {
    const std::vector<int> rows = result_.unknowns(domains_[d].rows);
    for (const Block wanted : {Block::Internal, Block::Duplicate, Block::Sewn, Block::Corner})
      number_block(d, rows, wanted);
  }
  number_seams();
  result_.corner_copies_begin.push_back(0);
  for (const auto& list : corner_copies_) {
    result_.corner_copies.insert(result_.corner_copies.end(), list.begin(), list.end());
    result_.corner_copies_begin.push_back(static_cast<int>(result_.corner_copies.size()));
  }
  return std::move(result_);
}

}  // namespace

std::vector<int> DomainDofs::multipliers() const {
  std::vector<int> result = multiplier;
  for (const SeamEntry& entry : seam_entries)
    if (result.empty() || result.back() != entry.multiplier) result.push_back(entry.multiplier);
  return result;
}

std::vector<int> InterfaceDofs::unknowns(const std::vector<int>& rows) const {
  if (seams.empty()) return rows;
  std::vector<int> result;
  for (const int row : rows)
    visit_unknowns(row, [&](int unknown, double) { result.push_back(unknown); });
  std::sort(result.begin(), result.end());
  result.erase(std::unique(result.begin(), result.end()), result.end());
  return result;
}

InterfaceDofs classify_dofs(std::span<const DomainMatrix> domains, int num_rows,
                            const CornerOptions& options, mesh::SeamMap seams) {
  check_options(options);
  check_seams(seams, num_rows);
  Classifier classifier(domains, num_rows, std::move(seams));
  classifier.promote_along_curves(options.corner_fraction);
  classifier.promote_floating(options.floating_corners);
  return classifier.number();
}

}  // namespace piecework::global
