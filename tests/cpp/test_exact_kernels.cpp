// The inner loops of the exact engine as they are built for each processor, against each other and long double.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#if defined(__x86_64__)
#define DUALDRIVE_KERNELS_X86 1  // as the library is built there
#endif
#include "../../cpp/src/solvers/exact/kernels.hpp"
#include "exact_draws.hpp"

using namespace dualdrive;
using namespace dualdrive::exact;

TEST_CASE("every build of the kernels computes the same but for rounding") {
    std::vector<const Kernels*> built{&build::baseline};
#if DUALDRIVE_KERNELS_X86
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) built.push_back(&build::avx2);
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl")) built.push_back(&build::avx512);
#endif
    Draw draw(5);
    const auto fill = [&](std::size_t count) {
        std::vector<double> v(count);
        for (double& x : v) x = draw.normal();
        return v;
    };
    for (int n = 1; n <= 70; n += draw.whole(1, 3)) {
        const int rows = padded(n), tall = padded(draw.whole(1, 120)), count = 5, order = 7;
        const auto size = [](int a, int b) { return static_cast<std::size_t>(a) * static_cast<std::size_t>(b); };
        const std::vector<double> M = fill(size(rows, n)), T = fill(size(tall, n)), x = fill(size(rows, count));
        std::vector<Fine> product(size(tall, count), Fine(0)), bound(product);
        for (int k = 0; k < count; ++k)
            for (int j = 0; j < n; ++j)
                for (int i = 0; i < tall; ++i) {
                    const Fine term = Fine(T[size(j, tall) + static_cast<std::size_t>(i)]) *
                                      Fine(x[size(k, rows) + static_cast<std::size_t>(j)]);
                    product[size(k, tall) + static_cast<std::size_t>(i)] += term;
                    bound[size(k, tall) + static_cast<std::size_t>(i)] += std::abs(term);
                }
        std::vector<double> chained, summed;
        for (const Kernels* kernels : built) {
            CAPTURE(std::string(kernels->name));
            CAPTURE(n);
            std::vector<double> out(size(tall, count));
            kernels->multiply(tall, n, T.data(), rows, x.data(), count, out.data());
            for (std::size_t i = 0; i < out.size(); ++i)
                CHECK(std::abs(Fine(out[i]) - product[i]) <= Fine(n * epsilon) * bound[i]);
            std::vector<double> y(x.begin(), x.begin() + rows), chain(size(rows, count + 1), 0.0);
            y.resize(static_cast<std::size_t>(rows));
            for (int i = n; i < rows; ++i) y[static_cast<std::size_t>(i)] = 0.0;
            std::copy(y.begin(), y.end(), chain.begin());
            kernels->chain(rows, n, M.data(), count, chain.data());
            std::vector<double> scratch(size(2, rows));
            kernels->taylor(rows, n, M.data(), 0.3 / n, order, y.data(), scratch.data());
            if (kernels == built.front()) chained = chain, summed = y;
            double largest = 0.0;
            for (std::size_t i = 0; i < chain.size(); ++i) {
                if (i % static_cast<std::size_t>(rows) == 0) largest = 0.0;
                largest = std::max(largest, std::abs(chained[i]));
            }
            for (int i = 0; i < rows; ++i) {
                const auto last = size(count, rows) + static_cast<std::size_t>(i), at = static_cast<std::size_t>(i);
                CHECK(std::abs(chain[last] - chained[last]) <= 200 * n * epsilon * (1 + largest));
                CHECK(std::abs(y[at] - summed[at]) <= 50 * n * epsilon * (1 + std::abs(summed[at])));
            }
        }
    }
}

TEST_CASE("products of many columns, inverses and factors, in every build") {
    std::vector<const Kernels*> built{&build::baseline};
#if DUALDRIVE_KERNELS_X86
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) built.push_back(&build::avx2);
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl")) built.push_back(&build::avx512);
#endif
    Draw draw(11);
    for (int n = 1; n <= 41; n += draw.whole(1, 3)) {
        const int rows = padded(n);
        const auto at = [&](int i, int j) { return static_cast<std::size_t>(j * rows + i); };
        const auto size = static_cast<std::size_t>(rows * n);
        std::vector<double> A(size, 0.0), B(size, 0.0);
        for (int j = 0; j < n; ++j)
            for (int i = 0; i < n; ++i) A[at(i, j)] = draw.normal(), B[at(i, j)] = draw.normal();
        const auto product = [&](const std::vector<double>& a, const std::vector<double>& b, bool transposed) {
            std::vector<Fine> out(size, Fine(0));
            for (int j = 0; j < n; ++j)
                for (int k = 0; k < n; ++k)
                    for (int i = 0; i < n; ++i)
                        out[at(i, j)] += Fine(a[at(i, k)]) * Fine(transposed ? b[at(j, k)] : b[at(k, j)]);
            return out;
        };
        // of rank n/2, so that columns of its factor vanish
        std::vector<double> half(A);
        for (int j = n / 2; j < n; ++j)
            for (int i = 0; i < n; ++i) half[at(i, j)] = 0.0;
        const std::vector<Fine> whole = product(half, half, true), expected = product(A, B, false);
        for (const Kernels* kernels : built) {
            CAPTURE(std::string(kernels->name));
            CAPTURE(n);
            std::vector<double> out(size);
            kernels->product(rows, n, A.data(), rows, B.data(), n, out.data());
            for (std::size_t i = 0; i < size; ++i)
                CHECK(std::abs(Fine(out[i]) - expected[i]) <= Fine(100 * n * epsilon));
            std::vector<double> inverse(A);
            std::vector<int> scratch(static_cast<std::size_t>(n));
            CHECK(kernels->invert(rows, n, inverse.data(), scratch.data()));
            double largest = 1.0;
            for (const double x : inverse) largest = std::max(largest, std::abs(x));
            const std::vector<Fine> one = product(A, inverse, false);
            for (int j = 0; j < n; ++j)
                for (int i = 0; i < n; ++i)
                    CHECK(std::abs(one[at(i, j)] - Fine(i == j)) <= Fine(1e3 * n * epsilon * largest));
            std::vector<double> L(size);
            for (std::size_t i = 0; i < size; ++i) L[i] = static_cast<double>(whole[i]);
            std::vector<double> diagonal(static_cast<std::size_t>(n));
            kernels->cholesky(rows, n, 1e-15, L.data(), diagonal.data());
            const std::vector<Fine> again = product(L, L, true);
            for (int j = 0; j < n; ++j)
                for (int i = 0; i < n; ++i) CHECK(std::abs(again[at(i, j)] - whole[at(i, j)]) <= Fine(1e-14 * n * n));
        }
    }
    std::vector<double> singular(16, 0.0);
    std::vector<int> scratch(4);
    for (const Kernels* kernels : built) CHECK_FALSE(kernels->invert(4, 4, singular.data(), scratch.data()));
}
