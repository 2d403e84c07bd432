// What a run leaves for the way back: every propagation, switch and jump in order, with the state each began from.
//
// The gradient of a cost with respect to any number of parameters follows by walking the tape backwards once: exact, since
// each entry is reversed as it was computed (the discrete adjoint).
#pragma once

#include <cstddef>
#include <vector>

namespace dualdrive {

namespace exact {
template <class R>
class Propagator;
}

struct Entry {
    enum class Kind {
        steps,  // of an engine, as it keeps them itself
        outputs,  // `count` rows of the recorded signals from `row` on, where the engine says; `column` −1: at the present
                  // state, after a switch or a jump, else within the steps before them
        instant,  // a guard fell here: guard `count`, falling at the rate `length` (per s)
        still,    // what follows happens at a time that does not depend on parameters
        shift,    // the state changed its rate by −(values at `y`): a switch; `column`: a state set to zero, or −1
        jump      // jump number `count` of the simulation
    } kind;
    // The exact engine's. Steps: `count` whole ones, then `length` seconds more if `column` is 1; at `y` all states, the last
    // included. Outputs: at the columns from `column` on; or one, `length` after that column, its y kept. Null: of the
    // exponential engine, whose steps are numbered by `count`; its outputs and guards were read at the place `place`.
    const exact::Propagator<double>* law = nullptr;
    int count = 0, column = -1, row = 0, place = -1;
    double length = 0.0;
    std::size_t y = 0;  // of the values it keeps
};

class Tape {
  public:
    std::vector<Entry> entries;
    std::vector<double> values;

    void add(Entry entry, const double* y = nullptr, int size = 0) {
        entry.y = values.size();
        entries.push_back(entry);
        values.insert(values.end(), y, y + size);
    }
    // The next row is what the law makes of y: at a whole column of the steps before it, or `ahead` of that.
    void add_output(const exact::Propagator<double>* law, int column, double ahead, const double* y, int size) {
        const bool stored = column >= 0 && ahead == 0.0;
        Entry* last = entries.empty() ? nullptr : &entries.back();
        if (stored && last && last->kind == Entry::Kind::outputs && last->law == law && last->length == 0.0 &&
            last->column >= 0 && last->column + last->count == column)
            ++last->count;
        else
            add({.kind = Entry::Kind::outputs, .law = law, .count = 1, .column = column, .row = rows_, .length = ahead},
                y, stored ? 0 : size);
        ++rows_;
    }
    // The next row is read off the model at that place; `present` as `outputs` says.
    void add_reading(int place, bool present) {
        add({.kind = Entry::Kind::outputs, .count = 1, .column = present ? -1 : 0, .row = rows_++, .place = place});
    }

  private:
    int rows_ = 0;
};

}  // namespace dualdrive
