#include "laws.hpp"

#include <cmath>

namespace dualdrive::exact {

namespace {

// value t, rate 1 at t = 0; and value t²/2, rate t: their slopes at t = 0 are (1, 0) and (0, 1).
const Waveform& unit_slope_of_value() {
    static const Waveform w({0.0}, {Polynomial{0.0, 1.0}, Polynomial{0.0, 1.0}});
    return w;
}
const Waveform& unit_slope_of_rate() {
    static const Waveform w({0.0}, {Polynomial{0.0, 0.0, 0.5}, Polynomial{0.0, 0.0, 0.5}});
    return w;
}

}  // namespace

template <class R>
Reader<R>::Reader(const Machine& machine, const Inputs& inputs, const Layout& layout, const Generator& generator,
                  const std::vector<int>& recorded)
    : machine_(machine),
      layout_(layout),
      generator_(generator),
      recorded_(recorded),
      inputs_(inputs),
      model_(machine, inputs, layout),
      block_rates_(layout.blocks.size(), D(0.0)),
      about_(static_cast<std::size_t>(layout.size()), R(0)) {
    for (const auto& [name, waveform] : inputs) zero_[name] = Waveform();
    const auto only = [&](const std::string& name, const Waveform& w) {
        Inputs in = zero_;
        in[name] = w;
        return in;
    };
    for (const auto& [name, waveform] : inputs) {
        value_.push_back(only(name, unit_slope_of_value()));
        rate_.push_back(only(name, unit_slope_of_rate()));
        one_value_.push_back(only(name, Waveform(1.0)));
        one_rate_.push_back(only(name, unit_slope_of_value()));  // value 0, rate 1 at t = 0
    }
}

template <class R>
void Reader<R>::set_parameters(const std::vector<R>& values) {
    model_.set_parameters(std::vector<D>(values.begin(), values.end()).data());
}

template <class R>
typename Reader<R>::Stack Reader<R>::empty() const {
    const auto n = static_cast<Eigen::Index>(states()),
               g = static_cast<Eigen::Index>(layout_.switches.size() * guards_per_switch),
               m = static_cast<Eigen::Index>(recorded_.size()), b = static_cast<Eigen::Index>(layout_.blocks.size());
    return {Matrix<R>::Zero(n + g + m + b, size()), n, g, m, b};
}

template <class R>
void Reader<R>::evaluate(const Modes& modes, const D& t, const std::vector<D>& z, const Inputs& inputs) {
    model_.set_inputs(inputs);
    model_.evaluate(t, z.data(), {modes.data(), Cell{}, nullptr, nullptr, nullptr, scope_});
    const std::size_t n = z.size(), g = layout_.switches.size() * guards_per_switch;
    found_.resize(n + g + recorded_.size() + layout_.blocks.size());
    auto to = std::copy(model_.rate().begin(), model_.rate().end(), found_.begin());
    model_.guards(&*to, block_rates_.data());
    to += static_cast<std::ptrdiff_t>(g);
    for (const int s : recorded_) *to++ = model_.signals()[static_cast<std::size_t>(s)];
    for (std::size_t b = 0; b < layout_.blocks.size(); ++b) *to++ = model_.beyond(static_cast<int>(b));
}

template <class R>
std::vector<typename Reader<R>::Weight> Reader<R>::block_rate_weights(const Modes& modes) {
    std::vector<Weight> weights;
    const auto rides = [&](std::size_t e) {
        return layout_.switches[e].kind == SwitchKind::limiter && limiter::riding(modes[e]);
    };
    bool any = false;
    for (std::size_t e = 0; e < modes.size(); ++e) any = any || rides(e);
    if (!any) return weights;
    evaluate(modes, D(0.0), std::vector<D>(static_cast<std::size_t>(states()), D(0.0)), zero_);
    for (std::size_t e = 0; e < modes.size(); ++e) {
        if (!rides(e)) continue;
        const Switch& s = layout_.switches[e];
        block_rates_[static_cast<std::size_t>(s.index)] = D::variable(R(0), 0);
        for (int which = 0; which < guards_per_switch; ++which)
            weights.push_back({static_cast<Eigen::Index>(e) * guards_per_switch + which, s.index,
                               model_.guard(static_cast<int>(e), which, block_rates_.data()).slope[0]});
        block_rates_[static_cast<std::size_t>(s.index)] = D(0.0);
    }
    return weights;
}

template <class R>
template <class Store>
void Reader<R>::columns(const Modes& modes, const Store& store) {
    const auto n = static_cast<std::size_t>(states());
    const auto at = [](const R& value) {
        D d;
        d.value = value;
        return d;
    };
    std::vector<D>& z = point_;
    z.clear();
    for (const R& value : about_) z.push_back(at(value));
    for (std::size_t first = 0; first < n; first += directions) {
        const std::size_t last = std::min<std::size_t>(first + directions, n);
        for (std::size_t k = first; k < last; ++k) z[k] = D::variable(about_[k], static_cast<int>(k - first));
        evaluate(modes, at(when_), z, zero_);
        if (first == 0) store(one(), [](const D& q) { return q.value; });
        for (std::size_t k = first; k < last; ++k) {
            store(static_cast<Eigen::Index>(k), [&](const D& q) { return q.slope[k - first]; });
            if (about_[k] != R(0)) store(one(), [&](const D& q) { return -(q.slope[k - first] * about_[k]); });
            z[k] = at(about_[k]);
        }
    }
    for (std::size_t j = 0; j < generator_.inputs(); ++j)
        for (const bool rate : {false, true}) {
            evaluate(modes, D::variable(R(0), 0), z, (rate ? rate_ : value_)[j]);
            generator_.outputs(j, [&](int state, double of_value, double of_rate) {
                if (const R w(rate ? of_rate : of_value); w != R(0))
                    store(states() + state, [&](const D& q) { return w * q.slope[0]; });
            });
        }
}

template <class R>
typename Reader<R>::Stack Reader<R>::stack(const Modes& modes) {
    Stack s = empty();
    columns(modes, [&](Eigen::Index column, const auto& pick) {
        for (std::size_t row = 0; row < found_.size(); ++row)
            s.rows(static_cast<Eigen::Index>(row), column) += pick(found_[row]);
    });
    return s;
}

template <class R>
Energies<R> Reader<R>::energies(const Modes& modes) {
    std::vector<Product<D>> products;
    Matrix<R> a, b;  // the factors, a row for each product
    model_.list_products(&products);
    columns(modes, [&](Eigen::Index column, const auto& pick) {
        if (a.size() == 0) a = b = Matrix<R>::Zero(static_cast<Eigen::Index>(products.size()), size());
        for (Eigen::Index row = 0; row < a.rows(); ++row) {
            a(row, column) += pick(products[static_cast<std::size_t>(row)].a);
            b(row, column) += pick(products[static_cast<std::size_t>(row)].b);
        }
    });
    model_.list_products(nullptr);
    Energies<R> energies;
    for (Eigen::Index row = 0; row < a.rows(); ++row) {
        if (a.row(row).isZero(0) || b.row(row).isZero(0)) continue;
        Matrix<R>& form = energies[products[static_cast<std::size_t>(row)].path];
        if (form.size() == 0) form = Matrix<R>::Zero(size(), size());
        const Matrix<R> half = a.row(row).transpose() * b.row(row) / R(2);
        form += half + half.transpose();
    }
    return energies;
}

template <class R>
Matrix<R> Reader<R>::tick(const Modes& modes, const Clock& clock, double t, const double* z) {
    std::vector<int> own;
    for (std::size_t b = 0; b < layout_.blocks.size(); ++b)
        if (layout_.blocks[b].loop == clock.loop) own.push_back(static_cast<int>(b));
    const auto rows = static_cast<Eigen::Index>(states());
    Matrix<R> found = Matrix<R>::Zero(rows + 2 * static_cast<Eigen::Index>(own.size()), size());
    about_.assign(z, z + states());
    when_ = R(t);
    columns(modes, [&](Eigen::Index column, const auto& pick) {
        std::vector<D> next = point_;
        model_.tick(clock, next.data(), false);
        for (Eigen::Index row = 0; row < rows; ++row) found(row, column) += pick(next[static_cast<std::size_t>(row)]);
        Eigen::Index row = rows;
        for (const int b : own) {
            const Block<D>& block = model_.block(b);
            found(row++, column) += pick(block.limit - block.raw);
            found(row++, column) += pick(block.limit + block.raw);
        }
    });
    about_.assign(about_.size(), R(0));
    when_ = R(0);
    return found;
}

template <class R>
Laws<R> Reader<R>::unstack(const Stack& s) const {
    Laws<R> laws{Matrix<R>::Zero(size(), size()), s.rows.middleRows(s.rates, s.guards),
                 s.rows.middleRows(s.rates + s.guards, s.outputs), s.beyond()};
    laws.A.topRows(s.rates) = s.rows.topRows(s.rates);
    return laws;
}

template <class R>
Laws<R> Reader<R>::read(const Modes& modes) {
    Stack s = stack(modes);
    Laws<R> laws = unstack(s);
    generator_.write_equations(laws.A, states());
    for (const Weight& w : block_rate_weights(modes))
        laws.guards.row(w.guard) += w.weight * laws.beyond.row(w.block) * laws.A;
    return laws;
}

template <class R>
Laws<R> Reader<R>::tangent(const Modes& modes, double t, const double* z, Scope scope) {
    about_.assign(z, z + states());
    when_ = R(t);
    scope_ = scope;
    Laws<R> laws = read(modes);
    about_.assign(about_.size(), R(0));
    when_ = R(0);
    scope_ = Scope::whole;
    return laws;
}

template <class R>
Matrix<R> Reader<R>::slopes(const Modes& modes, double t, const Cell& cell, const double* z,
                            const std::vector<int>& along, Scope scope) {
    const auto rates = static_cast<Eigen::Index>(states());
    std::vector<D> guards(layout_.switches.size() * guards_per_switch);
    std::vector<D> point(z, z + states());
    Matrix<R> found(rates + static_cast<Eigen::Index>(guards.size()), static_cast<Eigen::Index>(along.size()));
    model_.set_inputs(inputs_);
    for (std::size_t first = 0; first < along.size(); first += directions) {
        const std::size_t last = std::min<std::size_t>(first + directions, along.size());
        for (std::size_t k = first; k < last; ++k)
            point[static_cast<std::size_t>(along[k])] = D::variable(R(z[along[k]]), static_cast<int>(k - first));
        model_.evaluate(D(R(t)), point.data(), {modes.data(), cell, nullptr, nullptr, nullptr, scope});
        model_.guards(guards.data(), nullptr);
        for (std::size_t k = first; k < last; ++k) {
            const auto column = static_cast<Eigen::Index>(k);
            for (Eigen::Index r = 0; r < rates; ++r)
                found(r, column) = model_.rate()[static_cast<std::size_t>(r)].slope[k - first];
            for (std::size_t g = 0; g < guards.size(); ++g)
                found(rates + static_cast<Eigen::Index>(g), column) = guards[g].slope[k - first];
            point[static_cast<std::size_t>(along[k])] = D(R(z[along[k]]));
        }
    }
    return found;
}

template <class R>
std::vector<Laws<R>> Reader<R>::derivatives(const Modes& modes,
                                            const std::vector<std::vector<std::size_t>>& parameters) {
    Stack plain = stack(modes);
    Matrix<R> A = unstack(plain).A;
    generator_.write_equations(A, states());
    const std::vector<Weight> weights = block_rate_weights(modes);
    const auto n = static_cast<std::size_t>(states());
    std::vector<Laws<R>> result;
    const std::vector<D> values(machine_.values().begin(), machine_.values().end());
    for (std::size_t first = 0; first < parameters.size(); first += directions) {
        const std::size_t count = std::min<std::size_t>(directions, parameters.size() - first);
        std::vector<D> seeded = values;
        for (std::size_t d = 0; d < count; ++d)
            for (const auto slot : parameters[first + d]) seeded[slot].slope[d] = R(1);
        model_.set_parameters(seeded.data());
        std::vector<Stack> s(count, empty());
        // A column is what an entry of 1 adds to the law at zero, as the law is affine.
        const auto store = [&](Eigen::Index column, R weight) {
            for (std::size_t d = 0; d < count; ++d)
                for (std::size_t row = 0; row < found_.size(); ++row) {
                    const auto k = static_cast<Eigen::Index>(row);
                    const R base = column == one() ? R(0) : s[d].rows(k, one());
                    s[d].rows(k, column) += weight * (found_[row].slope[d] - base);
                }
        };
        std::vector<D> z(n, D(0.0));
        evaluate(modes, D(0.0), z, zero_);
        store(one(), R(1));
        for (std::size_t k = 0; k < n; ++k) {
            z[k] = D(1.0);
            evaluate(modes, D(0.0), z, zero_);
            store(static_cast<Eigen::Index>(k), R(1));
            z[k] = D(0.0);
        }
        for (std::size_t j = 0; j < generator_.inputs(); ++j)
            for (const bool rate : {false, true}) {
                evaluate(modes, D(0.0), z, (rate ? one_rate_ : one_value_)[j]);
                generator_.outputs(j, [&](int state, double of_value, double of_rate) {
                    if (const R w(rate ? of_rate : of_value); w != R(0)) store(states() + state, w);
                });
            }
        for (Stack& d : s) {
            Laws<R> laws = unstack(d);
            for (const Weight& w : weights)
                laws.guards.row(w.guard) +=
                    w.weight * (laws.beyond.row(w.block) * A + plain.beyond().row(w.block) * laws.A);
            result.push_back(std::move(laws));
        }
    }
    model_.set_parameters(values.data());
    return result;
}

template class Reader<double>;
template class Reader<long double>;
template class Reader<Traced>;

}  // namespace dualdrive::exact
