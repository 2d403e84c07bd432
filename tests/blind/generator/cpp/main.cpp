// Reads `name value` lines and `jerk time value` lines from standard input, simulates, and writes rows of
// doubles to standard output: t, theta_ref, theta_m, theta_1, theta_2, I_1, I_2, x_1, x_2, T_1, T_2 and
// the flanks; all at times from 0 on, every output_step.
#include "simulation.hpp"

#include <cstdio>
#include <exception>
#include <iostream>
#include <string>

namespace {

void read(std::istream& in, blind::Parameters& p, blind::Reference& reference) {
    std::string name;
    double value = 0, jerk = 0;
    while (in >> name >> value) {
        if (name == "jerk" && in >> jerk)
            reference.add(value, jerk);
        else
            p.set(name, value);
    }
    if (!in.eof()) throw std::invalid_argument("no number after " + name);
}

void write(const blind::Simulation& s, const blind::Reference& reference) {
    using namespace blind;
    const State& x = s.state();
    State rate{};
    double t = s.time();
    Torques q = s.plant().torques(t, x, rate);
    std::array<double, 13> row = {t,
                                  reference.at(t).angle,
                                  s.table_shown(),
                                  s.motor_shown(0),
                                  s.motor_shown(1),
                                  x[of(0, current)],
                                  x[of(1, current)],
                                  q.deflection[0],
                                  q.deflection[1],
                                  q.mesh[0],
                                  q.mesh[1],
                                  q.flank[0],
                                  q.flank[1]};
    std::fwrite(row.data(), sizeof(double), row.size(), stdout);
}

}  // namespace

int main() try {
    blind::Parameters p;
    blind::Reference reference;
    read(std::cin, p, reference);
    blind::Simulation simulation(p, reference);
    auto every = std::lround(p.output_step / p.step), steps = std::lround((p.end - p.begin) / p.step);
    auto lead = std::lround(-p.begin / p.step);
    for (long k = 0; k <= steps; ++k) {
        simulation.begin_step();
        if (k >= lead && (k - lead) % every == 0) write(simulation, reference);
        if (k < steps) simulation.step();
    }
    return 0;
} catch (const std::exception& error) {
    std::cerr << "blind: " << error.what() << '\n';
    return 1;
}
