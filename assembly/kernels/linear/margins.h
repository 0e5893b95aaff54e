// Problem (21) for robots without springs at several postures in parallel, from the
// poses of the frames to the certified margin.
#pragma once

#include "../solvers/least_factor.h"
#include "rows.h"

namespace LANE_SPACE {

// residual of a row without clearances that counts as zero
constexpr double INFEASIBLE = 1e-13;
// outcome codes of assembly/linear/lanes.py
enum { COMPILED, REFERENCE };

// Solver of blocks of points of one robot, in sequence.
class ZoneMargins : public Rows {
public:
    ZoneMargins(const Robot &s, const Points &points)
        : Rows(s, points), solver(cones, m), B(m, nu) {}

    Whole margins(
        const Points &points, const Block &block, Whole requested, Margins &out);

private:
    Solver solver;
    Table B;               // orthonormal rows, before the solver rotates them
    Ranks kept;            // ranks of the last elimination of free motions
    int left;              // rank of the rows that remained
    int64_t reduced = -1;  // value of `changes` at the last elimination

    void reduce(Real tolerance, Whole requested);
};

// Compute, for the requested lanes, all quantities that do not depend on the errors.
inline void ZoneMargins::reduce(Real tolerance, Whole requested) {
    kept = eliminate_free(tolerance, requested);
    if (!any(kept.same)) return;
    const int count = m - kept.free;
    const Whole clear = triangulate_rows(count, nullptr);
    kept.unclear |= kept.same & (clear < 0);
    if (!any(kept.same &= clear >= 0)) return;
    left = rank_of_first(clear, kept.same);
    kept.same &= clear == left;
    orthonormal_rows(left);
    for (int i = 0; i < left; ++i)
        std::copy(programme.M[i], programme.M[i] + nu, B[i]);
}

// Compute the margins of the requested lanes that have the same ranks as the first of
// them.  Return the requested lanes that remain.  All links and joints are rigid, so
// that B u = w must hold (least_factor.h).
inline Whole ZoneMargins::margins(
    const Points &points, const Block &block, Whole requested, Margins &out) {
    const auto settle = [&](Whole where, Real margin, Real bound, Whole proved) {
        block.write(out.margin, 1, 0, margin, where);
        block.write(out.bound, 1, 0, bound, where);
        for (int l = 0; l < LANES; ++l)
            if (where[l]) out.outcome[block.point[l]] = proved[l] ? COMPILED : REFERENCE;
        return ~where;
    };
    const Real unknown = real(NAN);
    Whole others = requested;
    const bool unchanged = same_posture(points, block);
    read(points, block, unchanged);
    const Whole closed = requested & (inner(known.data(), known.data(), m) == 0.0);
    others &= settle(closed, Real{}, Real{}, closed);  // no clearance is needed
    if (!any(requested = others)) return others;
    if (unchanged && reduced == changes) {  // all lanes have the same posture
        const Whole unclear = any(kept.unclear) ? requested : Whole{};
        kept.unclear = unclear, kept.same = requested & ~unclear;
    } else {
        reduce(tolerance(points, block), requested);
        reduced = changes;
    }
    others &= settle(kept.unclear, unknown, unknown, Whole{});
    if (!any(requested = kept.same)) return others;
    const int count = m - kept.free;
    right_sides(count);
    Row w(count);
    Whole possible = whole(-1);
    for (int i = 0; i < count; ++i) {
        Real total;
        for (int l = 0; l < LANES; ++l)
            total[l] = -programme.h[int(rows.order[i][l])][l];
        for (int l = 0; l < std::min(i, left); ++l) total -= rows.F[i][l] * w[l];
        if (i < left)
            w[i] = total / rows.diagonal[i];
        else  // rows without clearances; the next comparison is false for NaN
            possible &= magnitude(total) <= INFEASIBLE;
    }
    const Real size = root(inner(w.data(), w.data(), left));
    possible &= size >= 0.0;
    // the other lanes need no clearance
    const Whole needed = requested & possible & (size > 0.0);
    Real reach = real(1.0), most = real(1.0);
    std::fill(programme.u.begin(), programme.u.end(), Real{});
    Row forces(nu);
    if (any(needed)) {
        for (int i = 0; i < left; ++i) std::copy(B[i], B[i] + nu, programme.M[i]);
        first_along(programme, left, w.data(), needed ? size : real(1.0));
        forces = reach_along_first(solver, programme, left, needed, reach, most);
    }
    possible &= ~needed | (reach > 0.0);
    const Real margin = needed ? size / reach : Real{};
    const Real bound = needed ? size / most : Real{};
    for (int c = 0; c < nu; ++c)
        block.write(
            out.forces, nu, cones.column[c], needed ? forces[c] / most : Real{},
            requested);
    // the motions of passive joints must stay within their ranges
    for (Real &u : programme.u) u = needed ? u * margin : Real{};
    const Row motions = least_motions(kept.free, moved_by(Row()));
    for (int c = 0; c < nq; ++c) possible &= magnitude(motions[c]) <= s.free_bound[c];
    const Whole proved = possible & (margin - bound <= MARGIN_GAP * margin);
    return others & settle(
        requested, possible ? margin : unknown, possible ? bound : unknown, proved);
}

}  // namespace LANE_SPACE
