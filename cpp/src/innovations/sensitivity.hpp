// How a replay changes, to first order, where neighbours of its machine take its place.
//
// Modes and gains held, the change δx of the filter's state obeys the predictor's own recursion (Ljung, System Identification,
// 2nd ed., §10.3):
//
//   δe_k = −C δx_k − v_k,   δx_{k+1} = F (δx_k + K_s δe_k) + w_k,   δr_k = S_s^(−1/2) δe_k
//
// w_k is what the neighbour does otherwise over a sample from the replayed state on, v_k what its sensors say otherwise of it.
// Where modes change within the sample, the neighbour's instant is another one: of second order where forces are continuous, else
// a saltation.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "flow.hpp"
#include "reading.hpp"

namespace dualdrive::innovations {

class Sensitivities {
  public:
    // Machine, record, gains, neighbours and readings must outlive it. own: how the machine itself is read. offsets: of its
    // sensors.
    Sensitivities(const Machine& machine, const SampledRecord& record, const KalmanGains& gains,
                  const std::vector<Neighbour>& neighbours, const std::vector<Reading>& own,
                  const std::vector<double>& offsets, const SensitivityOptions& how);

    // Whether they can be told of a machine at all.
    static bool told(const Flow& flow, const std::vector<Reading>& readings);
    bool any() const { return !columns_.empty(); }  // whether there is one that can be told so

    // In the order of a replay, whose flow it is: a stretch begins; what a sample corrects; to the next one, before the flow
    // goes there and after.
    void begin(std::size_t stretch, std::size_t sample, const Flow& flow, const std::map<std::string, double>& initial);
    // outputs: of the replay; counts: whether its residuals do.
    void correct(std::size_t sample, const double* outputs, const KalmanGains::Set& gain, bool counts);
    void depart(Flow& flow);
    void arrive(std::size_t sample, const Flow& flow);

    // Whether replays would cost less: bodies that bounce change modes too often.
    bool dear() const;

    // Per neighbour, samples × channels; empty for those that can't be told so.
    std::vector<std::vector<double>> found();

  private:
    // An entry of a matrix that has few.
    struct Entry {
        std::size_t row, column;
        double value;
    };
    // Over a sample, [F; C F] of states and torques of unknown course, and what constant rates of the states become; empty until
    // they are worth it.
    struct Propagator {
        double asked = 0.0;  // terms of series that it would have spared
        Eigen::MatrixXd flow, pushed;
        std::vector<Eigen::MatrixXd> apart;  // by how much
    };
    // One pattern of modes. Of neighbours whose laws are affine, by how much theirs differ.
    struct Tangent {
        Modes modes;
        Eigen::MatrixXd shown;                                 // C of the machine's states
        std::vector<Eigen::MatrixXd> showing;                  // by how much the neighbours' C of all that y has differ
        std::vector<bool> shows_otherwise;                     // whether they do
        std::vector<std::size_t> held;                         // speeds that friction holds at 0
        Eigen::MatrixXd outputs, guards;                       // of all that y has
        std::vector<Eigen::MatrixXd> guarding;                 // by how much
        std::vector<Eigen::MatrixXd> slaving;                  // likewise of rows of riding limiters' integrators
        std::vector<double> rates;                             // A, padded rows
        double bound = 0.0;                                    // on its spectral radius, 1/s
        std::vector<std::vector<Entry>> differs;               // by how much
        Frozen known;                                          // its ticks
        std::vector<std::vector<std::vector<Entry>>> ticking;  // per clock and neighbour, by how much
        std::map<std::size_t, Propagator> propagators;         // by phase of the ticks, and which of them wait
    };
    // Of a sample on which modes change or a tick meets a limit: what holds, since which guard fell or which tick was, for how
    // long, s.
    struct Piece {
        const Tangent* tangent;
        int guard = -1, event = -1;
        double length = 0.0;
        const Flow::Limited* limited = nullptr;  // of the tick; null: it meets no limit
    };
    struct Column {
        std::size_t neighbour;
        std::unique_ptr<Flow> flow;
        std::vector<Reading> readings;
        std::vector<double> offsets;  // less the machine's own
    };
    // A sample of the replay. What it does to neighbours waits until there are some of them: matrices serve many at once.
    struct Moment {
        std::size_t sample;
        bool counts;
        const Tangent* arrived;             // before the sample was corrected
        const Tangent* leaving;             // null: a stretch ends
        const Propagator* over;             // null: it goes in pieces
        std::vector<Flow::Change> changes;  // of modes, on the way to the next one
        std::vector<Piece> pieces;          // on the way to the next one; empty: a propagator leads there
        std::vector<double> outputs, gain;
    };
    static constexpr std::size_t many = 16;
    double* column(std::vector<double>& of, std::size_t c) const {
        return of.data() + c * static_cast<std::size_t>(rows_);
    }
    Eigen::MatrixXd machine_rows(const Eigen::MatrixXd& flow, const Eigen::MatrixXd& outputs) const;
    void remember(const double* x, double* next) const;
    static std::vector<Entry> differing(const Eigen::MatrixXd& of, const Eigen::MatrixXd& theirs);
    Tangent& tangent(const Modes& modes);
    Tangent& present(const Flow& flow);
    const Propagator* propagator(Tangent& own, std::size_t phase, Flow::Waiting waiting);
    void feel(std::size_t sample, const Flow& flow);
    void divide(std::size_t sample);
    void tick(const Tangent& tangent, const Piece& piece);
    void otherwise();
    void innovate(const Moment& now);
    void through_changes(const Moment& now, std::size_t at);
    void change(const Tangent& before, const Piece& piece, std::size_t sample);
    void slave(const Tangent& tangent);
    void slave(const Tangent& tangent, std::size_t at);
    bool rode() const;
    int expand(const Tangent& tangent, double length, std::size_t at, double end);
    void flush();

    const SampledRecord& record_;
    const KalmanGains& gains_;
    const std::vector<Neighbour>& neighbours_;
    const std::vector<Reading>& own_;
    const std::size_t channels_;
    std::unique_ptr<Flow> flow_;   // of the machine, apart from the replay's, whose state it would disturb
    std::vector<Column> columns_;  // those with a law that is not affine last
    std::size_t laws_ = 0;         // how many these are
    int n_ = 0;                    // of y
    // of a column: states and torques of unknown course; all that the filter has; and with outputs, padded
    int states_ = 0, disturbances_ = 0, size_ = 0, rows_ = 0;
    int shown_ = 0;                // rows of the machine's own: states and outputs, padded
    std::vector<Entry> memories_;  // what torques of unknown course and sensors keep of themselves
    std::map<Modes, Tangent> tangents_;
    Tangent* now_ = nullptr;            // of these modes
    const Tangent* arrived_ = nullptr;  // at the present sample, before it is corrected
    Modes modes_;
    bool waiting_before_ = false;  // ticks that belong at the sample that is left
    std::array<Moment, many> waiting_;
    std::size_t count_ = 0, seen_ = 0;  // of them; since the beginning
    const SensitivityOptions how_;
    std::vector<long> apart_;  // per column, changes of modes of which its own comes more than a sample before or after
    long changes_ = 0;
    double spent_ = 0.0;             // terms of series
    bool lost_ = false;              // a way to a switch would have asked for too many of them
    std::vector<double> y_;          // per moment, as the replay left it
    std::vector<double> differing_;  // per column and moment: w, and C w with what sensors say otherwise
    std::vector<double> brought_;    // per column: [F; C F] x
    // per law, what it adds to rates: now, a sample before; per moment, amid, and by how much more at the end
    std::vector<double> felt_, before_, rates_, more_;
    std::vector<double> way_, term_, last_;     // per column, of y, padded: along pieces, the terms of a series
    std::vector<double> x_, next_, e_, moved_;  // per column
    std::vector<std::vector<double>> found_;
};

}  // namespace dualdrive::innovations
