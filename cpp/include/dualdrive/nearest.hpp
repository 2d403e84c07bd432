// "Did you mean ...?": the known names that look most like a misspelt one, for error messages.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace dualdrive {

// At most `count` of the known names, nearest first by edit distance; equal distances keep their order.
std::vector<std::string> nearest(std::string_view wrong, const std::vector<std::string>& known, std::size_t count = 3);

}  // namespace dualdrive
