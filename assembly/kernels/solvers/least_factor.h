// The least factor t of the unit cones for which B u = w and |u_k| <= t can be
// satisfied, where the rows of B are orthonormal.  With g = B^T w / |w|, it is |w|
// divided by the largest g.u subject to |u_k| <= 1 and B_rest u = 0.  B_rest are the
// rows of B after a rotation that makes the first row g.  The multipliers n of B_rest
// give a lower bound,
//
//     t >= |w| / sum_k |(g - B_rest^T n)_k|.
#pragma once

#include "cones.h"

namespace LANE_SPACE {

// largest relative gap of a proved margin: assembly/linear/zone.py
constexpr double MARGIN_GAP = 1e-8;
// gap at which the interior-point method stops; the largest g.u is of order 1
constexpr double MARGIN_STOP = 1e-9;

// Rotate the first `count` rows B of the programme so that the first row becomes
// g = B^T w / |w|; the other rows become orthogonal to w.  `size` is |w|.  w is
// overwritten.
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

// Compute the u inside the cones with the largest B[0].u and with B[1:] u = 0.
// `reach` is this largest value, `most` its upper bound from the multipliers.  Return
// g - B_rest^T n.
inline Row reach_along_first(
    Solver &solver, Programme &q, int count, Whole requested, Real &reach, Real &most) {
    const int nu = q.cones.nu;
    Real **B = q.M.rows();
    std::rotate(B, B + 1, B + count);  // the rows H u = 0 come first
    q.r = 0, q.p = count - 1, q.loaded = true;
    const Real *along = B[q.p];
    std::copy(along, along + nu, q.d.begin());
    solver.interior_point(q, real(MARGIN_STOP), 0.0, requested);
    Row gradient = q.d, against(q.p);
    for (int i = 0; i < q.p; ++i) against[i] = -q.y[i];
    combine(B, q.p, against.data(), nu, gradient.data());
    // u is made orthogonal to the other rows, where it had a rounding error, then
    // scaled into the cones
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
