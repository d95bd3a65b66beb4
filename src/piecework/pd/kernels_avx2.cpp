// The outer loop's kernels for AVX2 and FMA.

#include "kernels.hpp"

namespace piecework::pd {

#include "kernels_impl.hpp"

const OuterKernels& avx2_outer_kernels() { return kTable; }

}  // namespace piecework::pd
