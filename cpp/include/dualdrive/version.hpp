#pragma once

namespace dualdrive {

/// Version of this library, from pyproject.toml.
const char* version();

/// Version of the SUNDIALS this library was built with.
const char* sundials_version();

}  // namespace dualdrive
