// The farthest points of convex bodies of platform screws, bracketed: problem (27) by
// outer approximation (search.h).
//
// A body's support function along d is a small cone programme.  Any multipliers n of its
// rows prove an upper bound,
//
//     d.(centre - X start) + n.H start + sum_k |(X^T d - H^T n)_k|,
//
// and its point is projected into the body: both are valid for any result of the solver.
//
// Each lane searches one body in one half of the screw, and takes the next one at the
// end.
#pragma once

#include <functional>

#include "search.h"

namespace LANE_SPACE {

constexpr int MOST_SUPPORTS = 400;
// accepted gap of a support function, as a share of the tolerance ..
constexpr double SHARE = 0.1;
constexpr double POOR = 0.5;   // .. and the gap with which the search still continues
constexpr double SYMMETRIC = 1e-14;  // H start counts as zero
constexpr double ROUNDING = 1e-14;   // accepted excess over a cone

// Search of bodies with cones as those of the first one, of at most p rows.
class Farthest {
public:
    // If a support function is not found here: of a direction its certified height, the
    // screw that attains it and the gradient X^T d - H^T n.
    typedef std::function<void(const Point &, double *, double *, double *)> Support;

    Farthest(const Body &first, int p, Support other = {})
        : cones(first.cones), body(cones, p), whole_map(6, cones.nu), q(cones, p),
          solver(cones, p), majorant(cones.nu, p), other(std::move(other)),
          gradient(cones.nu), v(cones.nu) {}

    // Does all tasks; calls settle(search, solved) at the end of each.
    template <typename Settle> void search(const std::vector<Task> &tasks, Settle settle) {
        size_t next = 0;
        Whole busy = {};
        while (true) {
            for (int l = 0; l < LANES; ++l)
                while (true) {
                    Search &own = searches[l];
                    if (busy[l]) {
                        const bool done = own.high - own.low <= own.tolerance;
                        if (!done && own.supports < MOST_SUPPORTS) break;
                        settle(own, done);
                        busy[l] = 0;
                    }
                    if (next == tasks.size()) break;
                    own.begin(tasks[next++]);
                    load(l);
                    busy[l] = -1;
                }
            if (!any(busy)) return;
            support(busy);
            Whole again = busy & symmetric, found = {};
            for (int l = 0; l < LANES; ++l)
                if (busy[l]) {
                    found[l] = close(l) ? -1 : 0;
                    if (found[l]) continue;
                    again[l] = 0;  // of another's support no opposite follows
                    found[l] = ask(l) ? -1 : 0;
                }
            double least[LANES];
            majorant.bound(body, gradient, busy, least);
            for (int l = 0; l < LANES; ++l) {
                if (!busy[l]) continue;
                Search &own = searches[l];
                const double reached = along(own.direction, screw, l);
                if (!found[l]) {
                    settle(own, false);
                    busy[l] = again[l] = 0;
                    continue;
                }
                ++own.supports;
                own.gained = false;
                take(own, l, own.direction, std::max(double(height[l]), reached));
                own.high = std::max(std::min(own.high, least[l]), own.low);
            }
            if (any(again)) {
                opposite();
                for (int l = 0; l < LANES; ++l) {
                    if (!again[l]) continue;
                    Search &own = searches[l];
                    Point back;
                    for (int a = 0; a < 3; ++a) back[a] = -own.direction[a];
                    take(own, l, back, std::max(double(height[l]), along(back, screw, l)));
                }
            }
            for (int l = 0; l < LANES; ++l)
                if (busy[l]) searches[l].choose();
        }
    }

private:
    const Cones cones;
    Projection body;
    Table whole_map;  // X, all six components
    Programme q;
    Solver solver;
    Majorant majorant;
    const Support other;
    Search searches[LANES];
    Whole symmetric = {};   // v -> -v leaves the rows satisfied
    Real centre[6], tolerances = {};
    // results of `support` and `opposite`
    Real height, screw[6];
    Row gradient, v;

    double along(const Point &d, const Real *of, int l) const {
        const Real *own = of + searches[l].half;
        return d[0] * own[0][l] + d[1] * own[1][l] + d[2] * own[2][l];
    }

    // Whether the screw of a lane nearly attains its height; written so that NaN does not.
    bool close(int l) const {
        const double reached = along(searches[l].direction, screw, l);
        return height[l] - reached <= POOR * searches[l].tolerance;
    }

    // A lane's support from the alternative; whether there is one.
    bool ask(int l) {
        if (!other) return false;
        double own_height, attains[6];
        std::vector<double> w(cones.nu);
        other(searches[l].direction, &own_height, attains, w.data());
        height[l] = own_height;
        for (int a = 0; a < 6; ++a) screw[a][l] = attains[a];
        for (int j = 0; j < cones.nu; ++j) gradient[j][l] = w[j];
        return true;
    }

    // A support of a lane's body, its screw and its plane.
    void take(Search &own, int l, const Point &normal, double support) {
        double of_lane[6];
        for (int a = 0; a < 6; ++a) of_lane[a] = screw[a][l];
        own.improve(of_lane);
        own.add_plane(normal, support);
    }

    void load(int l);
    void support(Whole asked);
    void opposite();
    void within(Row &v);
    void screw_at(const Row &v);
};

// The body of a lane's search.
inline void Farthest::load(int l) {
    const Search &own = searches[l];
    const Body &b = *own.body;
    const int nv = cones.nu;
    const auto column = [&](Real *row, const double *from) {
        for (int j = 0; j < nv; ++j) row[j][l] = from ? from[j] : 0.0;
    };
    for (int a = 0; a < 6; ++a) {
        centre[a][l] = b.centre[a];
        column(whole_map[a], &b.X[a * nv]);
    }
    for (int a = 0; a < 3; ++a) {
        body.centre[a][l] = b.centre[own.half + a];
        column(body.X[a], &b.X[(own.half + a) * nv]);
    }
    column(body.start.data(), b.start.data());
    bool even = true;
    for (int i = 0; i < body.p; ++i) {
        const double *row = i < b.p ? &b.H[i * nv] : nullptr;
        column(body.H[i], row);
        const double right = row ? b.inner_of(row, b.start.data()) : 0.0;
        body.right[i][l] = right;
        even = even && std::fabs(right) <= SYMMETRIC;
    }
    symmetric[l] = even ? -1 : 0;
    body.rows[l] = b.p;
    for (int c = 0; c < cones.count; ++c) {
        const int interval = c - cones.discs;
        const bool there = interval < 0                 ? c < b.own_discs
                           : interval < cones.intervals ? interval < b.own_intervals
                                                        : true;
        body.present[c][l] = there ? -1 : 0;
    }
    tolerances[l] = own.tolerance;
}

// Support functions along the searches' directions: a certified height, a screw that
// nearly attains it, and the gradient X^T d - H^T n.
inline void Farthest::support(Whole asked) {
    const int nv = cones.nu, p = body.p;
    Real d[3];
    for (int l = 0; l < LANES; ++l)
        for (int a = 0; a < 3; ++a) d[a][l] = searches[l].direction[a];
    std::fill(gradient.begin(), gradient.end(), Real{});
    combine(body.X.rows(), 3, d, nv, gradient.data());
    height = -inner(gradient.data(), body.start.data(), nv);
    for (int a = 0; a < 3; ++a) height += d[a] * body.centre[a];
    const Real size = root(inner(gradient.data(), gradient.data(), nv));
    const Whole moves = asked & (size > 0.0);
    if (p) {
        const Real over = 1.0 / (moves ? size : real(1.0));
        for (int j = 0; j < nv; ++j) q.d[j] = gradient[j] * over;
        for (int i = 0; i < p; ++i) {
            std::copy(body.H[i], body.H[i] + nv, q.M[i]);
            q.e[i] = body.right[i];
        }
        q.r = 0, q.p = p, q.loaded = true;
        solver.interior_point(q, SHARE * tolerances * over, 0.0, moves);
        Row against(p);
        for (int i = 0; i < p; ++i) {
            against[i] = moves ? -size * q.y[i] : Real{};
            height -= against[i] * body.right[i];
        }
        combine(body.H.rows(), p, against.data(), nv, gradient.data());
    }
    cones.each([&](auto of, int, int at) {
        const Real length = root(inner(&gradient[at], &gradient[at], of));
        height += length;
        const Real over = 1.0 / (length > 0.0 ? length : real(1.0));
        for (int j = at; j < at + of; ++j) {
            const Real own = p ? q.u[j] : length > 0.0 ? gradient[j] * over : body.start[j];
            v[j] = moves ? own : body.start[j];
        }
    });
    if (p) within(v);
    screw_at(v);
}

// The same along the opposite directions, if the body is symmetric.
inline void Farthest::opposite() {
    Row mirrored(cones.nu);
    for (int j = 0; j < cones.nu; ++j) mirrored[j] = -v[j];
    within(mirrored);
    screw_at(mirrored);
    height = inner(gradient.data(), body.start.data(), cones.nu);
    for (int l = 0; l < LANES; ++l)
        for (int a = 0; a < 3; ++a)
            height[l] -= searches[l].direction[a] * body.centre[a][l];
    cones.each([&](auto of, int, int at) {
        height += root(inner(&gradient[at], &gradient[at], of));
    });
}

// A nearby v that satisfies rows and cones to rounding.
inline void Farthest::within(Row &v) {
    const int nv = cones.nu;
    for (int j = 0; j < nv; ++j) v[j] -= body.start[j];
    for (int i = 0; i < body.p; ++i) {
        const Real residual = inner(body.H[i], v.data(), nv);
        for (int j = 0; j < nv; ++j) v[j] -= residual * body.H[i][j];
    }
    // the largest part of the step, from a start inside, that remains in all cones
    Real share = real(1.0);
    cones.each([&](auto of, int, int at) {
        Real aa = {}, ab = {}, bb = real(-1.0 - ROUNDING);
        for (int j = at; j < at + of; ++j) {
            aa += v[j] * v[j];
            ab += body.start[j] * v[j];
            bb += body.start[j] * body.start[j];
        }
        const Whole beyond = aa + 2.0 * ab + bb > 0.0;
        const Real under = ab * ab - aa * bb, r = root(under > 0.0 ? under : Real{});
        const Real most = ab > 0.0 ? -bb / (ab + r) : (r - ab) / aa;
        share = (beyond & (most < share)) ? most : share;
    });
    share = larger(share, Real{});
    for (int j = 0; j < nv; ++j) v[j] = body.start[j] + share * v[j];
}

// Platform screws at v.
inline void Farthest::screw_at(const Row &v) {
    Row step(cones.nu);
    for (int j = 0; j < cones.nu; ++j) step[j] = v[j] - body.start[j];
    multiply(whole_map.rows(), 6, step.data(), cones.nu, screw);
    for (int a = 0; a < 6; ++a) screw[a] += centre[a];
}

}  // namespace LANE_SPACE
