#include "kernels.hpp"

#include <piecework/core/error.hpp>
#include <piecework/core/isa.hpp>

namespace piecework::global {

template <class T>
const Kernels<T>& kernels(Isa isa) {
  PIECEWORK_ASSERT(runs(isa));
#if defined(__x86_64__)
  if (isa == Isa::Avx512) return avx512_kernels<T>();
  if (isa == Isa::Avx2) return avx2_kernels<T>();
#endif
  return portable_kernels<T>();
}

template const Kernels<float>& kernels<float>(Isa);
template const Kernels<double>& kernels<double>(Isa);

}  // namespace piecework::global
