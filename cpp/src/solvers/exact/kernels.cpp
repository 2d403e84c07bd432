#include "kernels.hpp"

#include <cstdlib>
#include <string_view>

namespace dualdrive::exact {

namespace {

const Kernels& choose() {
    [[maybe_unused]] const char* wanted = std::getenv("DUALDRIVE_KERNELS");
#if DUALDRIVE_KERNELS_X86
    const std::string_view limit = wanted ? wanted : "";
    const bool fused = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
    if (limit.empty() && fused && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl"))
        return build::avx512;
    if (fused && limit != build::baseline.name) return build::avx2;
#endif
    return build::baseline;
}

}  // namespace

const Kernels& kernels() {
    static const Kernels& chosen = choose();
    return chosen;
}

}  // namespace dualdrive::exact
