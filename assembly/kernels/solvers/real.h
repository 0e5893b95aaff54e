// Arithmetic on several problems in parallel.  A lane is one position of a vector
// register; each lane contains the numbers of one problem.  A `Real` is one vector of
// LANES numbers, and a block (block.h) is a set of LANES problems that are solved
// together.
//
// The lanes compute independently: no operation sums over lanes.  Masks keep the values
// of a lane whose problem is finished.  A result therefore does not depend on the
// problems in the other lanes.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <numeric>
#include <utility>
#include <vector>

// Each module contains two versions of the code, in different namespaces.  One version
// has two lanes and is used for few problems.  The other has as many lanes as a vector
// register holds.
#if defined(FEW_LANES)
#define LANE_COUNT 2
#define LANE_SPACE lanes_2
#elif defined(__AVX512F__)
#define LANE_COUNT 8
#define LANE_SPACE lanes_8
#elif defined(__AVX__)
#define LANE_COUNT 4
#define LANE_SPACE lanes_4
#else
#define LANE_COUNT 2
#define LANE_SPACE lanes_2
#endif
namespace LANE_SPACE {

constexpr int LANES = LANE_COUNT;
template <typename T> using Array = std::vector<T>;

typedef double Real __attribute__((vector_size(8 * LANES)));
// integers, or a mask: 0 or -1
typedef int64_t Whole __attribute__((vector_size(8 * LANES)));

inline Real real(double value) { return value - Real{}; }
inline Whole whole(int64_t value) { return value - Whole{}; }

inline Real root(Real x) {
    for (int l = 0; l < LANES; ++l) x[l] = __builtin_sqrt(x[l]);
    return x;
}

// Return a number that is used several times, so that it is loaded once.  Compilers
// would otherwise load it again for every product, and the loads limit the speed of
// these loops.
inline Real once(Real x) {
#if defined(__x86_64__)
    asm("" : "+x"(x));
#endif
    return x;
}

// Unroll a loop over the partial sums of a tile, so that these remain in registers.
#define UNROLL _Pragma("GCC unroll 8")

inline Real magnitude(Real x) { return x < 0.0 ? -x : x; }
inline Real larger(Real a, Real b) { return a > b ? a : b; }

inline bool any(Whole mask) {
    int64_t bits = 0;
    for (int l = 0; l < LANES; ++l) bits |= mask[l];
    return bits != 0;
}

// A matrix whose rows can be exchanged without a copy.
class Table {
public:
    Table(int rows, int columns) : numbers(size_t(rows) * columns), at(rows) {
        for (int i = 0; i < rows; ++i) at[i] = numbers.data() + size_t(i) * columns;
    }
    Real *operator[](int row) const { return at[row]; }
    Real **rows() { return at.data(); }
    Real *const *rows() const { return at.data(); }

private:
    Array<Real> numbers;
    Array<Real *> at;
};

typedef Array<Real> Row;

// Compute inner products of R rows with x over the columns from .. to - 1.  Each row
// has 8 / R partial sums, so that additions do not wait for each other.
template <int R>
inline void inner_tile(Real *const *rows, const Real *x, int from, int to, Real *out) {
    constexpr int PARTS = 8 / R;
    Real total[R][PARTS];
    UNROLL for (int i = 0; i < R; ++i)
        UNROLL for (int b = 0; b < PARTS; ++b) total[i][b] = Real{};
    int a = from;
    for (; a + PARTS <= to; a += PARTS)
        UNROLL for (int b = 0; b < PARTS; ++b) {
            const Real factor = once(x[a + b]);
            UNROLL for (int i = 0; i < R; ++i) total[i][b] += rows[i][a + b] * factor;
        }
    for (; a < to; ++a) {
        const Real factor = once(x[a]);
        UNROLL for (int i = 0; i < R; ++i) total[i][0] += rows[i][a] * factor;
    }
    UNROLL for (int i = 0; i < R; ++i) {
        UNROLL for (int half = PARTS / 2; half > 0; half /= 2)
            UNROLL for (int b = 0; b < half; ++b) total[i][b] += total[i][b + half];
        out[i] = total[i][0];
    }
}

inline Real inner(const Real *a, const Real *b, int n) {
    Real total, *row = const_cast<Real *>(a);
    inner_tile<1>(&row, b, 0, n, &total);
    return total;
}

// Compute out = A x.
inline void multiply(Real *const *A, int count, const Real *x, int columns, Real *out) {
    int i = 0;
    for (; i + 4 <= count; i += 4) inner_tile<4>(A + i, x, 0, columns, out + i);
    for (; i + 2 <= count; i += 2) inner_tile<2>(A + i, x, 0, columns, out + i);
    if (i < count) inner_tile<1>(A + i, x, 0, columns, out + i);
}

template <int C>
inline void combine_tile(Real *const *A, int count, const Real *y, int column, Real *out) {
    Real total[C];
    UNROLL for (int j = 0; j < C; ++j) total[j] = out[column + j];
    for (int i = 0; i < count; ++i) {
        const Real weight = once(y[i]), *row = A[i] + column;
        UNROLL for (int j = 0; j < C; ++j) total[j] += weight * row[j];
    }
    UNROLL for (int j = 0; j < C; ++j) out[column + j] = total[j];
}

// Add A^T y to out.
inline void combine(Real *const *A, int count, const Real *y, int columns, Real *out) {
    int j = 0;
    for (; j + 8 <= columns; j += 8) combine_tile<8>(A, count, y, j, out);
    for (; j + 2 <= columns; j += 2) combine_tile<2>(A, count, y, j, out);
    if (j < columns) combine_tile<1>(A, count, y, j, out);
}

template <int R, int C>
inline void product_tile(
    Real *const *B, Real *const *M, int column, int width, Real *const *out) {
    Real total[R][C];
    UNROLL for (int i = 0; i < R; ++i)
        UNROLL for (int j = 0; j < C; ++j) total[i][j] = Real{};
    for (int a = 0; a < width; ++a) {
        Real first[R];
        UNROLL for (int i = 0; i < R; ++i) first[i] = once(B[i][a]);
        UNROLL for (int j = 0; j < C; ++j) {
            const Real other = once(M[column + j][a]);
            UNROLL for (int i = 0; i < R; ++i) total[i][j] += first[i] * other;
        }
    }
    UNROLL for (int i = 0; i < R; ++i)
        UNROLL for (int j = 0; j < C; ++j) out[i][column + j] = total[i][j];
}

// Compute R rows of B M^T for the first `rows` rows of M.
template <int R>
inline void products(
    Real *const *B, Real *const *M, int rows, int width, Real *const *out) {
    int l = 0;
    for (; l + 4 <= rows; l += 4) product_tile<R, 4>(B, M, l, width, out);
    for (; l + 2 <= rows; l += 2) product_tile<R, 2>(B, M, l, width, out);
    if (l < rows) product_tile<R, 1>(B, M, l, width, out);
}

}  // namespace LANE_SPACE
