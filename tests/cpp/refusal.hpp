// What an action says when it refuses its input.
#pragma once

#include <stdexcept>
#include <string>

// The message of the std::invalid_argument, or nothing when there was none.
template <class Action>
std::string refusal(Action action) {
    try {
        action();
    } catch (const std::invalid_argument& refused) {
        return refused.what();
    }
    return "";
}

inline bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }
