// Refusals of bad input, all of one shape: one line that names the place, the value and the rule.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>

namespace dualdrive {

// Throws std::invalid_argument with the parts written one after the other; numbers in full precision.
template <class... Parts>
[[noreturn]] void refuse(const Parts&... parts) {
    std::ostringstream line;
    line.precision(std::numeric_limits<double>::max_digits10 - 2);
    (line << ... << parts);
    throw std::invalid_argument(line.str());
}

// A number as a sentence shows it.
inline std::string rounded(double value) {
    std::ostringstream text;
    text.precision(9);
    text << value;
    return text.str();
}

// A user's text as a message may show it: on one line, cut short between two UTF-8 characters.
inline std::string shown(std::string_view text) {
    constexpr std::size_t longest = 80;
    std::size_t size = std::min(text.size(), longest);
    while (size < text.size() && size > 0 && (static_cast<unsigned char>(text[size]) & 0xC0u) == 0x80u) --size;
    std::string line(text.substr(0, size));
    for (char& c : line)
        if (static_cast<unsigned char>(c) < 0x20) c = ' ';
    return size < text.size() ? line + "..." : line;
}

inline std::string quoted(std::string_view text) {
    std::string line = "'";
    line += shown(text);
    line += '\'';
    return line;
}

// One argument of a builder.
inline void require_finite(const char* builder, const char* name, double value) {
    if (!std::isfinite(value)) refuse(builder, ": ", name, " = ", value, " is not a finite number");
}
inline void require_positive(const char* builder, const char* name, double value) {
    if (!std::isfinite(value) || value <= 0.0) refuse(builder, ": ", name, " = ", value, " must be a positive number");
}

// A list of numbers; `increasing` ones each above the one before.
template <class List>
void require_finite_list(const char* builder, const char* name, const List& values) {
    for (std::size_t k = 0; k < values.size(); ++k)
        if (!std::isfinite(values[k]))
            refuse(builder, ": ", name, "[", k, "] = ", values[k], " is not a finite number");
}
template <class List>
void require_increasing(const char* builder, const char* name, const List& values) {
    require_finite_list(builder, name, values);
    for (std::size_t k = 1; k < values.size(); ++k)
        if (!(values[k] > values[k - 1]))
            refuse(builder, ": ", name, "[", k, "] = ", values[k], " does not lie above ", name, "[", k - 1,
                   "] = ", values[k - 1], ": ", name, " must increase");
}

}  // namespace dualdrive
