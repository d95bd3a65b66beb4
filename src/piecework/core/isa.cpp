#include <piecework/core/isa.hpp>

namespace piecework {

bool runs(Isa isa) {
#if defined(__x86_64__)
  switch (isa) {
    case Isa::Avx512:
      return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
             __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw") &&
             __builtin_cpu_supports("fma");
    case Isa::Avx2:
      return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
    case Isa::Portable:
      return true;
  }
#endif
  return isa == Isa::Portable;
}

std::vector<Isa> available_isas() {
  std::vector<Isa> result;
  for (const Isa isa : {Isa::Avx512, Isa::Avx2, Isa::Portable})
    if (runs(isa)) result.push_back(isa);
  return result;
}

Isa best_isa() { return available_isas().front(); }

std::string to_string(Isa isa) {
  switch (isa) {
    case Isa::Avx512:
      return "AVX-512";
    case Isa::Avx2:
      return "AVX2";
    case Isa::Portable:
      break;
  }
  return "portable";
}

}  // namespace piecework
