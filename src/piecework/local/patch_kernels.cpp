#include "patch_kernels.hpp"

#include <piecework/core/error.hpp>

namespace piecework::local {

const PatchKernels& patch_kernels(Isa isa) {
  PIECEWORK_ASSERT(runs(isa));
#if defined(__x86_64__)
  if (isa == Isa::Avx512) return avx512_patch_kernels();
  if (isa == Isa::Avx2) return avx2_patch_kernels();
#endif
  return portable_patch_kernels();
}

}  // namespace piecework::local
