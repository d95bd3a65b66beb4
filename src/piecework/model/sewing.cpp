#include <piecework/model/sewing.hpp>

#include <algorithm>
#include <numeric>
#include <utility>

#include <piecework/core/parallel.hpp>

namespace piecework::model {
namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

/// 1 at time 0, 0 from `close` on, without a jump of the speed at either end.
double openness(double time, double close) {
  if (time >= close) return 0;
  const double u = std::max(0.0, time / close);
  return 1 - u * u * (3 - 2 * u);
}

}  // namespace

Sewing::Sewing(mesh::SeamMap map, const Positions& start) : map_(std::move(map)) {
  if (map_.empty()) return;
  start_gap_ = Positions::Zero(map_.num_slaves(), 3);
  for (int s = 0; s < map_.num_slaves(); ++s)
    if (map_.close_time[at(s)] > 0)
      start_gap_.row(s) = start.row(map_.slaves[at(s)]) - carried(start, s);

  load_begin_.assign(map_.row.size() + 1, 0);
  for (const int carrier : map_.carrier) ++load_begin_[at(carrier) + 1];
  std::partial_sum(load_begin_.begin(), load_begin_.end(), load_begin_.begin());
  load_.resize(map_.carrier.size());
  std::vector<int> cursor(load_begin_.begin(), load_begin_.end() - 1);
  for (int s = 0; s < map_.num_slaves(); ++s)
    for (int k = map_.begin[at(s)]; k < map_.begin[at(s) + 1]; ++k)
      load_[at(cursor[at(map_.carrier[at(k)])]++)] = {map_.slaves[at(s)], map_.weight[at(k)]};
}

Eigen::RowVector3d Sewing::carried(const Positions& x, int slave) const {
  // Differences to the first carrier keep the accuracy far from the origin; one carrier: its bits.
  const int first = map_.begin[at(slave)];
  const auto base = x.row(map_.carrier[at(first)]);
  Eigen::RowVector3d offset = Eigen::RowVector3d::Zero();
  for (int k = first + 1; k < map_.begin[at(slave) + 1]; ++k)
    offset += map_.weight[at(k)] * (x.row(map_.carrier[at(k)]) - base);
  return base + offset;
}

Eigen::RowVector3d Sewing::place(double time, const Positions& x, int slave) const {
  const double open = openness(time, map_.close_time[at(slave)]);
  if (open > 0) return carried(x, slave) + open * start_gap_.row(slave);
  return carried(x, slave);
}

void Sewing::follow(double time, Positions& x) const {
  parallel_for(map_.slaves.size(),
               [&](std::size_t i) { x.row(map_.slaves[i]) = place(time, x, static_cast<int>(i)); });
}

void Sewing::settle(double time, const Eigen::VectorXd& mass, const std::vector<char>& fixed,
                    Positions& x) const {
  if (empty()) return;
  Positions wanted(map_.num_slaves(), 3);  // m_s (z_s - (T z)_s - o_s)
  parallel_for(map_.slaves.size(), [&](std::size_t i) {
    const int s = static_cast<int>(i);
    const int v = map_.slaves[i];
    wanted.row(s) = mass[v] * (x.row(v) - place(time, x, s));
  });
  parallel_for(map_.row.size(), [&](std::size_t v) {
    if (fixed[v] || load_begin_[v] == load_begin_[v + 1]) return;
    const auto row = static_cast<Eigen::Index>(v);
    Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
    double total = mass[row];
    for (int k = load_begin_[v]; k < load_begin_[v + 1]; ++k) {
      const Load& load = load_[at(k)];
      sum += load.weight * wanted.row(map_.row[at(load.slave)]);
      total += load.weight * mass[load.slave];
    }
    x.row(row) += sum / total;
  });
  follow(time, x);
}

void Sewing::fold(Positions& f) const {
  if (empty()) return;
  parallel_for(map_.row.size(), [&](std::size_t i) {
    const int v = static_cast<int>(i);
    if (map_.row[i] < 0 && load_begin_[i] < load_begin_[i + 1]) f.row(v) = folded(f, v);
  });
  for (const int v : map_.slaves) f.row(v).setZero();
}

void Sewing::mark_held(std::vector<char>& fixed) const {
  for (int s = 0; s < map_.num_slaves(); ++s) {
    const auto first = map_.carrier.begin() + map_.begin[at(s)];
    const auto last = map_.carrier.begin() + map_.begin[at(s) + 1];
    fixed[at(map_.slaves[at(s)])] =
        std::all_of(first, last, [&](int c) { return fixed[at(c)] != 0; });
  }
}

double Sewing::gap(const Positions& x, int slave) const {
  return (x.row(map_.slaves[at(slave)]) - carried(x, slave)).norm();
}

double Sewing::gap(const Positions& x) const {
  return parallel_max(map_.slaves.size(),
                      [&](std::size_t s) { return gap(x, static_cast<int>(s)); });
}

}  // namespace piecework::model
