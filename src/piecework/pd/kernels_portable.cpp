// The outer loop's kernels for any processor.

#include "kernels.hpp"

namespace piecework::pd {

#include "kernels_impl.hpp"

const OuterKernels& portable_outer_kernels() { return kTable; }

}  // namespace piecework::pd
