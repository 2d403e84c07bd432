#include "dualdrive/effects.hpp"

#include <array>
#include <optional>
#include <stdexcept>
#include <string>

#include "dualdrive/growth.hpp"
#include "dualdrive/nearest.hpp"
#include "dualdrive/structural.hpp"
#include "dualdrive/trace.hpp"

namespace dualdrive {
namespace {

template <template <class> class E>
EffectType describe() {
    EffectType type{E<double>::text, hooks_of<E>(), {}, memory_of<E>()};
    if constexpr (detail::Structural<E<double>>) {
        type.part = E<double>::part;
        if constexpr (requires { E<double>::joint; }) type.joint = E<double>::joint;
        for (const Declaration& lent : E<double>::parameters()) type.parameters.push_back(lent);
    } else {
        for (const auto& field : E<double>::parameters()) type.parameters.push_back(field.declaration);
    }
    return type;
}

template <template <class> class... E>
std::vector<EffectType> describe_all(EffectList<E...>) {
    return {describe<E>()...};
}

template <class S>
using Maker = std::unique_ptr<Effect<S>> (*)(const S* values);

template <template <class> class E, class S>
std::unique_ptr<Effect<S>> make(const S* values) {
    if constexpr (detail::Structural<E<double>>)
        return std::make_unique<Effect<S>>();  // the part itself acts
    else
        return std::make_unique<EffectOf<E, S>>(values);
}

template <class S, template <class> class... E>
Maker<S> maker(EffectList<E...>, std::size_t index) {
    static constexpr std::array<Maker<S>, sizeof...(E)> makers{&make<E, S>...};
    return makers[index];
}

std::optional<std::size_t> place_in(const std::vector<EffectType>& types, std::string_view name) {
    for (std::size_t k = 0; k < types.size(); ++k)
        if (name == types[k].text.name) return k;
    return std::nullopt;
}

[[noreturn]] void refuse(std::string_view name) {
    std::vector<std::string> known;
    for (const auto* types : {&effect_types(), &user_laws()})
        for (const auto& type : *types) known.emplace_back(type.text.name);
    std::string suggestions;
    for (const auto& near : nearest(name, known)) suggestions += (suggestions.empty() ? "" : ", ") + near;
    throw std::invalid_argument("no effect is called '" + std::string(name) + "'; nearest known: " + suggestions);
}

}  // namespace

const std::vector<EffectType>& effect_types() {
    static const std::vector<EffectType> types = describe_all(Registry{});
    return types;
}

const std::vector<EffectType>& user_laws() {
    static const std::vector<EffectType> laws{
        {{.name = "expression",
          .equation = "T = a formula over named signals, recorded columns, t, angle, speed and parameters of its own",
          .source = "its user",
          .validity = "a torque on one body; abs, sign, min, max and if switch where their argument changes its sign",
          .confused_with = "",
          .places = "table,pinions,motors"},
         hook::body,
         {}},
        {{.name = "spline",
          .equation =
              "T = cubic pieces through values at evenly spaced knots, over one coordinate or the product of two",
          .source = "Catmull, Rom, in Computer Aided Geometric Design, Academic Press 1974, 317-326",
          .validity =
              "smooth to the first derivative, constant outside the knots; no jump: dry friction beside it is coulomb",
          .confused_with = "",
          .places = "table,pinions,motors"},
         hook::body,
         {}}};
    return laws;
}

bool is_user_law(const EffectType& type) { return place_in(user_laws(), type.text.name).has_value(); }

const EffectType& effect_type(std::string_view name) {
    if (const auto k = place_in(effect_types(), name)) return effect_types()[*k];
    if (const auto k = place_in(user_laws(), name)) return user_laws()[*k];
    refuse(name);
}

template <class S>
std::unique_ptr<Effect<S>> make_effect(std::string_view name, const S* values) {
    const auto k = place_in(effect_types(), name);
    if (!k) refuse(name);
    return maker<S>(Registry{}, *k)(values);
}

template std::unique_ptr<Effect<double>> make_effect(std::string_view, const double*);
template std::unique_ptr<Effect<Gradient>> make_effect(std::string_view, const Gradient*);
template std::unique_ptr<Effect<FineGradient>> make_effect(std::string_view, const FineGradient*);
template std::unique_ptr<Effect<Traced>> make_effect(std::string_view, const Traced*);
template std::unique_ptr<Effect<TracedGradient>> make_effect(std::string_view, const TracedGradient*);
template std::unique_ptr<Effect<Growth>> make_effect(std::string_view, const Growth*);

}  // namespace dualdrive
