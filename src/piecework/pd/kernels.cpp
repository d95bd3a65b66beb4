#include "kernels.hpp"

#include <piecework/core/error.hpp>

namespace piecework::pd {

const OuterKernels& outer_kernels(Isa isa) {
  PIECEWORK_ASSERT(runs(isa));
#if defined(__x86_64__)
  if (isa == Isa::Avx512) return avx512_outer_kernels();
  if (isa == Isa::Avx2) return avx2_outer_kernels();
#endif
  return portable_outer_kernels();
}

}  // namespace piecework::pd
