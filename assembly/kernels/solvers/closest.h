// Points of small convex sets that are closest to given points, in parallel.  cones.h
// defines the symbols.  The problem
//
//     minimise  |u - a|^2 / 2   subject to  M u = e,  |u_k| <= 1, each cone k
//
// is solved by Newton's method on its dual, which is smooth:
//
//     maximise  y.(M u - e) + |u - a|^2 / 2,  where u is the point of the cones that is
//     closest to a - M^T y.
//
// A point of the set is known.  Its value of M u is e.
//
// Source: Li, Sun, Toh (2018), A highly efficient semismooth Newton augmented
// Lagrangian method for solving lasso problems.
#pragma once

#include "cones.h"

namespace LANE_SPACE {

constexpr int STEPS_CLOSEST = 40;  // largest number of Newton steps
// added to the negative second derivative, whose largest possible value is 1.  Rows
// that contain only cones without freedom have a second derivative of 0
constexpr double CURVATURE = 1e-13;

// Compute u, the point of the cones that is closest to a - z1, and D, which determines
// the negative second derivative M D M^T.  The positions of the cones in `kept` remain
// at `fixed`.  Return the value of the dual without the terms of the rows.
inline Real Solver::project(const Row &a, const Row &kept, const Row &fixed) {
    Real value = {};
    k.each([&](auto size, int c, int first) {
        Real *u_k = &u[first], *D = heads[c].D;
        const Whole stays = kept[first] != 0.0;
        for (int i = 0; i < size; ++i) u_k[i] = a[first + i] - z1[first + i];
        const Real length = root(inner(u_k, u_k, size));
        const Whole inside = length <= 1.0;
        const Real shorter = 1.0 / (inside ? real(1.0) : length);
        for (int i = 0; i < size; ++i)
            u_k[i] = stays ? fixed[first + i] : u_k[i] * shorter;
        if (size.ball) {
            for (int i = 0; i < size; ++i) wide[0][first + i] = u_k[i];
            D[0] = stays ? Real{} : shorter;
            D[1] = inside ? Real{} : D[0];
        } else if (size == 1) {
            D[0] = stays | ~inside ? Real{} : real(1.0);
        } else {  // on the boundary of the disc only rotation is free
            D[0] = inside ? real(1.0) : shorter * u_k[1] * u_k[1];
            D[1] = inside ? Real{} : -shorter * u_k[0] * u_k[1];
            D[2] = inside ? real(1.0) : shorter * u_k[0] * u_k[0];
            for (int i = 0; i < 3; ++i) D[i] = stays ? Real{} : D[i];
        }
        for (int i = first; i < first + size; ++i) {
            const Real step = u[i] - a[i];
            value += z1[i] * u[i] + 0.5 * step * step;
        }
    });
    return value;
}

// Find the point of each set that is closest to `a`, in the requested lanes.  q.u is a
// point of the set; it is overwritten in the lanes that are solved.  Return these
// lanes.
inline Whole Solver::closest(
    Programme &q, const Row &a, const Row &kept, Whole requested) {
    const int m = q.p;
    const Row fixed = q.u;
    multiply(q.M.rows(), m, fixed.data(), k.nu, q.e.data());
    std::fill(y.begin(), y.end(), Real{});
    Real before = real(-INFINITY);
    Whole going = requested, done = {}, halvings = {}, taken = {};
    Row step(m);
    while (true) {
        std::fill(z1.begin(), z1.end(), Real{});
        combine(q.M.rows(), m, y.data(), k.nu, z1.data());
        Real value = project(a, kept, fixed), worst = {};
        multiply(q.M.rows(), m, u.data(), k.nu, right.data());
        for (int i = 0; i < m; ++i) {
            right[i] -= q.e[i];
            value -= y[i] * q.e[i];
            worst = larger(magnitude(right[i]), worst);
        }
        const Whole close = worst <= ON_ROWS;
        for (int j = 0; j < k.nu; ++j) q.u[j] = (going & close) ? u[j] : q.u[j];
        done |= going & close;
        going &= ~close;
        const Whole climbs = value >= before - 1e-14;
        halvings = climbs ? Whole{} : halvings + 1;
        going &= (climbs & (taken < STEPS_CLOSEST)) | (~climbs & (halvings <= HALVINGS));
        if (!any(going)) return done;
        const Whole shorter = going & ~climbs, on = going & climbs;
        for (int i = 0; i < m; ++i) {
            step[i] = shorter ? 0.3 * step[i] : step[i];
            y[i] = shorter ? start[i] + step[i] : y[i];
        }
        if (!any(on)) continue;
        before = on ? value : before;
        taken -= on;
        fill_system(q);
        for (int i = 0; i < m; ++i) system.S[i][i] += CURVATURE;
        going &= ~on | system.factor(m, true);
        system.solve(m, right.data());
        const Whole ahead = on & going;
        for (int i = 0; i < m; ++i) {
            start[i] = ahead ? y[i] : start[i];
            step[i] = ahead ? right[i] : step[i];
            y[i] = ahead ? y[i] + step[i] : y[i];
        }
    }
}

}  // namespace LANE_SPACE
