#include <doctest/doctest.h>

#include <cstring>

#include "dualdrive/version.hpp"

TEST_CASE("the version is a dotted number") { CHECK(std::strchr(dualdrive::version(), '.') != nullptr); }
