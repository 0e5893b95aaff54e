// Newton's method on the dual of small cone programmes, alone and after the interior point;
// symbols as in cones.h.  The dual,
//
//     maximise  y.h - |y|^2 / 2 - sum_k |G_k^T y - d_k|,
//
// is smooth wherever every cone constraint is active: a few steps suffice.  Where one is
// inactive it has a kink, -|z|, which is replaced by
//
//     min over |u| <= 1 of  u.z + |u - u_old|^2 / (2 sigma),
//
// the kink smoothed about u_old.  The u of each solution is the next u_old, and sigma
// grows; this converges to the maximum of the dual for any sigma.  With u the gap is known
// exactly at every step: |G u + h - y|^2 / 2 + sum_k (|z_k| + z_k.u_k).  Rows H u = e
// that no spring enters are further rows of G, h = -e, with no |y|^2 / 2.
//
// Sources: Rockafellar (1976), Augmented Lagrangians and applications of the proximal
// point algorithm in convex programming; Li, Sun, Toh (2018), A highly efficient
// semismooth Newton augmented Lagrangian method for solving lasso problems.
#pragma once

#include "cones.h"

namespace LANE_SPACE {

// z1 = M^T y - d.
inline void Solver::forces(const Programme &q, int rows, const Real *y) {
    for (int j = 0; j < k.nu; ++j) z1[j] = -q.d[j];
    combine(q.M.rows(), rows, y, k.nu, z1.data());
}

// Value and derivatives at y, whose forces are known, of the dual smoothed about `old`:
// the clearances u, the gradient `right`, and D of minus the curvature M D M^T + 1.
inline Solver::Slopes Solver::slopes(const Programme &q, Real sigma, const Real *y) {
    const Real over_twice = 0.5 / sigma;
    Slopes at = {{}, {}, {}, {}, whole(-1)};
    k.each([&](auto size, int c, int first) {
        Real *own = &u[first], *z = &z1[first], *kept = &old[first];
        Real *D = heads[c].D, along = {}, moved = {}, force;
        for (int i = 0; i < size; ++i) own[i] = kept[i] - sigma * z[i];
        if (size.ball) {
            const Real length = root(inner(own, own, size));
            const Whole inside = length <= 1.0;
            const Real shorter = 1.0 / (inside ? real(1.0) : length);
            for (int i = 0; i < size; ++i) wide[0][first + i] = own[i] *= shorter;
            D[0] = sigma * shorter, D[1] = inside ? Real{} : D[0];
            force = root(inner(z, z, size));
        } else if (size == 1) {
            const Whole inside = magnitude(own[0]) <= 1.0;
            own[0] = inside ? own[0] : own[0] > 0.0 ? real(1.0) : real(-1.0);
            D[0] = inside ? sigma : Real{};
            force = magnitude(z[0]);
        } else {
            const Real length = root(own[0] * own[0] + own[1] * own[1]);
            const Whole inside = length <= 1.0;
            const Real shorter = 1.0 / (inside ? real(1.0) : length);
            own[0] *= shorter, own[1] *= shorter;
            // on the disc's edge only rotation is free
            const Real across = sigma * shorter;
            D[0] = inside ? sigma : across * own[1] * own[1];
            D[1] = inside ? Real{} : -across * own[0] * own[1];
            D[2] = inside ? sigma : across * own[0] * own[0];
            force = root(z[0] * z[0] + z[1] * z[1]);
        }
        for (int i = 0; i < size; ++i) {
            along += z[i] * own[i];
            moved += (own[i] - kept[i]) * (own[i] - kept[i]);
        }
        at.smooth += along + moved * over_twice;
        at.kink += larger(force + along, Real{});
    });
    multiply(q.M.rows(), q.r + q.p, u.data(), k.nu, right.data());
    for (int i = q.r; i < q.r + q.p; ++i) {
        right[i] -= q.e[i - q.r];
        at.smooth -= y[i] * q.e[i - q.r];
        at.kink -= y[i] * right[i];
        at.residual += 0.5 * right[i] * right[i];
        at.closed &= magnitude(right[i]) <= ON_ROWS;
    }
    for (int i = 0; i < q.r; ++i) {
        at.smooth += y[i] * (q.h[i] - 0.5 * y[i]);
        const Real strain = right[i] + q.h[i];
        right[i] = strain - y[i];
        at.residual += 0.5 * right[i] * right[i];
        at.primal += 0.5 * strain * strain;
    }
    return at;
}

// Maximises the dual in the lanes asked for; q.u and H's part of q.y are the first guess,
// and q.u and q.y are overwritten there with the solution.
//
// steps        most Newton steps;
// first_sigma  times the mean |(G^T h)_k|: the larger, the better the guess must be;
//              0 leaves the dual as it is, with its kinks, and stops at the first one;
// relative, absolute  gap asked for.
//
// Returns the lanes that converged.
inline Whole Solver::dual_newton(
    Programme &q, int steps, double first_sigma, double relative, Real absolute,
    Whole asked) {
    const int r = q.r, m = r + q.p;
    old = q.u;
    for (int i = 0; i < m; ++i) y[i] = i < r ? q.h[i] : q.y[i];
    multiply(q.M.rows(), r, old.data(), k.nu, right.data());
    for (int i = 0; i < r; ++i) y[i] += right[i];
    Real sigma = real(1e30);
    if (first_sigma > 0.0) {
        forces(q, r, q.h.data());
        Real mean = {};
        for (int j = 0; j < k.nu; ++j) mean += magnitude(z1[j]);
        sigma = first_sigma / larger(mean / double(k.nu), real(1e-12));
    }
    Real before = real(-INFINITY);
    Whole going = asked, done = {}, halvings = {}, taken = {};
    Row step(m);
    while (true) {
        forces(q, m, y.data());
        Slopes at = slopes(q, sigma, y.data());
        const Whole close =
            at.closed & (at.residual + at.kink <= relative * at.primal + absolute);
        done |= going & close;
        going &= ~close;
        const Whole climbs = at.smooth >= before - 1e-14;
        halvings = climbs ? Whole{} : halvings + 1;
        going &= climbs | (halvings <= (first_sigma > 0.0 ? HALVINGS : 0));
        going &= ~climbs | (taken < steps);
        if (!any(going)) break;
        // halve the step if the value did not increase, else continue
        const Whole shorter = going & ~climbs, on = going & climbs;
        for (int i = 0; i < m; ++i) {
            step[i] = shorter ? 0.3 * step[i] : step[i];
            y[i] = shorter ? start[i] + step[i] : y[i];
        }
        if (!any(on)) continue;
        before = on ? at.smooth : before;
        taken -= on;
        const Whole moves = on & (at.residual <= INNER_SHARE * (at.residual + at.kink));
        if (any(moves)) {
            for (int j = 0; j < k.nu; ++j) old[j] = moves ? u[j] : old[j];
            sigma = moves ? sigma * SIGMA_GROWTH : sigma;
            before = moves ? real(-INFINITY) : before;
            slopes(q, sigma, y.data());
        }
        fill_system(q);
        going &= ~on | system.factor(m, false);
        system.solve(m, right.data());
        const Whole ahead = on & going;
        for (int i = 0; i < m; ++i) {
            start[i] = ahead ? y[i] : start[i];
            step[i] = ahead ? right[i] : step[i];
            y[i] = ahead ? y[i] + step[i] : y[i];
        }
    }
    for (int j = 0; j < k.nu; ++j) q.u[j] = asked ? u[j] : q.u[j];
    for (int i = 0; i < m; ++i) q.y[i] = asked ? y[i] : q.y[i];
    return done;
}

// Minimises in the requested lanes, to a gap of absolute + relative |G u + h|^2 / 2;
// Newton's method follows the interior-point method at a gap of `near` and NEAR of that
// energy.
inline void Solver::interior_then_newton(
    Programme &q, double relative, Real absolute, Real near, Whole asked) {
    // near a zone's edge the interior-point method stops early; Newton's method then
    // takes longer
    for (int attempt = 0; attempt < 2 && any(asked); ++attempt) {
        if (attempt == 0)
            interior_point(q, near, NEAR, asked);
        else
            interior_point(q, absolute, relative, asked);
        k.each([&](auto size, int, int at) {  // rounding may have left the cones
            const Real length = root(inner(&q.u[at], &q.u[at], size));
            const Real shorter = asked ? larger(length, real(1.0)) : real(1.0);
            for (int i = at; i < at + size; ++i) q.u[i] /= shorter;
        });
        const int steps = attempt == 0 ? STEPS : STEPS_LAST;
        asked &= ~dual_newton(q, steps, FIRST_SIGMA, relative, absolute, asked);
    }
}

}  // namespace LANE_SPACE
