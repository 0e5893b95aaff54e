// The least factor t on unit cones with which B u = w and |u_k| <= t, B's rows orthonormal:
// |w| over the most that g.u can be with |u_k| <= 1 and the rest of B u zero, g = B^T w /
// |w|.  The multipliers n of these rows bound it from below,
//
//     t >= |w| / sum_k |(g - B_rest^T n)_k|.
#pragma once

#include "cones.h"

namespace LANE_SPACE {

constexpr double MARGIN_GAP = 1e-8;  // assembly/kinematics/ranks.py
constexpr double MARGIN_STOP = 1e-9;

// B, the programme's first rows, turned so that the first is along w, the others across; w
// is overwritten.
inline void first_along(Programme &q, int count, Real *w, Real size) {
    Real *const *B = q.M.rows();
    const int nu = q.cones.nu;
    for (int i = 0; i < count; ++i) w[i] /= size;
    const Real sign = w[0] <= 0.0 ? real(1.0) : real(-1.0);
    w[0] -= sign;
    const Real factor = -2.0 / inner(w, w, count);
    Row dots(nu);
    combine(B, count, w, nu, dots.data());
    for (int i = 0; i < count; ++i)
        for (int c = 0; c < nu; ++c) B[i][c] += factor * w[i] * dots[c];
    for (int c = 0; c < nu; ++c) B[0][c] *= sign;
}

// u within the cones with the largest B[0].u, its reach, and B[1:] u = 0; the upper bound
// of the reach by the multipliers.  Returns g - B_rest^T n.
inline Row reach_along_first(
    Solver &solver, Programme &q, int count, Whole asked, Real &reach, Real &most) {
    const int nu = q.cones.nu;
    Real **B = q.M.rows();
    std::rotate(B, B + 1, B + count);  // the rows H u = 0 first
    q.r = 0, q.p = count - 1, q.loaded = true;
    const Real *along = B[q.p];
    std::copy(along, along + nu, q.d.begin());
    solver.interior_point(q, real(MARGIN_STOP), 0.0, asked);
    Row gradient = q.d, against(q.p);
    for (int i = 0; i < q.p; ++i) against[i] = -q.y[i];
    combine(B, q.p, against.data(), nu, gradient.data());
    // the rounding residual of the rest is removed, then u is scaled into the cones
    for (int i = 0; i < q.p; ++i) {
        const Real residual = inner(B[i], q.u.data(), nu);
        for (int c = 0; c < nu; ++c) q.u[c] -= residual * B[i][c];
    }
    Real worst = real(1.0);
    most = Real{};
    q.cones.each([&](auto of, int, int at) {
        worst = larger(inner(&q.u[at], &q.u[at], of), worst);
        most += root(inner(&gradient[at], &gradient[at], of));
    });
    worst = root(worst);
    for (int c = 0; c < nu; ++c) q.u[c] /= worst;
    reach = inner(along, q.u.data(), nu);
    return gradient;
}

}  // namespace LANE_SPACE
