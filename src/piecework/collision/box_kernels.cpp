#include "box_kernels.hpp"

#include <piecework/core/error.hpp>

namespace piecework::collision {

const BoxKernels& box_kernels(Isa isa) {
  PIECEWORK_ASSERT(runs(isa));
#if defined(__x86_64__)
  if (isa == Isa::Avx512) return avx512_box_kernels();
  if (isa == Isa::Avx2) return avx2_box_kernels();
#endif
  return portable_box_kernels();
}

}  // namespace piecework::collision
