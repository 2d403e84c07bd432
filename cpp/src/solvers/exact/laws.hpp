// A machine as a linear system while its modes are frozen: ẏ = A y with y = (states, generator of the inputs, 1).
//
// Nothing is derived a second time: the rows are read off the one model, as its derivatives along the states and along
// the inputs. Machine and controller are affine between switches, so that these derivatives are all there is.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "dualdrive/model.hpp"
#include "generator.hpp"

template <>
struct Eigen::NumTraits<dualdrive::Traced> : Eigen::NumTraits<double> {
    using Real = dualdrive::Traced;
    using NonInteger = dualdrive::Traced;
    using Nested = dualdrive::Traced;
    enum { RequireInitialization = 1 };
};

namespace dualdrive::exact {

template <class R>
using Matrix = Eigen::Matrix<R, Eigen::Dynamic, Eigen::Dynamic>;

// Each matrix has one column per entry of y.
template <class R>
struct Laws {
    Matrix<R> A;        // rates
    Matrix<R> guards;   // guards_per_switch per element
    Matrix<R> outputs;  // the recorded signals
    Matrix<R> beyond;   // of blocks, what Model::beyond says
};

// Powers by path, and last the stored energy, as symmetric forms y' Q y; empty where nothing flows.
template <class R>
using Energies = std::array<Matrix<R>, powers + 1>;

template <class R>
class Reader {
  public:
    using D = Dual<R, directions>;

    Reader(const Machine& machine, const Inputs& inputs, const Layout& layout, const Generator& generator,
           const std::vector<int>& recorded);

    // New values of the machine's parameters, with what they carry.
    void set_parameters(const std::vector<R>& values);

    int states() const { return layout_.size(); }
    int size() const { return states() + generator_.size() + 1; }  // of y
    int one() const { return size() - 1; }                         // the entry that is 1

    Laws<R> read(const Modes& modes);
    // The tangent at state z and time t of a machine that is not affine, or of its plant alone; read() belongs to zero.
    Laws<R> tangent(const Modes& modes, double t, const double* z, Scope scope = Scope::whole);
    // Derivatives along some of the states at state z and time t, under the inputs as they are: of the rates, and below them
    // of the guards.
    Matrix<R> slopes(const Modes& modes, double t, const Cell& cell, const double* z, const std::vector<int>& along,
                     Scope scope);
    Energies<R> energies(const Modes& modes);
    // What a clock's tick makes of the states in these modes where no limit is met, as affine in y; below, by how much each of its
    // blocks then stays within its upper limit and its lower one. Of a machine that is not affine about z at time t.
    Matrix<R> tick(const Modes& modes, const Clock& clock, double t, const double* z);

    // ∂(laws)/∂p for each list of parameter slots that move together.
    std::vector<Laws<R>> derivatives(const Modes& modes, const std::vector<std::vector<std::size_t>>& parameters);

  private:
    // Everything that is affine in y, stacked: rates, guards, outputs, then `beyond`.
    struct Stack {
        Matrix<R> rows;
        Eigen::Index rates, guards, outputs, blocks;  // how many of each
        auto beyond() const { return rows.bottomRows(blocks); }
    };
    Stack empty() const;
    void evaluate(const Modes& modes, const D& t, const std::vector<D>& z, const Inputs& inputs);
    // Evaluates until every column of y was seen: calls store(column, pick), where pick takes the column's share out of
    // whatever the model gave.
    template <class Store>
    void columns(const Modes& modes, const Store& store);
    Stack stack(const Modes& modes);
    Laws<R> unstack(const Stack& s) const;
    // The guards of riding limiters are rates of blocks: their weights, (guard, block, weight) each.
    struct Weight {
        Eigen::Index guard, block;
        R weight;
    };
    std::vector<Weight> block_rate_weights(const Modes& modes);

    const Machine& machine_;
    const Layout& layout_;
    const Generator& generator_;
    const std::vector<int>& recorded_;
    const Inputs& inputs_;
    Inputs zero_;
    std::vector<Inputs> value_, rate_;  // one input of them 1·t, or with the rate 1·t, all others zero
    std::vector<Inputs> one_value_, one_rate_;
    Model<D> model_;
    std::vector<D> found_, block_rates_, point_;  // what the model gave; of blocks; where it was asked
    std::vector<R> about_;                        // the state that tangents touch at
    R when_{0};
    Scope scope_ = Scope::whole;
};

extern template class Reader<double>;
extern template class Reader<long double>;
extern template class Reader<Traced>;

}  // namespace dualdrive::exact
