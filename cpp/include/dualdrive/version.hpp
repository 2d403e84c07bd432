#pragma once

namespace dualdrive {

/// Version of this library, from pyproject.toml.
const char* version();

/// Version of the SUNDIALS this library was built with.
const char* sundials_version();

/// Which of its inner loops this library uses on this processor: baseline, avx2 or avx512. The last bits of a result
/// depend on it; the environment variable DUALDRIVE_KERNELS sets a limit.
const char* kernels_name();

}  // namespace dualdrive
