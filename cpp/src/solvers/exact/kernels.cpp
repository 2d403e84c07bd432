#include "kernels.hpp"

#include <cstdlib>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace dualdrive::exact {

namespace {

// The widest the processor has, unless the environment asks for one by name.
const Kernels& choose() {
    std::vector<const Kernels*> built{&build::baseline};
#if DUALDRIVE_KERNELS_X86
    const bool fused = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
    if (fused) built.push_back(&build::avx2);
    if (fused && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl"))
        built.push_back(&build::avx512);
#endif
    const char* const wanted = std::getenv("DUALDRIVE_KERNELS");
    if (!wanted || !*wanted) return *built.back();
    std::string known;
    for (const Kernels* k : built) {
        if (k->name == std::string_view(wanted)) return *k;
        known += (known.empty() ? "" : ", ") + std::string(k->name);
    }
    throw std::invalid_argument("environment: DUALDRIVE_KERNELS = " + std::string(wanted) +
                                " is none of what this processor runs (" + known + "); set one of them, or none");
}

}  // namespace

const Kernels& kernels() {
    static const Kernels& chosen = choose();
    return chosen;
}

}  // namespace dualdrive::exact
