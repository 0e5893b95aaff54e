// Interior-point method for small cone programmes in parallel:
//
//     minimise  |G u + h|^2 / 2 - d.u   subject to  H u = e,  |u_k| <= 1, each cone k
//
// The method uses the scaling of Nesterov and Todd with Mehrotra's predictor and
// corrector.  The start u = 0, with its multipliers, satisfies all conditions except
// H u = e.  All iterates satisfy the same conditions.  The gap is then the sum of s.z
// over the cones, with s = (1, u).  Each step solves one symmetric system with one
// unknown for each row of G and H.  Its size, about 10, does not depend on the number
// of clearances.
//
// dual_newton.h solves the dual problem by Newton's method.  The multipliers n of H are
// the last entries of y:
//
//     maximise  y.h - |y|^2 / 2 - n.e - sum_k |(G^T y + H^T n - d)_k|
//
// ========  ===========================================================================
// M         (r + p, nu) rows of G, then rows of H
// y         (r + p,) their multipliers: G u + h, then those of H u = e
// z         (z0, z1), the multipliers of the cones, with z1 = M^T y - d
// w, rho    scaling point of Nesterov and Todd: W = rho^1/2 (w), where (w) is the
//           matrix that belongs to w
// l, t      l = (w) z; rho^1/2 t are the right sides of the scaled complementarity.
//           With these symbols no square root of rho is needed
// D         W^2 without its first row and column, for each cone; of a ball a - b w w^T
// S         M D M^T + diag(1 .. 1, 0 .. 0)
// ========  ===========================================================================
//
// Sources: Nesterov, Todd (1997), Self-scaled barriers and interior-point methods for
// convex programming; Andersen, Roos, Terlaky (2003), On implementing a primal-dual
// interior-point method for conic quadratic optimization (steps and starting point).
#pragma once

#include "programme.h"

namespace LANE_SPACE {

// largest number of iterations of the interior-point method
constexpr int ITERATIONS = 60;
// distance of the start from the boundary of the cones: z0 = |z1| + START
constexpr double START = 0.03;
// step, as a share of the step to the nearest boundary of a cone
constexpr double BACK_OFF = 0.99;
constexpr int HALVINGS = 12;        // largest number of reductions of a Newton step
// factor by which sigma grows; largest share of the residual in the gap at which u_old
// is replaced (dual_newton.h)
constexpr double SIGMA_GROWTH = 10.0, INNER_SHARE = 0.1;
constexpr double ON_ROWS = 1e-13;   // accepted residual of each row of H u = e

// gap at which Newton's method follows the interior-point method, relative to the
// energy and to the energy without clearance; factor of the first sigma (dual_newton.h)
constexpr double NEAR = 1e-8, NEAR_WITHOUT_CLEARANCE = 1e-9, FIRST_SIGMA = 1e6;
// largest numbers of Newton steps: without the interior-point method, after it, and in
// the last attempt
constexpr int STEPS_ALONE = 6, STEPS = 20, STEPS_LAST = 150;

class Solver {
public:
    explicit Solver(const Cones &cones, int rows)
        : k(cones), system(rows), B(2, cones.nu), heads(cones.count), z0(cones.count),
          z1(cones.nu), u(cones.nu), du(cones.nu), dz0(cones.count), dz1(cones.nu),
          f(cones.nu), y(rows), right(rows), residual(rows), start(rows), old(cones.nu),
          wide(3, cones.balls.empty() ? 0 : cones.nu) {}

    Whole newton_alone(Programme &q, double relative, Real absolute, Whole requested) {
        return dual_newton(q, STEPS_ALONE, 0.0, relative, absolute, requested);
    }
    void interior_then_newton(
        Programme &q, double relative, Real absolute, Real near, Whole requested);
    Whole interior_point(Programme &q, Real tolerance, double relative, Whole requested);
    Whole dual_newton(
        Programme &q, int steps, double first_sigma, double relative, Real absolute,
        Whole requested);
    Whole closest(Programme &q, const Row &a, const Row &kept, Whole requested);

private:
    // Scaling of Nesterov and Todd for one cone.  Values that two products compute are
    // not stored, because all data of an iteration have to fit into the first-level
    // cache.
    struct Head {
        Real rho, w0, w[2];
        Real D[3];  // entries 11, 12, 22 of D; a, b of a ball
        // 1/s^2, 1/z0, 1/l0, 1/(1 + w0); s^2 = 1 - u.u
        Real over_s2, over_z0, over_l0, over_head;
    };

    const Cones &k;
    System system;
    Table B;
    Array<Head> heads;
    Row z0, z1, u, du, dz0, dz1, f, y, right, residual, start, old;
    Table wide;  // for balls: w, and l and t of the corrector

    template <typename Size> Real *turn_of(Size, Head &head, int at) {
        if constexpr (Size::ball)
            return wide[0] + at;
        else
            return head.w;
    }

    Whole scale();
    template <int R> void square_scaled(Real *const *x, Real *const *out) const;
    void fill_system(const Programme &q);
    void direction(Programme &q);
    Real fastest() const;
    void correct(Real target);
    struct Slopes { Real smooth, residual, kink, primal; Whole closed; };
    void forces(const Programme &q, int rows, const Real *y);
    Slopes slopes(const Programme &q, Real sigma, const Real *y);
    Real project(const Row &a, const Row &kept, const Row &fixed);
};

// Compute the scaling at (u, z).  Return the lanes in which u and z are inside all
// cones; the scaling is valid only there.
inline Whole Solver::scale() {
    Whole inside = whole(-1);
    k.each([&](auto size, int c, int at) {
        Head &o = heads[c];
        Real *w = turn_of(size, o, at), s2 = real(1.0), z2 = z0[c] * z0[c], sz = z0[c];
        for (int i = at; i < at + size; ++i) {
            s2 -= u[i] * u[i];
            z2 -= z1[i] * z1[i];
            sz += u[i] * z1[i];
        }
        inside &= (s2 > 0.0) & (z2 > 0.0);
        // a division takes as long as ten products: one division serves three quotients
        const Real both = s2 * z2, over = 1.0 / (both * z0[c]), heads_over = z0[c] * over;
        o.over_z0 = both * over, o.over_s2 = z2 * heads_over;
        o.rho = root(s2 * s2 * heads_over);
        // the scaling point lies halfway between (1, u) / |s| and (z0, -z1) / |z|
        const Real half = 1.0 / root(2.0 * (s2 + o.rho * sz));
        o.w0 = (1.0 + o.rho * z0[c]) * half;
        Real ww = {}, wz = {};
        for (int i = 0; i < size; ++i) {
            w[i] = (u[at + i] - o.rho * z1[at + i]) * half;
            ww += w[i] * w[i];
            wz += w[i] * z1[at + i];
        }
        const Real l0 = o.w0 * z0[c] + wz, head = 1.0 + o.w0, wide = 1.0 + 2.0 * ww;
        const Real most = head * l0, once = 1.0 / (most * wide), fewer = wide * once;
        o.over_head = l0 * fewer, o.over_l0 = head * fewer;
        // the eigenvalue of D along w; across w it is rho
        const Real along = o.rho * most * once;
        o.D[0] = along;
        if (size == 2) {
            o.D[0] = along * (1.0 + 2.0 * w[1] * w[1]);
            o.D[1] = -2.0 * along * w[0] * w[1];
            o.D[2] = along * (1.0 + 2.0 * w[0] * w[0]);
        }
        if (size.ball) o.D[0] = o.rho, o.D[1] = 2.0 * along;
    });
    return inside;
}

// Compute D x for R rows x.
template <int R>
inline void Solver::square_scaled(Real *const *x, Real *const *out) const {
    k.each([&](auto size, int c, int at) {
        const Real *o = heads[c].D, D[3] = {o[0], o[1], o[2]};
        for (int i = 0; i < R; ++i) {
            const Real first = x[i][at];
            if (size.ball) {
                const Real along = D[1] * inner(wide[0] + at, x[i] + at, size);
                for (int j = at; j < at + size; ++j)
                    out[i][j] = D[0] * x[i][j] - along * wide[0][j];
            } else if (size == 1) {
                out[i][at] = D[0] * first;
            } else {
                const Real second = x[i][at + 1];
                out[i][at] = D[0] * first + D[1] * second;
                out[i][at + 1] = D[1] * first + D[2] * second;
            }
        }
    });
}

// Compute the lower triangle of S, two rows at a time, so that B = D M remains in the
// first-level cache.
inline void Solver::fill_system(const Programme &q) {
    const int m = q.r + q.p;
    Real *const *M = q.M.rows(), **S = system.S.rows();
    int i = 0;
    for (; i + 2 <= m; i += 2) {
        square_scaled<2>(M + i, B.rows());
        products<2>(B.rows(), M, i + 2, k.nu, S + i);
    }
    if (i < m) {
        square_scaled<1>(M + i, B.rows());
        products<1>(B.rows(), M, m, k.nu, S + i);
    }
    for (i = 0; i < q.r; ++i) S[i][i] += 1.0;
}

// Compute the step du, dz for f = (W^-1 t)_1, where t are the scaled right sides,
// after eliminating the rows of M.  On entry dz0 contains r0.  It is overwritten by
// means of the first row of the scaled complementarity, s.dz + z.ds = r0, in which
// W^-1 t - W^-2 ds cancels.
inline void Solver::direction(Programme &q) {
    const int m = q.r + q.p;
    Real *row = f.data(), *squared = du.data();
    square_scaled<1>(&row, &squared);
    multiply(q.M.rows(), m, squared, k.nu, right.data());
    for (int i = 0; i < q.p; ++i) right[q.r + i] -= residual[i];
    system.solve(m, right.data());
    std::fill(dz1.begin(), dz1.end(), Real{});
    combine(q.M.rows(), m, right.data(), k.nu, dz1.data());
    k.each([&](auto size, int c, int at) {
        const Real *D = heads[c].D, first = f[at] - dz1[at];
        du[at] = D[0] * first;
        if (size.ball) {
            Real along = {};
            for (int i = at; i < at + size; ++i) along += wide[0][i] * (f[i] - dz1[i]);
            along *= D[1];
            for (int i = at; i < at + size; ++i)
                du[i] = D[0] * (f[i] - dz1[i]) - along * wide[0][i];
        }
        if (size == 2) {
            const Real second = f[at + 1] - dz1[at + 1];
            du[at] += D[1] * second;
            du[at + 1] = D[1] * first + D[2] * second;
        }
        for (int i = at; i < at + size; ++i) dz0[c] -= z1[i] * du[i] + u[i] * dz1[i];
    });
}

// Return the inverse of the longest step that keeps every s and z in its cone.
inline Real Solver::fastest() const {
    Real most = {};
    // returns 1 / t for the smallest t > 0 with a t^2 + 2 b t + c = 0, where c < 0
    const auto crossing = [](Real a, Real b, Real minus_c, Real over_c) {
        const Real under = b * b + a * minus_c;
        const Real below = b + root(under > 0.0 ? under : Real{});
        return ((under >= 0.0) & (below > 0.0)) ? below * over_c : Real{};
    };
    k.each([&](auto size, int c, int at) {
        const Head &o = heads[c];
        Real aa = {}, ab = {}, s2 = real(1.0);
        Real ya = -dz0[c] * dz0[c], yb = -z0[c] * dz0[c], z2 = z0[c] * z0[c];
        for (int i = at; i < at + size; ++i) {
            aa += du[i] * du[i], ab += u[i] * du[i], s2 -= u[i] * u[i];
            ya += dz1[i] * dz1[i], yb += z1[i] * dz1[i], z2 -= z1[i] * z1[i];
        }
        most = larger(crossing(aa, ab, s2, o.over_s2), most);
        most = larger(crossing(ya, yb, z2, o.rho * o.rho * o.over_s2), most);
        most = larger(-dz0[c] * o.over_z0, most);
    });
    return most;
}

// Solve l o t = r with r = target e - l o l - (W^-1 ds) o (W dz) for t, where o is the
// Jordan product of the cone and e its unit element.  Overwrite f with (W^-1 t)_1, and
// dz0 with r0, the first component of r.
inline void Solver::correct(Real target) {
    k.each([&](auto size, int c, int at) {
        Head &o = heads[c];
        const Real *w = turn_of(size, o, at);
        Real ds = {}, dz = {}, wz = {}, z2 = z0[c] * z0[c];
        for (int i = 0; i < size; ++i) {
            ds += w[i] * du[at + i];
            dz += w[i] * dz1[at + i];
            wz += w[i] * z1[at + i];
            z2 -= z1[at + i] * z1[at + i];
        }
        const Real l0 = o.w0 * z0[c] + wz, s0 = -ds, y0 = o.w0 * dz0[c] + dz;
        Real squares = l0 * l0, product = s0 * y0, lt = {}, wt = {}, room[4];
        Real *l = size.ball ? wide[1] + at : room, *t = size.ball ? wide[2] + at : room + 2;
        ds *= o.over_head, dz = dz0[c] + dz * o.over_head;
        wz = z0[c] + wz * o.over_head;
        for (int i = 0; i < size; ++i) {
            const Real s1 = du[at + i] + ds * w[i], y1 = dz1[at + i] + dz * w[i];
            l[i] = z1[at + i] + wz * w[i];
            squares += l[i] * l[i], product += s1 * y1;
            t[i] = -(s0 * y1 + y0 * s1) - 2.0 * o.rho * l0 * l[i];
            lt += l[i] * t[i];
        }
        const Real r0 = target - product - o.rho * squares;
        const Real over_z2 = o.rho * o.rho * o.over_s2;  // since |l| = |z|
        const Real t0 = (l0 * r0 - lt) * over_z2;
        for (int i = 0; i < size; ++i) {
            t[i] = (t[i] - t0 * l[i]) * o.over_l0;
            wt += w[i] * t[i];
        }
        wt = wt * o.over_head - t0;
        const Real over_rho = o.rho * z2 * o.over_s2;
        for (int i = 0; i < size; ++i) f[at + i] = (t[i] + wt * w[i]) * over_rho;
        dz0[c] = r0;
    });
}

// Minimise in the requested lanes, from u = 0.  Overwrite q.u, and the entries of q.y
// for the rows of H, with the last iterate.  Return the lanes whose gap is at most
// tolerance + relative |G u + h|^2 / 2.
inline Whole Solver::interior_point(
    Programme &q, Real tolerance, double relative, Whole requested) {
    const int r = q.r, p = q.p, m = r + p;
    const auto dual = [&] {  // z1 = M^T y - d
        for (int j = 0; j < k.nu; ++j) z1[j] = q.loaded ? -q.d[j] : Real{};
        combine(q.M.rows(), m, y.data(), k.nu, z1.data());
    };
    std::fill(u.begin(), u.end(), Real{});
    for (int i = 0; i < m; ++i) y[i] = i < r ? q.h[i] : Real{};
    dual();
    k.each([&](auto size, int c, int at) {
        z0[c] = root(inner(&z1[at], &z1[at], size)) + START;
    });
    Whole going = requested, done = {};
    for (int iteration = 0; iteration < ITERATIONS; ++iteration) {
        Real gap = inner(z1.data(), u.data(), k.nu), energy = 0.5 * inner(y.data(), y.data(), r);
        for (const Real &head : z0) gap += head;
        multiply(q.M.rows() + r, p, u.data(), k.nu, residual.data());
        Real worst = {};
        for (int i = 0; i < p; ++i) {
            residual[i] = q.e[i] - residual[i];
            worst = larger(magnitude(residual[i]), worst);
        }
        const Whole close = (gap <= tolerance + relative * energy) & (worst <= 1e-13);
        done |= going & close;
        going &= ~close;
        if (!any(going)) break;
        going &= scale();
        fill_system(q);
        going &= system.factor(m, true);
        if (!any(going)) break;
        // predictor, without centring and correction: t = -l and W^-1 l = z
        k.each([&](auto size, int c, int at) {
            dz0[c] = -z0[c];
            for (int i = at; i < at + size; ++i) {
                f[i] = -z1[i];
                dz0[c] -= u[i] * z1[i];
            }
        });
        direction(q);
        Real length = 1.0 / larger(fastest(), real(1.0));
        // exponent 1.5 instead of the usual 3: on these problems it needs a sixth fewer
        // iterations
        const Real sigma = (1.0 - length) * root(1.0 - length);
        correct(sigma * gap / double(k.count));
        direction(q);
        length = BACK_OFF / larger(fastest(), real(BACK_OFF));
        going &= length >= 1e-10;
        // the values of finished lanes do not change
        for (int j = 0; j < k.nu; ++j) u[j] = going ? u[j] + length * du[j] : u[j];
        for (int c = 0; c < k.count; ++c) z0[c] = going ? z0[c] + length * dz0[c] : z0[c];
        // y = G u + h holds by construction; computing y again prevents drift by
        // rounding
        multiply(q.M.rows(), r, u.data(), k.nu, y.data());
        for (int i = 0; i < r; ++i) y[i] += q.h[i];
        for (int i = r; i < m; ++i) y[i] = going ? y[i] + length * right[i] : y[i];
        dual();
    }
    for (int j = 0; j < k.nu; ++j) q.u[j] = requested ? u[j] : q.u[j];
    for (int i = r; i < m; ++i) q.y[i] = requested ? y[i] : q.y[i];
    return done;
}

}  // namespace LANE_SPACE
