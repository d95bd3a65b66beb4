// Solves (s L + I) X = B, L the Laplacian of a grid, three right-hand sides, for two values of s.

#include <cmath>
#include <cstdio>
#include <vector>

#include <piecework/global/tree_solver.hpp>

using piecework::global::SolveStatus;
using piecework::global::TreeSolver;

constexpr int kSide = 100;
constexpr int kColumns = 3;

/// Lower triangle in compressed columns.
struct Matrix {
  std::vector<int> begin{0}, row;
  std::vector<double> value;

  explicit Matrix(double s) {
    for (int i = 0; i < kSide * kSide; ++i) {
      const int x = i % kSide, y = i / kSide;
      add(i, 1 + s * ((x > 0) + (x + 1 < kSide) + (y > 0) + (y + 1 < kSide)));
      if (x + 1 < kSide) add(i + 1, -s);
      if (y + 1 < kSide) add(i + kSide, -s);
      begin.push_back(static_cast<int>(row.size()));
    }
  }
  void add(int r, double v) { row.push_back(r), value.push_back(v); }
};

/// |B - A X|; number c of row i at x[kColumns * i + c].
double residual(const Matrix& a, const std::vector<double>& x, std::vector<double> b) {
  for (int j = 0; j < kSide * kSide; ++j)
    for (int k = a.begin[j]; k < a.begin[j + 1]; ++k)
      for (int c = 0, i = a.row[k]; c < kColumns; ++c) {
        b[kColumns * i + c] -= a.value[k] * x[kColumns * j + c];
        if (i != j) b[kColumns * j + c] -= a.value[k] * x[kColumns * i + c];
      }
  double sum = 0;
  for (const double r : b) sum += r * r;
  return std::sqrt(sum);
}

bool solves(TreeSolver& solver, const Matrix& a, const std::vector<double>& b) {
  std::vector<double> x(b.size());
  if (solver.factor(a.value) != SolveStatus::Ok) return false;
  if (solver.solve(b.data(), x.data(), kColumns, kColumns, 1) != SolveStatus::Ok) return false;
  std::printf("%s: |B - A X| = %.1e\n", solver.description().c_str(), residual(a, x, b));
  return residual(a, x, b) < 1e-10;
}

int main() {
  const Matrix soft(1), stiff(100);
  std::vector<double> b(kColumns * kSide * kSide);
  for (std::size_t i = 0; i < b.size(); ++i) b[i] = std::sin(static_cast<double>(i));
  TreeSolver solver;
  solver.analyze({soft.begin, soft.row});  // once: both matrices have this pattern
  return solves(solver, soft, b) && solves(solver, stiff, b) ? 0 : 1;
}
