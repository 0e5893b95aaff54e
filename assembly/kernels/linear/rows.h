// Closure conditions that only the clearances can satisfy, for robots without springs,
// at several postures in parallel: rows of the closures that are orthogonal to all free
// motions.
//
// ========  =============  ============================================================
// B, w      (p, nu), (p,)  B u = w must hold; the rows of B are orthonormal
// ========  =============  ============================================================
#pragma once

#include "reduction.h"

namespace LANE_SPACE {

constexpr double ROWS_RANK = 1e-9;  // threshold of ranks: assembly/kinematics/ranks.py

// The linear model of a robot without springs, and the rows for its clearances.
class Rows : public Reduction {
public:
    Rows(const Robot &s, const Points &points)
        : Reduction(s, points), rows(m, nu + 1) {}

protected:
    Triangle rows;  // the rows, and in the last column their right sides

    struct Ranks { int free; Whole same, unclear; };
    Ranks eliminate_free(Real tolerance, Whole requested);
    Whole triangulate_rows(int count, const Array<Whole> *held);
    void orthonormal_rows(int count);
};

// Eliminate the free motions in the requested lanes that have the same rank as the
// first of them.  G and h of the small programme are then the rows and their right
// sides.
inline Rows::Ranks Rows::eliminate_free(Real tolerance, Whole requested) {
    const Whole found = triangulate_free(tolerance);
    Ranks ranks = {0, requested & (found >= 0), requested & (found < 0)};
    if (!any(ranks.same)) return ranks;
    ranks.free = rank_of_first(found, ranks.same);
    ranks.same &= found == ranks.free;
    orthogonal_rows(ranks.free, m - ranks.free);
    clearance_parts(m - ranks.free);
    small_problem(m - ranks.free);
    return ranks;
}

// Triangulate the rows without the columns in `held`.  Return the rank in each lane,
// -1 where it is ambiguous.
inline Whole Rows::triangulate_rows(int count, const Array<Whole> *held) {
    for (int i = 0; i < count; ++i) {
        std::copy(programme.M[i], programme.M[i] + nu, rows.F[i]);
        rows.F[i][nu] = -programme.h[i];
        for (int c = 0; held && c < nu; ++c)
            rows.F[i][c] = (*held)[c] ? Real{} : rows.F[i][c];
    }
    return triangulate(
        rows, count, nu, real(ROWS_RANK), NOISE * largest_clearance(), -1.0, nu + 1);
}

// Compute B in the first rows of the programme's M.
inline void Rows::orthonormal_rows(int count) {
    Real *const *B = programme.M.rows();
    for (int i = 0; i < count; ++i) {
        std::fill(B[i], B[i] + nu, Real{});
        B[i][i] = real(1.0);
    }
    turn_all(rows, count, nu, B, count);
}

}  // namespace LANE_SPACE
