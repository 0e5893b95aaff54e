// Problem (21) at several postures side by side, from the frames' poses to the certified
// margin.
#pragma once

#include "../solvers/least_factor.h"
#include "rows.h"

namespace LANE_SPACE {

// assembly/linear/thresholds.py
constexpr double INFEASIBLE = 1e-13;
// assembly/linear/solutions.py
enum { SOLVED, FALLBACK };

// Solves blocks of points of one robot, one after the other.
class ZoneMargins : public Rows {
public:
    ZoneMargins(const Robot &s, const Points &points)
        : Rows(s, points), solver(cones, m) {}

    Whole margins(const Points &points, const Block &block, Whole asked, Margins &out);

private:
    Solver solver;
};

// Margins of the lanes asked for that have the ranks of the first of them; returns the
// others.  With every link and joint rigid, B u = w must hold (least_factor.h).
inline Whole ZoneMargins::margins(
    const Points &points, const Block &block, Whole asked, Margins &out) {
    const auto settle = [&](Whole where, Real margin, Real bound, Whole proved) {
        block.write(out.margin, 1, 0, margin, where);
        block.write(out.bound, 1, 0, bound, where);
        for (int l = 0; l < LANES; ++l)
            if (where[l]) out.outcome[block.point[l]] = proved[l] ? SOLVED : FALLBACK;
        return ~where;
    };
    const Real unknown = real(NAN);
    Whole others = asked;
    read(points, block);
    const Whole closed = asked & (inner(known.data(), known.data(), m) == 0.0);
    others &= settle(closed, Real{}, Real{}, closed);  // no clearance is needed
    if (!any(asked = others)) return others;
    const Real tolerance = RANK + MISMATCH_FACTOR * block.read(points.mismatch, 1, 0);
    const Ranks ranks = eliminate_free(tolerance, asked);
    others &= settle(ranks.unclear, unknown, unknown, Whole{});
    if (!any(asked = ranks.same)) return others;
    const int count = m - ranks.free;
    const Whole clear = triangulate_rows(count, nullptr);
    others &= settle(asked & (clear < 0), unknown, unknown, Whole{});
    if (!any(asked &= clear >= 0)) return others;
    const int left = rank_of_first(clear, asked);
    asked &= clear == left;
    Row w(count);
    Whole possible = whole(-1);
    for (int i = 0; i < count; ++i) {
        Real total = rows.F[i][nu];
        for (int l = 0; l < std::min(i, left); ++l) total -= rows.F[i][l] * w[l];
        if (i < left)
            w[i] = total / rows.diagonal[i];
        else  // what no clearance enters; written so that NaN is not possible
            possible &= magnitude(total) <= INFEASIBLE;
    }
    const Real size = root(inner(w.data(), w.data(), left));
    possible &= size > 0.0;
    Real reach = {}, most = real(1.0);
    if (any(asked & possible)) {
        orthonormal_rows(left);
        first_along(programme, left, w.data(), size);
        reach_along_first(solver, programme, left, asked & possible, reach, most);
    }
    possible &= reach > 0.0;
    const Real margin = size / reach, bound = size / most;
    // motions of passive joints must stay within their ranges
    for (Real &own : programme.u) own *= margin;
    const Row motions = least_motions(ranks.free, moved_by(Row()));
    for (int c = 0; c < nq; ++c) possible &= magnitude(motions[c]) <= s.free_bound[c];
    const Whole proved = possible & (margin - bound <= MARGIN_GAP * margin);
    return others & settle(
        asked, possible ? margin : unknown, possible ? bound : unknown, proved);
}

}  // namespace LANE_SPACE
