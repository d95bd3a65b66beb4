#include <piecework/local/jacobi.hpp>

#include <algorithm>
#include <cmath>

#include <piecework/core/parallel.hpp>
#include <piecework/model/projection.hpp>

#include "patch_kernels.hpp"
#include "patches.hpp"

namespace piecework::local {
namespace {

struct alignas(64) Line {
  double number[8];
};

/// What one thread works in: it stays in the nearest caches from patch to patch.
struct Scratch {
  std::vector<Line> x, force;  ///< rows of four numbers, two per line
  std::vector<int> degenerate;

  void reserve(const Patches& patches) {
    const auto lines = static_cast<std::size_t>(patches.max_vertices + 1) / 2;
    const auto slots = static_cast<std::size_t>(patches.max_batches) * kLanes;
    if (x.size() < lines) {
      x.resize(lines);
      force.resize(lines);
    }
    if (degenerate.size() < slots) degenerate.resize(slots);
  }
};

Scratch& scratch_of_thread(const Patches& patches) {
  static thread_local Scratch scratch;
  scratch.reserve(patches);
  return scratch;
}

}  // namespace

struct JacobiStep::Impl {
  struct Sum {
    double energy = 0;
    int degenerate = 0;
  };
  struct Call {
    const Positions& x;
    const model::StepProblem& problem;
    Positions& gradient;
  };

  Impl(const model::ClothModel& m, double h, Isa isa)
      : model(m),
        inverse_h_sq(1.0 / (h * h)),
        patches(m),
        kernels(patch_kernels(isa)),
        partial(static_cast<std::size_t>(patches.num_partials)),
        sums(patches.patches.size()) {
    inertia.reserve(patches.vertex.size());
    for (const int v : patches.vertex) inertia.push_back(model.mass[v] * inverse_h_sq);
  }

  Sum run_patch(const Patch& patch, const Call& call);
  Sum add_degenerate(const Patch& patch, const Degenerate& list, const Call& call,
                     double* force) const;
  double join_rim(std::size_t i, const Call& call) const;

  const model::ClothModel& model;
  double inverse_h_sq;
  Patches patches;
  const PatchKernels& kernels;
  std::vector<double> inertia;           ///< m / h^2 of patches.vertex, N/m
  std::vector<Eigen::Vector4d> partial;  ///< forces of each patch on the vertices of its rim, N
  std::vector<Sum> sums;                 ///< per patch
};

JacobiStep::JacobiStep(const model::ClothModel& model, double h, Isa isa)
    : impl_(std::make_unique<Impl>(model, h, isa)) {}
JacobiStep::~JacobiStep() = default;
JacobiStep::JacobiStep(JacobiStep&&) noexcept = default;

JacobiStep::Result JacobiStep::evaluate(const Positions& x, const model::StepProblem& problem,
                                        Positions& gradient) {
  gradient.resize(x.rows(), 3);
  const Impl::Call call{x, problem, gradient};
  const std::vector<Patch>& patches = impl_->patches.patches;
  parallel_for(
      patches.size(), [&](std::size_t p) { impl_->sums[p] = impl_->run_patch(patches[p], call); },
      1);
  Result result;
  for (const Impl::Sum& sum : impl_->sums) {
    result.energy += sum.energy;
    result.degenerate += sum.degenerate;
  }
  result.energy += parallel_sum<double>(impl_->patches.rim.size(),
                                        [&](std::size_t i) { return impl_->join_rim(i, call); });
  return result;
}

JacobiStep::Impl::Sum JacobiStep::Impl::run_patch(const Patch& patch, const Call& call) {
  Scratch& scratch = scratch_of_thread(patches);
  double* x = scratch.x.front().number;
  double* force = scratch.force.front().number;
  const int* vertices = patches.vertex.data() + patch.first_vertex;
  const auto numbers = 4 * static_cast<std::size_t>(patch.num_vertices);
  kernels.gather(call.x.data(), vertices, patch.num_vertices, x);
  std::fill_n(force, numbers, 0.0);

  Degenerate degenerate{scratch.degenerate.data(), 0};
  double energy = kernels.triangles(patches.batches.data() + patch.first_batch,
                                    patches.corners.data() + patch.first_batch, patch.num_batches,
                                    x, force, degenerate);
  Sum sum = add_degenerate(patch, degenerate, call, force);
  if (patch.num_flat > 0)
    energy += kernels.flat(patches.flat.data() + patch.first_flat, patch.num_flat, x, force);
  if (patch.num_curved > 0)
    energy +=
        kernels.curved(patches.curved.data() + patch.first_curved, patch.num_curved, x, force);
  energy += kernels.finish({vertices, patch.num_inner, inertia.data() + patch.first_vertex,
                            call.problem.predicted->data(), call.problem.fixed->data()},
                           x, force, call.gradient.data());
  if (patch.num_inner < patch.num_vertices)
    std::copy(force + 4 * patch.num_inner, force + numbers,
              partial[static_cast<std::size_t>(patch.first_partial)].data());
  sum.energy += energy;
  return sum;
}

JacobiStep::Impl::Sum JacobiStep::Impl::add_degenerate(const Patch& patch, const Degenerate& list,
                                                       const Call& call, double* force) const {
  Sum sum;
  for (int i = 0; i < list.count; ++i) {
    const int slot = list.slot[i];
    const auto batch = static_cast<std::size_t>(patch.first_batch + slot / kLanes);
    const int t = patches.triangle[static_cast<std::size_t>(kLanes * patch.first_batch + slot)];
    if (t < 0) continue;  // the last batch has room left
    const model::StretchConstraint& c = model.stretch[static_cast<std::size_t>(t)];
    const Mat32 F = model::deformation_gradient(c, call.x);
    Mat32 R;
    model::project_stretch(c, F, *call.problem.previous, model.start, R);
    const Mat32 forces = c.weight * (F - R) * c.rest_inverse.transpose();
    const auto at = [&](std::size_t k) {
      return Eigen::Map<Vec3>(force + patches.corners[batch].corner[k][slot % kLanes]);
    };
    at(0) -= forces.col(0) + forces.col(1);
    at(1) += forces.col(0);
    at(2) += forces.col(1);
    sum.energy += 0.5 * c.weight * (F - R).squaredNorm();
    ++sum.degenerate;
  }
  return sum;
}

double JacobiStep::Impl::join_rim(std::size_t i, const Call& call) const {
  const int v = patches.rim[i];
  if ((*call.problem.fixed)[static_cast<std::size_t>(v)] != 0) {
    call.gradient.row(v).setZero();
    return 0;
  }
  const Vec3 offset = (call.x.row(v) - call.problem.predicted->row(v)).transpose();
  const double stiffness = model.mass[v] * inverse_h_sq;
  Vec3 force = stiffness * offset;
  for (int k = patches.partial_begin[i]; k < patches.partial_begin[i + 1]; ++k)
    force +=
        partial[static_cast<std::size_t>(patches.partial[static_cast<std::size_t>(k)])].head<3>();
  call.gradient.row(v) = force.transpose();
  return 0.5 * stiffness * offset.squaredNorm();
}

}  // namespace piecework::local
