// A delay by its Padé approximant [q − 1/q], as states.
#pragma once

namespace dualdrive {

// The states are the coefficients of the signal's past over the delay τ in Legendre polynomials P_i (Voelker, Kajić, Eliasmith,
// Advances in Neural Information Processing Systems 32, 2019, eq. 1 and 2):
//
//     τ m_i' = (2i + 1) (Σ_j a_ij m_j + (−1)^i u),  a_ij = −1 for i < j, else (−1)^{i−j+1};  u(t − τ) ≈ Σ_i m_i
//
// Its poles lie well apart, at a few q/τ, where a companion form of that order would lose all digits.
struct DelayApproximant {
    // At ωτ = 5, the corner of a current loop of 2500 1/s under a delay of 2 ms, it is wrong by 1e-6.
    static constexpr int order = 8;

    template <class S>
    static S output(const S* m) {
        S sum = m[0];
        for (int i = 1; i < order; ++i) sum += m[i];
        return sum;
    }

    template <class S>
    static void flow(const S& signal, const S& delay, const S* m, S* rate) {
        for (int i = 0; i < order; ++i) {
            S sum = i % 2 ? S(-signal) : signal;
            for (int j = 0; j < order; ++j) {
                if (i < j || (i - j) % 2 == 0)
                    sum -= m[j];
                else
                    sum += m[j];
            }
            rate[i] = double(2 * i + 1) * sum / delay;
        }
    }
};

}  // namespace dualdrive
