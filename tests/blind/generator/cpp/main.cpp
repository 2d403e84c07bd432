// Reads `name value` lines, `jerk time value` lines and at most one `knots count step` line, which that many times
// four doubles follow, from standard input; simulates, and writes rows of doubles to standard output: t, theta_ref,
// omega_ref, theta_m, and of every drive theta, I, x, mesh torque, flank; all at times from 0 on, every output_step.
#include <cstdio>
#include <exception>
#include <iostream>
#include <string>
#include <vector>

#include "simulation.hpp"

namespace {

void read(std::istream& in, blind::Parameters& p, blind::Reference& reference) {
    std::string name;
    double value = 0, second = 0;
    while (in >> name >> value) {
        if (name == "jerk" && in >> second) {
            reference.add(value, second);
        } else if (name == "knots" && in >> second) {
            in.get();
            std::vector<blind::Knot> knots(static_cast<std::size_t>(value));
            in.read(reinterpret_cast<char*>(knots.data()),
                    static_cast<std::streamsize>(knots.size() * sizeof(blind::Knot)));
            if (!in) throw std::invalid_argument("fewer knots than were announced");
            reference.set(std::move(knots), second);
            return;
        } else {
            p.set(name, value);
        }
    }
    if (!in.eof()) throw std::invalid_argument("no number after " + name);
}

void write(const blind::Simulation& s, const blind::Reference& reference, std::size_t drives) {
    using namespace blind;
    const State& x = s.state();
    State rate{};
    double t = s.time();
    Torques q = s.plant().torques(t, x, rate);
    Command c = reference.at(t);
    std::vector<double> row = {t, c.angle, c.speed, s.table_shown()};
    for (std::size_t n = 0; n < drives; ++n)
        row.insert(row.end(), {s.motor_shown(n), x[of(n, current)], q.deflection[n], q.mesh[n], q.flank[n]});
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
        if (k >= lead && (k - lead) % every == 0) write(simulation, reference, p.count());
        if (k < steps) simulation.step();
    }
    return 0;
} catch (const std::exception& error) {
    std::cerr << "blind: " << error.what() << '\n';
    return 1;
}
