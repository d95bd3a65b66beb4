// The outer loop's kernels for AVX-512 (F, DQ, VL, BW).

#include "kernels.hpp"

namespace piecework::pd {

#include "kernels_impl.hpp"

const OuterKernels& avx512_outer_kernels() { return kTable; }

}  // namespace piecework::pd
