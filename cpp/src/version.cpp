#include "dualdrive/version.hpp"

#include <sundials/sundials_config.h>

namespace dualdrive {

const char* version() { return DUALDRIVE_VERSION; }

const char* sundials_version() { return SUNDIALS_VERSION; }

}  // namespace dualdrive
