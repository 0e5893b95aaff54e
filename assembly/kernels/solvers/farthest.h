// Bounds of the farthest points of convex bodies of platform screws: problem (27) by
// outer approximation (search.h).
//
// The support function of a body along d is the maximum of a small cone programme.  Any
// multipliers n of the rows H prove an upper bound,
//
//     d.(centre - X start) + n.H start + sum_k |(X^T d - H^T n)_k|.
//
// The point that the solver returns is projected into the body.  Both the bound and the
// point are therefore valid for any result of the solver.
//
// Each lane searches one half of the screw in one body.  A lane that has finished
// starts the next search.
#pragma once

#include <functional>

#include "search.h"

namespace LANE_SPACE {

// largest number of support functions in a search
constexpr int MOST_SUPPORTS = 400;
// accepted gap of a support function, as a share of the tolerance
constexpr double SHARE = 0.1;
constexpr double POOR = 0.5;   // largest gap with which the search continues
// size below which an entry of H start counts as zero
constexpr double SYMMETRIC = 1e-14;
constexpr double ROUNDING = 1e-14;   // accepted excess of |v_k|^2 over 1

// A search of bodies that have at most p rows, and cones of the same sizes as those of
// the first body.
class Farthest {
public:
    // Alternative that is called if a support function cannot be computed here.  From a
    // direction it computes a certified value of the support function, a screw that
    // attains it, and the gradient X^T d - H^T n.
    typedef std::function<void(const Point &, double *, double *, double *)> Support;

    Farthest(const Body &first, int p, Support other = {})
        : cones(first.cones), body(cones, p), whole_map(6, cones.nu), q(cones, p),
          solver(cones, p), majorant(cones.nu, p), other(std::move(other)),
          gradient(cones.nu), v(cones.nu) {}

    // Carry out all tasks.  Call settle(search, solved) at the end of each search.
    template <typename Settle> void search(const std::vector<Task> &tasks, Settle settle) {
        size_t next = 0;
        Whole busy = {};
        while (true) {
            for (int l = 0; l < LANES; ++l)
                while (true) {
                    Search &state = searches[l];
                    if (busy[l]) {
                        const bool done = state.high - state.low <= state.tolerance;
                        if (!done && state.supports < MOST_SUPPORTS) break;
                        settle(state, done);
                        busy[l] = 0;
                    }
                    if (next == tasks.size()) break;
                    state.begin(tasks[next++]);
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
                    again[l] = 0;  // the alternative gives no opposite support
                    found[l] = ask(l) ? -1 : 0;
                }
            double least[LANES];
            majorant.bound(body, gradient, busy, least);
            for (int l = 0; l < LANES; ++l) {
                if (!busy[l]) continue;
                Search &state = searches[l];
                const double reached = along(state.direction, screw, l);
                if (!found[l]) {
                    settle(state, false);
                    busy[l] = again[l] = 0;
                    continue;
                }
                ++state.supports;
                state.gained = false;
                take(state, l, state.direction, std::max(double(height[l]), reached));
                state.high = std::max(std::min(state.high, least[l]), state.low);
            }
            if (any(again)) {
                opposite();
                for (int l = 0; l < LANES; ++l) {
                    if (!again[l]) continue;
                    Search &state = searches[l];
                    Point back;
                    for (int a = 0; a < 3; ++a) back[a] = -state.direction[a];
                    take(
                        state, l, back,
                        std::max(double(height[l]), along(back, screw, l)));
                }
            }
            for (int l = 0; l < LANES; ++l)
                if (busy[l]) searches[l].choose();
        }
    }

private:
    const Cones cones;
    Projection body;
    Table whole_map;  // X, all six components of the screw
    Programme q;
    Solver solver;
    Majorant majorant;
    const Support other;
    Search searches[LANES];
    Whole symmetric = {};   // lanes in which -v satisfies the rows, too
    Real centre[6], tolerances = {};
    // results of `support` and `opposite`
    Real height, screw[6];
    Row gradient, v;

    double along(const Point &d, const Real *of, int l) const {
        const Real *part = of + searches[l].half;
        return d[0] * part[0][l] + d[1] * part[1][l] + d[2] * part[2][l];
    }

    // Return whether the screw of a lane nearly attains its height.  The comparison is
    // false for NaN.
    bool close(int l) const {
        const double reached = along(searches[l].direction, screw, l);
        return height[l] - reached <= POOR * searches[l].tolerance;
    }

    // Compute the support function of a lane by the alternative.  Return whether
    // there is an alternative.
    bool ask(int l) {
        if (!other) return false;
        double found_height, attains[6];
        std::vector<double> w(cones.nu);
        other(searches[l].direction, &found_height, attains, w.data());
        height[l] = found_height;
        for (int a = 0; a < 6; ++a) screw[a][l] = attains[a];
        for (int j = 0; j < cones.nu; ++j) gradient[j][l] = w[j];
        return true;
    }

    // Add the screw and the plane of a support function to a search.
    void take(Search &state, int l, const Point &normal, double support) {
        double of_lane[6];
        for (int a = 0; a < 6; ++a) of_lane[a] = screw[a][l];
        state.improve(of_lane);
        state.add_plane(normal, support);
    }

    void load(int l);
    void support(Whole requested);
    void opposite();
    void within(Row &v);
    void screw_at(const Row &v);
};

// Copy the body of a search into its lane.
inline void Farthest::load(int l) {
    const Search &state = searches[l];
    const Body &b = *state.body;
    const int nv = cones.nu;
    const auto column = [&](Real *row, const double *from) {
        for (int j = 0; j < nv; ++j) row[j][l] = from ? from[j] : 0.0;
    };
    for (int a = 0; a < 6; ++a) {
        centre[a][l] = b.centre[a];
        column(whole_map[a], &b.X[a * nv]);
    }
    for (int a = 0; a < 3; ++a) {
        body.centre[a][l] = b.centre[state.half + a];
        column(body.X[a], &b.X[(state.half + a) * nv]);
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
        const bool there = interval < 0                 ? c < b.unpadded_discs
                           : interval < cones.intervals ? interval < b.unpadded_intervals
                                                        : true;
        body.present[c][l] = there ? -1 : 0;
    }
    tolerances[l] = state.tolerance;
}

// Compute support functions along the directions of the searches: a certified height,
// a screw that nearly attains it, and the gradient X^T d - H^T n.
inline void Farthest::support(Whole requested) {
    const int nv = cones.nu, p = body.p;
    Real d[3];
    for (int l = 0; l < LANES; ++l)
        for (int a = 0; a < 3; ++a) d[a][l] = searches[l].direction[a];
    std::fill(gradient.begin(), gradient.end(), Real{});
    combine(body.X.rows(), 3, d, nv, gradient.data());
    height = -inner(gradient.data(), body.start.data(), nv);
    for (int a = 0; a < 3; ++a) height += d[a] * body.centre[a];
    const Real size = root(inner(gradient.data(), gradient.data(), nv));
    const Whole moves = requested & (size > 0.0);
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
            const Real point =
                p ? q.u[j] : length > 0.0 ? gradient[j] * over : body.start[j];
            v[j] = moves ? point : body.start[j];
        }
    });
    if (p) within(v);
    screw_at(v);
}

// Compute the support functions of symmetric bodies along the opposite directions.
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

// Move v to a nearby point that satisfies the rows and the cones except for rounding
// errors.
inline void Farthest::within(Row &v) {
    const int nv = cones.nu;
    for (int j = 0; j < nv; ++j) v[j] -= body.start[j];
    for (int i = 0; i < body.p; ++i) {
        const Real residual = inner(body.H[i], v.data(), nv);
        for (int j = 0; j < nv; ++j) v[j] -= residual * body.H[i][j];
    }
    // the largest share of the step from `start`, which is inside, that remains in all
    // cones
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

// Compute the platform screws at v.
inline void Farthest::screw_at(const Row &v) {
    Row step(cones.nu);
    for (int j = 0; j < cones.nu; ++j) step[j] = v[j] - body.start[j];
    multiply(whole_map.rows(), 6, step.data(), cones.nu, screw);
    for (int a = 0; a < 6; ++a) screw[a] += centre[a];
}

}  // namespace LANE_SPACE
