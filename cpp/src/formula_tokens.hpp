// A formula's text, token by token.
#pragma once

#include <algorithm>
#include <charconv>
#include <string>
#include <string_view>

#include "refuse.hpp"

namespace dualdrive {

inline bool is_digit(char c) { return c >= '0' && c <= '9'; }
inline bool begins_name(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
inline bool continues_name(char c) { return begins_name(c) || is_digit(c) || c == '.'; }
inline bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

class FormulaTokens {
  protected:
    explicit FormulaTokens(std::string_view text) : text_(text) { next(); }

    void next() {
        after_ = at_ + token_.size();
        at_ = after_;
        while (at_ < text_.size() && is_blank(text_[at_])) ++at_;
        token_ = text_.substr(at_, token_size());
    }

    std::size_t token_size() const {
        if (at_ == text_.size()) return 0;
        const char c = text_[at_];
        const std::string_view rest = text_.substr(at_);
        if (begins_name(c)) return count(rest, continues_name);
        if (is_digit(c) || c == '.') return number_size(rest);
        if (rest.starts_with("<=") || rest.starts_with(">=") || rest.starts_with("==") || rest.starts_with("!=") ||
            rest.starts_with("**"))
            return 2;
        const auto beyond_ascii = [](char x) { return static_cast<unsigned char>(x) >= 0x80; };
        return std::max<std::size_t>(1, count(rest, beyond_ascii));
    }

    template <class Predicate>
    static std::size_t count(std::string_view text, Predicate belongs) {
        const auto end = std::find_if_not(text.begin(), text.end(), belongs);
        return static_cast<std::size_t>(end - text.begin());
    }

    static std::size_t number_size(std::string_view text) {
        double value = 0.0;
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
        return error == std::errc::invalid_argument ? 1 : static_cast<std::size_t>(end - text.data());
    }

    bool take(std::string_view mark) {
        if (token_ != mark) return false;
        next();
        return true;
    }

    [[noreturn]] void fail(const std::string& rule) const { fail_at(at_, token_, rule); }
    [[noreturn]] void fail_at(std::size_t at, std::string_view token, const std::string& rule) const {
        const std::string what = token.empty() ? std::string("the end") : quoted(token);
        refuse("formula ", quoted(text_), ": column ", at + 1, ", ", what, ": ", rule);
    }

    std::string_view text_, token_;   // the token is empty at the end
    std::size_t at_ = 0, after_ = 0;  // where the token begins; where the one before it ended
};

}  // namespace dualdrive
