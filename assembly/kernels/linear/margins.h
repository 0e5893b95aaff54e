// Problem (21) at several postures side by side, from the frames' poses to the certified
// margin: compiled_zone.py in lanes.
#pragma once

#include "rows.h"

namespace LANE_SPACE {

// assembly/linear/thresholds.py
constexpr double INFEASIBLE = 1e-13, MARGIN_GAP = 1e-8;
// assembly/linear/compiled_zone.py
enum { SOLVED, FALLBACK };
constexpr double MARGIN_STOP = 1e-9;

// Solves blocks of points of one robot, one after the other.
class ZoneMargins : public Rows {
public:
    ZoneMargins(const Robot &s, const Points &points)
        : Rows(s, points), solver(cones, m) {}

    Whole margins(const Points &points, const Block &block, Whole asked, Margins &out);

private:
    Solver solver;

    void first_along(int count, Real *w, Real size);
    void farthest(int count, Whole asked, Real &reach, Real &most);
};

// Margins of the lanes asked for that have the ranks of the first of them; returns the
// others.  With every link and joint rigid, B u = w must hold: the least factor t on the
// clearances is |w| over the most that g.u can be with |u_k| <= 1 and the rest of B u
// zero, g = B^T w / |w|.  The multipliers n of these rows bound it from below,
//
//     t >= |w| / sum_k |(g - B_rest^T n)_k|.
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
        first_along(left, w.data(), size);
        farthest(left, asked & possible, reach, most);
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

// B's rows, the triangle's own, turned so that the first is along w, the others across.
inline void ZoneMargins::first_along(int count, Real *w, Real size) {
    Real *const *B = programme.M.rows();
    orthonormal_rows(count);
    for (int i = 0; i < count; ++i) w[i] /= size;
    const Real sign = w[0] <= 0.0 ? real(1.0) : real(-1.0);
    w[0] -= sign;
    const Real factor = -2.0 / inner(w, w, count);
    Row dots(nu), weights(count);
    combine(B, count, w, nu, dots.data());
    for (int i = 0; i < count; ++i)
        for (int c = 0; c < nu; ++c) B[i][c] += factor * w[i] * dots[c];
    for (int c = 0; c < nu; ++c) B[0][c] *= sign;
}

// u within the cones with the most B[0].u, its reach, and no B[1:] u; the most that it
// can be, by the multipliers.
inline void ZoneMargins::farthest(int count, Whole asked, Real &reach, Real &most) {
    Programme &q = programme;
    Real **B = q.M.rows();
    std::rotate(B, B + 1, B + count);  // the rows H u = 0 first
    q.r = 0, q.p = count - 1, q.loaded = true;
    const Real *along = B[q.p];
    std::copy(along, along + nu, q.d.begin());
    solver.interior_point(q, real(MARGIN_STOP), 0.0, asked);
    Row gradient = q.d, against(q.p);
    for (int i = 0; i < q.p; ++i) against[i] = -q.y[i];
    combine(B, q.p, against.data(), nu, gradient.data());
    // the residual of the rest by rounding is removed, then u scaled into the cones
    for (int i = 0; i < q.p; ++i) {
        const Real residual = inner(B[i], q.u.data(), nu);
        for (int c = 0; c < nu; ++c) q.u[c] -= residual * B[i][c];
    }
    Real worst = real(1.0);
    most = Real{};
    cones.each([&](auto of, int, int at) {
        worst = larger(inner(&q.u[at], &q.u[at], of), worst);
        most += root(inner(&gradient[at], &gradient[at], of));
    });
    worst = root(worst);
    for (int c = 0; c < nu; ++c) q.u[c] /= worst;
    reach = inner(along, q.u.data(), nu);
}

}  // namespace LANE_SPACE
