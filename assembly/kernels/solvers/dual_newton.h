// Newton's method on the dual of small cone programmes, used alone and after the
// interior-point method.  cones.h defines the symbols.  The dual
//
//     maximise  y.h - |y|^2 / 2 - sum_k |G_k^T y - d_k|
//
// is smooth wherever every cone constraint is active; Newton's method then needs few
// steps.  Where a constraint is inactive, the dual has a kink, -|z|, with
// z = G_k^T y - d_k.  The kink is replaced by
//
//     min over |u| <= 1 of  u.z + |u - u_old|^2 / (2 sigma),
//
// which is smooth.  The minimiser u becomes the next u_old, and sigma grows.  This
// method converges to the maximum of the dual for any first sigma.  The gap is known
// exactly at every step: |G u + h - y|^2 / 2 + sum_k (|z_k| + z_k.u_k).  Rows of
// H u = e are treated as further rows of G, with h = -e and without |y|^2 / 2.
//
// Sources: Rockafellar (1976), Augmented Lagrangians and applications of the proximal
// point algorithm in convex programming; Li, Sun, Toh (2018), A highly efficient
// semismooth Newton augmented Lagrangian method for solving lasso problems.
#pragma once

#include "cones.h"

namespace LANE_SPACE {

// Compute z1 = M^T y - d from the first `rows` rows of M.
inline void Solver::forces(const Programme &q, int rows, const Real *y) {
    for (int j = 0; j < k.nu; ++j) z1[j] = -q.d[j];
    combine(q.M.rows(), rows, y, k.nu, z1.data());
}

// Compute the value and the derivatives at y of the dual smoothed about `old`.  z1
// must have been computed.  Overwrite the clearances u, the gradient `right`, and D,
// which determines the negative second derivative: S = M D M^T + diag(1 .. 1, 0 .. 0).
inline Solver::Slopes Solver::slopes(const Programme &q, Real sigma, const Real *y) {
    const Real over_twice = 0.5 / sigma;
    Slopes at = {{}, {}, {}, {}, whole(-1)};
    k.each([&](auto size, int c, int first) {
        Real *u_k = &u[first], *z = &z1[first], *kept = &old[first];
        Real *D = heads[c].D, along = {}, moved = {}, force;
        for (int i = 0; i < size; ++i) u_k[i] = kept[i] - sigma * z[i];
        if (size.ball) {
            const Real length = root(inner(u_k, u_k, size));
            const Whole inside = length <= 1.0;
            const Real shorter = 1.0 / (inside ? real(1.0) : length);
            for (int i = 0; i < size; ++i) wide[0][first + i] = u_k[i] *= shorter;
            D[0] = sigma * shorter, D[1] = inside ? Real{} : D[0];
            force = root(inner(z, z, size));
        } else if (size == 1) {
            const Whole inside = magnitude(u_k[0]) <= 1.0;
            u_k[0] = inside ? u_k[0] : u_k[0] > 0.0 ? real(1.0) : real(-1.0);
            D[0] = inside ? sigma : Real{};
            force = magnitude(z[0]);
        } else {
            const Real length = root(u_k[0] * u_k[0] + u_k[1] * u_k[1]);
            const Whole inside = length <= 1.0;
            const Real shorter = 1.0 / (inside ? real(1.0) : length);
            u_k[0] *= shorter, u_k[1] *= shorter;
            // a point on the disc's boundary can only move along the boundary
            const Real across = sigma * shorter;
            D[0] = inside ? sigma : across * u_k[1] * u_k[1];
            D[1] = inside ? Real{} : -across * u_k[0] * u_k[1];
            D[2] = inside ? sigma : across * u_k[0] * u_k[0];
            force = root(z[0] * z[0] + z[1] * z[1]);
        }
        for (int i = 0; i < size; ++i) {
            along += z[i] * u_k[i];
            moved += (u_k[i] - kept[i]) * (u_k[i] - kept[i]);
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

// Maximise the dual in the requested lanes.  q.u, and the entries of q.y for the rows
// of H, are the initial guess.  q.u and q.y are overwritten with the solution in these
// lanes.
//
//   steps        largest number of Newton steps;
//   first_sigma  the first sigma is first_sigma / mean |(G^T h - d)_j|.  A larger value
//                needs a better guess.  With 0 the dual keeps its kinks, and the method
//                stops at the first kink;
//   relative, absolute  accepted gap: absolute + relative |G u + h|^2 / 2.
//
// Return the lanes that converged.
inline Whole Solver::dual_newton(
    Programme &q, int steps, double first_sigma, double relative, Real absolute,
    Whole requested) {
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
    Whole going = requested, done = {}, halvings = {}, taken = {};
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
        // a step that does not increase the dual is multiplied by 0.3
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
    for (int j = 0; j < k.nu; ++j) q.u[j] = requested ? u[j] : q.u[j];
    for (int i = 0; i < m; ++i) q.y[i] = requested ? y[i] : q.y[i];
    return done;
}

// Minimise in the requested lanes, to a gap of absolute + relative |G u + h|^2 / 2.
// Newton's method starts when the gap of the interior-point method is at most
// near + NEAR |G u + h|^2 / 2.
inline void Solver::interior_then_newton(
    Programme &q, double relative, Real absolute, Real near, Whole requested) {
    // near the edge of a zone without deformations the interior-point method can stop
    // before it reaches the final gap; Newton's method then needs more steps
    for (int attempt = 0; attempt < 2 && any(requested); ++attempt) {
        if (attempt == 0)
            interior_point(q, near, NEAR, requested);
        else
            interior_point(q, absolute, relative, requested);
        // rounding can move points out of their cones
        k.each([&](auto size, int, int at) {
            const Real length = root(inner(&q.u[at], &q.u[at], size));
            const Real shorter = requested ? larger(length, real(1.0)) : real(1.0);
            for (int i = at; i < at + size; ++i) q.u[i] /= shorter;
        });
        const int steps = attempt == 0 ? STEPS : STEPS_LAST;
        requested &= ~dual_newton(q, steps, FIRST_SIGMA, relative, absolute, requested);
    }
}

}  // namespace LANE_SPACE
