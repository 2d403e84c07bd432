#include "dualdrive/version.hpp"

#include <sundials/sundials_config.h>

#include "solvers/exact/kernels.hpp"

namespace dualdrive {

const char* version() { return DUALDRIVE_VERSION; }

const char* sundials_version() { return SUNDIALS_VERSION; }

const char* kernels_name() { return exact::kernels().name; }

}  // namespace dualdrive
