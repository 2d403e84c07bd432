#include "dualdrive/unit.hpp"

#include <charconv>
#include <cmath>

#include "refuse.hpp"

namespace dualdrive {

struct UnitSymbol {
    std::string_view name;
    Unit unit;

    constexpr UnitSymbol(std::string_view symbol, double kg, double m, double s, double A, double K)
        : name(symbol), unit(Unit::Exponents{kg, m, s, A, K}) {}
};

namespace {

constexpr std::array<std::string_view, 5> base_names{"kg", "m", "s", "A", "K"};

constexpr UnitSymbol symbols[] = {
    {"kg", 1, 0, 0, 0, 0},  {"m", 0, 1, 0, 0, 0},     {"s", 0, 0, 1, 0, 0},    {"A", 0, 0, 0, 1, 0},
    {"K", 0, 0, 0, 0, 1},   {"rad", 0, 0, 0, 0, 0},   {"1", 0, 0, 0, 0, 0},    {"N", 1, 1, -2, 0, 0},
    {"J", 1, 2, -2, 0, 0},  {"W", 1, 2, -3, 0, 0},    {"Pa", 1, -1, -2, 0, 0}, {"Hz", 0, 0, -1, 0, 0},
    {"V", 1, 2, -3, -1, 0}, {"ohm", 1, 2, -3, -2, 0}, {"F", -1, -2, 4, 2, 0},  {"H", 1, 2, -2, -2, 0},
    {"C", 0, 0, 1, 1, 0},   {"Wb", 1, 2, -2, -1, 0},  {"T", 1, 0, -2, -1, 0},
};

// What a unit is called where that is shorter than its base units.
constexpr UnitSymbol usual_names[] = {
    {"N", 1, 1, -2, 0, 0},    {"N*m", 1, 2, -2, 0, 0},   {"N*m*s", 1, 2, -1, 0, 0},  {"W", 1, 2, -3, 0, 0},
    {"N/m", 1, 0, -2, 0, 0},  {"N*s/m", 1, 0, -1, 0, 0}, {"Pa", 1, -1, -2, 0, 0},    {"V", 1, 2, -3, -1, 0},
    {"ohm", 1, 2, -3, -2, 0}, {"H", 1, 2, -2, -2, 0},    {"N*m/A", 1, 2, -2, -1, 0}, {"N/A", 1, 1, -2, -1, 0},
};

constexpr double same = 1e-9;  // exponents that differ by less come from rounding, as of x^(1/3)
constexpr double largest_exponent = 100.0;

// A reader of unit texts: unit = factor (('*' | '/') factor)*, factor = (symbol | '(' unit ')') [('^' | '**') number].
class UnitReader {
  public:
    explicit UnitReader(std::string_view text) : text_(text) {}

    Unit read() {
        skip_blanks();
        if (at_ == text_.size()) return {};
        const Unit unit = product(0);
        if (at_ < text_.size()) fail("expected '*', '/' or '^'");
        return unit;
    }

  private:
    static constexpr int deepest = 50;

    Unit product(int depth) {
        Unit unit = factor(depth);
        while (true) {
            if (take("*")) {
                unit = unit * factor(depth);
            } else if (take("/")) {
                unit = unit / factor(depth);
            } else {
                return unit;
            }
        }
    }

    Unit factor(int depth) {
        const Unit unit = base(depth);
        if (take("**") || take("^")) return unit.power(exponent());
        return unit;
    }

    Unit base(int depth) {
        if (take("(")) {
            if (depth == deepest) fail("parentheses are nested too deeply");
            const Unit unit = product(depth + 1);
            if (!take(")")) fail("expected ')'");
            return unit;
        }
        const std::size_t begin = at_;
        while (at_ < text_.size() && is_letter(text_[at_])) ++at_;
        if (at_ == begin && at_ < text_.size() && text_[at_] == '1') ++at_;
        const std::string_view name = text_.substr(begin, at_ - begin);
        if (name.empty()) fail("expected a unit");
        for (const UnitSymbol& symbol : symbols)
            if (symbol.name == name) {
                skip_blanks();
                return symbol.unit;
            }
        at_ = begin;
        fail(quoted(name) + " is no coherent SI unit known here (kg m s A K rad N J W Pa Hz V ohm F H C Wb T)");
    }

    double exponent() {
        double value = 0.0;
        const auto [end, error] = std::from_chars(text_.data() + at_, text_.data() + text_.size(), value);
        if (error != std::errc() || !(std::abs(value) <= largest_exponent)) fail("expected an exponent, at most 100");
        at_ = static_cast<std::size_t>(end - text_.data());
        skip_blanks();
        return value;
    }

    static bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }

    void skip_blanks() {
        while (at_ < text_.size() && text_[at_] == ' ') ++at_;
    }
    bool take(std::string_view mark) {
        if (text_.substr(at_, mark.size()) != mark) return false;
        if (mark == "*" && text_.substr(at_, 2) == "**") return false;
        at_ += mark.size();
        skip_blanks();
        return true;
    }
    [[noreturn]] void fail(const std::string& rule) const {
        refuse("unit ", quoted(text_), ": column ", at_ + 1, ": ", rule);
    }

    std::string_view text_;
    std::size_t at_ = 0;
};

std::string factor_text(std::string_view name, double exponent) {
    std::ostringstream text;
    text << name;
    if (exponent != 1.0) text << '^' << exponent;
    return text.str();
}

}  // namespace

Unit Unit::parse(std::string_view text) { return UnitReader(text).read(); }

bool Unit::is_number() const { return *this == Unit(); }

Unit Unit::power(double exponent) const {
    Unit result;
    for (std::size_t k = 0; k < exponents_.size(); ++k) result.exponents_[k] = exponents_[k] * exponent;
    return result;
}

Unit Unit::times(const Unit& other, double exponent) const {
    Unit result;
    for (std::size_t k = 0; k < exponents_.size(); ++k)
        result.exponents_[k] = exponents_[k] + exponent * other.exponents_[k];
    return result;
}

bool operator==(const Unit& a, const Unit& b) {
    for (std::size_t k = 0; k < a.exponents_.size(); ++k)
        if (!(std::abs(a.exponents_[k] - b.exponents_[k]) <= same)) return false;
    return true;
}

std::string Unit::text() const {
    for (const UnitSymbol& usual : usual_names)
        if (usual.unit == *this) return std::string(usual.name);
    return base_text();
}

std::string Unit::base_text() const {
    std::string above, below;
    for (std::size_t k = 0; k < exponents_.size(); ++k) {
        if (std::abs(exponents_[k]) <= same) continue;
        std::string& side = exponents_[k] > 0.0 ? above : below;
        if (&side == &below) {
            side += '/';
        } else if (!side.empty()) {
            side += '*';
        }
        side += factor_text(base_names[k], std::abs(exponents_[k]));
    }
    return (above.empty() ? "1" : above) + below;
}

}  // namespace dualdrive
