// Householder triangulation of rows with pivoting.  It is the transpose of a QR
// factorisation with column pivoting: F[order] = L Q^T, where L is lower triangular and
// Q is a product of reflectors.
//
// Source: Golub, Van Loan, Matrix Computations, 4th ed., sections 5.2-5.4 (Householder
// QR with column pivoting, complete orthogonal factorisation).
#pragma once

#include "real.h"

namespace LANE_SPACE {

// a pivot within this factor of the threshold makes the rank ambiguous
constexpr double CLEAR = 10.0;

// Result of a triangulation.  F contains the reflectors on and above the diagonal, and
// L below it.
struct Triangle {
    Table F;
    Row turns, diagonal;  // factors of the reflectors; diagonal of L
    Array<Whole> order;  // indices of the original rows in their new order
    Triangle(int rows, int columns)
        : F(rows, columns), turns(rows), diagonal(rows), order(rows) {}
};

// Reflect R rows: row -= turn (reflector.row) reflector, over the columns from .. to - 1.
// If `sized`, also compute the sum of squares of each row beyond column `from`.
template <int R, bool sized>
inline void reflect(
    const Real *reflector, Real turn, Real *const *rows, int from, int to, Real *sizes) {
    Real along[R], size[R] = {};
    inner_tile<R>(rows, reflector, from, to, along);
    for (int i = 0; i < R; ++i) {
        along[i] *= turn;
        rows[i][from] -= along[i] * reflector[from];
    }
    for (int a = from + 1; a < to; ++a) {
        const Real weight = once(reflector[a]);
        for (int i = 0; i < R; ++i) {
            const Real left = rows[i][a] - along[i] * weight;
            rows[i][a] = left;
            if (sized) size[i] += left * left;
        }
    }
    if (sized) std::copy(size, size + R, sizes);
}

template <bool sized>
inline void reflect_all(
    const Real *reflector, Real turn, Real *const *rows, int count, int from, int to,
    Real *sizes) {
    int i = 0;
    for (; i + 4 <= count; i += 4)
        reflect<4, sized>(reflector, turn, rows + i, from, to, sizes + i);
    for (; i + 2 <= count; i += 2)
        reflect<2, sized>(reflector, turn, rows + i, from, to, sizes + i);
    if (i < count) reflect<1, sized>(reflector, turn, rows + i, from, to, sizes + i);
}

// Exchange row `step` and row `at`, which can differ between lanes.
inline void exchange(Real **rows, int step, Whole at, int width) {
    bool same = true;
    for (int l = 1; l < LANES; ++l) same = same && at[l] == at[0];
    if (same) return std::swap(rows[step], rows[at[0]]);
    for (int l = 0; l < LANES; ++l)
        if (at[l] != step)
            for (int a = 0; a < width; ++a) {
                const double kept = rows[step][a][l];
                rows[step][a][l] = rows[at[l]][a][l];
                rows[at[l]][a][l] = kept;
            }
}

// Triangulate p rows of m columns; the largest remaining row is the next pivot.
//
//   relative  threshold of a pivot, as a share of the first pivot,
//   floor     absolute threshold of a pivot,
//   clean     largest size of rows that count as zero, as a share of the first pivot; a
//             larger one makes the rank ambiguous; no limit if negative,
//   width     number of columns that are exchanged with a row; columns beyond m are not
//             triangulated.
//
// Return the rank in each lane; -1 where it is numerically ambiguous.
inline Whole triangulate(
    Triangle &T, int p, int m, Real relative, Real floor, double clean, int width) {
    Real **F = T.F.rows();
    Array<Real> sizes(p);
    for (int i = 0; i < p; ++i) {
        T.order[i] = whole(i);
        sizes[i] = inner(F[i], F[i], m);
    }
    Whole rank = whole(p), going = whole(-1);
    Real first = {};
    for (int step = 0; step < p; ++step) {
        Real best = real(-1.0);
        Whole at = whole(step);
        for (int i = step; i < p; ++i) {
            const Whole more = sizes[i] > best;
            best = more ? sizes[i] : best;
            at = more ? whole(i) : at;
        }
        best = root(best);
        if (step == 0) first = best;
        const Real limit = larger(floor, relative * first);
        const Whole clear = best > limit * CLEAR, ends = going & ~clear;
        if (any(ends)) {
            Whole doubt = (best > limit / CLEAR) | (best != best);
            if (clean >= 0.0) doubt |= best > clean * first;
            rank = ends ? (doubt ? whole(-1) : whole(step)) : rank;
            going &= clear;
            if (!any(going)) break;
        }
        at = going ? at : whole(step);  // finished lanes do not change
        exchange(F, step, at, width);
        for (int l = 0; l < LANES; ++l) {
            sizes[at[l]][l] = sizes[step][l];
            // std::swap cannot take references to lanes
            const int64_t kept = T.order[step][l];
            T.order[step][l] = T.order[at[l]][l];
            T.order[at[l]][l] = kept;
        }
        Real *reflector = F[step];
        const Real diagonal = reflector[step] > 0.0 ? -best : best;
        reflector[step] -= going ? diagonal : Real{};
        const Real turn = going ? -1.0 / (diagonal * reflector[step]) : Real{};
        T.diagonal[step] = going ? diagonal : real(1.0);
        T.turns[step] = turn;
        reflect_all<true>(
            reflector, turn, F + step + 1, p - step - 1, step, m, &sizes[step] + 1);
    }
    return rank;
}

// Replace every row x by Q x.
inline void turn_all(Triangle &T, int rank, int m, Real *const *x, int count) {
    for (int step = rank - 1; step >= 0; --step)
        reflect_all<false>(T.F[step], T.turns[step], x, count, step, m, nullptr);
}

// Replace x by Q^T x.
inline void turn_back(Triangle &T, int rank, int m, Real *x) {
    for (int step = 0; step < rank; ++step)
        reflect<1, false>(T.F[step], T.turns[step], &x, step, m, nullptr);
}

}  // namespace LANE_SPACE
