// Problem (27) with the assumptions `frozen` and `free`, at several postures in
// parallel, from the poses of the frames to the convex bodies whose farthest points
// farthest.h bounds.  Deformations do not change, unloaded clearances move, and passive
// joints follow.  assembly/linear/reference solves points with a numerically ambiguous
// rank, and points where a passive joint could exceed its range.
#pragma once

#include <map>

#include "../solvers/farthest.h"
#include "rows.h"

namespace LANE_SPACE {

constexpr double UNBOUNDED = 1e-8;  // least motion by a free motion: ranks.py
constexpr double APART = 100.0;  // least ratio of load and slack, or its inverse

// Numbers of cones and of rows are padded to a multiple of this number, so that more
// bodies have equal sizes and can be solved together.
constexpr int FILLED = 2;

// Reader of blocks of points of one robot without springs, in sequence.
class ReachableSets : public Rows {
public:
    ReachableSets(
        const Robot &s, const Points &points, const Centres &centres, const ClearanceLoads &loads,
        const double *offset)
        : Rows(s, points), centres(centres), loads(loads), offset(offset), X(6, nu),
          start(nu), held(nu), cone(nu) {
        for (int c = 0; c < s.cones; ++c)
            for (int64_t i = s.starts[c]; i < s.starts[c + 1]; ++i) of_cone.push_back(c);
        for (int c = 0; c < nq; ++c) bounded = bounded || s.free_bound[c] < INFINITY;
    }

    Whole read_bodies(
        const Points &points, const Block &block, Whole requested,
        std::vector<Body> &bodies, int64_t *outcome);

private:
    const Centres &centres;
    const ClearanceLoads &loads;
    const double *offset;
    std::vector<int> of_cone;  // (nu,) the cone of each column
    bool bounded = false;      // a free motion has a limit
    Table X;                   // (6, nu) [rad, m] platform screws by unit clearances
    Row start;                 // (nu,) clearances of the solution of (22)
    std::vector<Whole> held, cone;  // held columns, solver's order; held cones

    Whole held_cones(const Block &block);
    Whole follow(int rank);
    Whole within_bounds(int rank, const Block &block);
    Body body_of(int l, int64_t point, int p, const Real *centre) const;
};

// Find the loaded clearances, which are held.  Return the lanes where they are
// unambiguous.  The load of a cone is the scaled force on its clearances; the slack is
// the remaining distance 1 - |u_k|.  Their product is about the gap of the solver, so
// that one of them is nearly zero.
inline Whole ReachableSets::held_cones(const Block &block) {
    const Robot &h = *loads.robot;
    const int closures = int(h.closures);
    Row on(6 * h.np), multipliers(6 * closures);
    for (int a = 0; a < 6 * closures; ++a)
        multipliers[a] = block.read(loads.multipliers, 6 * closures, a);
    for (int g = 0; g < h.np; ++g)
        for (int k = 0; k < closures; ++k)
            if (const double sign = h.patterns[g * closures + k])
                for (int a = 0; a < 6; ++a) on[6 * g + a] += sign * multipliers[6 * k + a];
    const Real energy = block.read(loads.energy, 1, 0);
    const Real least = larger(1e-9 * block.read(loads.without_clearance, 1, 0), real(1e-300));
    const Real scale = larger(energy, least);
    Whole decided = whole(-1);
    for (int c = 0; c < s.cones; ++c) {
        Real squares = {}, size = {}, screw[6];
        const int64_t held_cone = loads.cone_of[c];
        for (int64_t i = h.starts[held_cone]; i < h.starts[held_cone + 1]; ++i) {
            const int64_t j = h.cone_frame[i];
            column(j, h.cone_axis[i], screw);
            const Real force = inner(screw, &on[6 * h.pattern_of[j]], 6) * h.cone_size[i];
            squares += force * force;
            const Real u = block.read(loads.clearances, h.nu, i);
            size += u * u;
        }
        const Real load = root(squares) / scale, left = 1.0 - root(size);
        // the order of the cases keeps NaN
        const Real slack = left <= 0.0 ? Real{} : left;
        cone[c] = (load > slack) & (load > 1e-9);
        // NaN is ambiguous, because all comparisons are false
        decided &= (load > APART * slack) | (slack > APART * load) |
                   ((load <= 1e-9) & (slack <= 1e-9));
    }
    for (int c = 0; c < nu; ++c) held[c] = cone[of_cone[cones.column[c]]];
    return decided;
}

// Compute X, the motions of the platform at the requested point by the clearances and
// by the free motions that follow them.  Return the lanes where no free motion alone
// moves the platform.
inline Whole ReachableSets::follow(int rank) {
    Whole still = whole(-1);
    Row closing(m), on(6 * np);
    for (int a = 0; a < 6; ++a) {
        still &= ~balance_free_motions(rank, a, UNBOUNDED / CLEAR, closing);
        for (int g = 0; g < np; ++g) part(closing.data(), g, &on[6 * g]);
        for (int c = 0; c < nu; ++c) {
            const int index = int(cones.column[c]);
            const int64_t j = s.cone_frame[index];
            const Real moved =
                s.on_path[j] * clearance[index][a] +
                inner(clearance[index], &on[6 * s.pattern_of[j]], 6);
            X[a][c] = a < 3 ? moved : moved * s.size;
        }
    }
    for (int c = 0; c < nu; ++c)
        for (int a = 0; a < 3; ++a) {
            const int b = (a + 1) % 3, d = (a + 2) % 3;
            X[3 + a][c] += X[b][c] * offset[d] - X[d][c] * offset[b];
        }
    return still;
}

// Return the lanes where no passive joint exceeds its range, for any positions of the
// clearances.
inline Whole ReachableSets::within_bounds(int rank, const Block &block) {
    Row middle(nq), most(nq), squares(nq), moved(m);
    for (int q = 0; q < nq; ++q) middle[q] = block.read(centres.motions, nq, q);
    cones.each([&](auto of, int, int at) {
        std::fill(squares.begin(), squares.end(), Real{});
        for (int c = at; c < at + of; ++c) {
            const int index = int(cones.column[c]);
            std::fill(moved.begin(), moved.end(), Real{});
            for (const Entry &e : patterns[s.pattern_of[s.cone_frame[index]]])
                for (int a = 0; a < 6; ++a)
                    moved[6 * e.closure + a] =
                        held[c] ? Real{} : e.sign * clearance[index][a];
            const Row step = least_motions(rank, moved);
            for (int q = 0; q < nq; ++q) {
                middle[q] -= step[q] * start[c];
                squares[q] += step[q] * step[q];
            }
        }
        for (int q = 0; q < nq; ++q) most[q] += root(squares[q]);
    });
    Whole within = whole(-1);
    for (int q = 0; q < nq; ++q)
        if (s.free_bound[q] < INFINITY)  // the next comparison is false for NaN
            within &= magnitude(middle[q]) + most[q] <= s.free_bound[q];
    return within;
}

// Return the body of a lane: the columns that are not held, padded with zeros.
inline Body ReachableSets::body_of(int l, int64_t point, int p, const Real *centre) const {
    const auto filled = [](int count) { return (count + FILLED - 1) / FILLED * FILLED; };
    std::vector<int> columns;
    for (int c = 0; c < 2 * cones.discs; ++c)
        if (!held[c][l]) columns.push_back(c);
    const int discs = int(columns.size()) / 2;
    columns.resize(2 * filled(discs), -1);
    int at = 2 * cones.discs + cones.intervals;
    for (int c = 2 * cones.discs; c < at; ++c)
        if (!held[c][l]) columns.push_back(c);
    const int intervals = int(columns.size()) - 2 * filled(discs);
    columns.resize(2 * filled(discs) + filled(intervals), -1);
    Array<int> balls;
    for (int size : cones.balls) {
        if (!held[at][l]) balls.push_back(size);
        for (int c = at; c < at + size; ++c)
            if (!held[c][l]) columns.push_back(c);
        at += size;
    }
    Body body = {
        point, Cones(filled(discs), filled(intervals), balls), discs, intervals, p, {}, {},
        {}, {}};
    const auto copy = [&](const Real *row, std::vector<double> &to) {
        for (int c : columns) to.push_back(c < 0 ? 0.0 : row[c][l]);
    };
    for (int a = 0; a < 6; ++a) body.centre[a] = centre[a][l], copy(X[a], body.X);
    for (int i = 0; i < p; ++i) copy(programme.M[i], body.H);
    copy(start.data(), body.start);
    return body;
}

// Compute the bodies of platform screws in the requested lanes that have the same
// ranks as the first of them.  Return the requested lanes that remain.
inline Whole ReachableSets::read_bodies(
    const Points &points, const Block &block, Whole requested, std::vector<Body> &bodies,
    int64_t *outcome) {
    const auto leave = [&](Whole where) {
        for (int l = 0; l < LANES; ++l)
            if (where[l]) outcome[block.point[l]] = REFERENCE;
        return ~where;
    };
    Whole others = requested;
    read(points, block);
    others &= leave(requested & ~held_cones(block));
    if (!any(requested = others)) return others;
    const Ranks ranks = eliminate_free(tolerance(points, block), requested);
    others &= leave(ranks.unclear);
    if (!any(requested = ranks.same)) return others;
    const int count = m - ranks.free;
    for (int c = 0; c < nu; ++c) {
        const Real u = block.read(centres.clearances, nu, cones.column[c]);
        start[c] = held[c] ? Real{} : u;
    }
    // rounding can move points out of their cones
    cones.each([&](auto of, int, int at) {
        const Real shorter = larger(root(inner(&start[at], &start[at], of)), real(1.0));
        for (int c = at; c < at + of; ++c) start[c] /= shorter;
    });
    Whole valid = follow(ranks.free);
    if (bounded) valid &= within_bounds(ranks.free, block);
    others &= leave(requested & ~valid);
    if (!any(requested &= valid)) return others;
    const Whole clear = triangulate_rows(count, &held);
    others &= leave(requested & (clear < 0));
    if (!any(requested &= clear >= 0)) return others;
    const int p = rank_of_first(clear, requested);
    requested &= clear == p;
    orthonormal_rows(p);
    Real centre[6];
    for (int a = 0; a < 6; ++a) centre[a] = block.read(centres.screws, 6, a);
    for (int a = 0; a < 3; ++a) {
        const int b = (a + 1) % 3, d = (a + 2) % 3;
        centre[3 + a] += centre[b] * offset[d] - centre[d] * offset[b];
    }
    for (int l = 0; l < LANES; ++l)
        if (requested[l]) bodies.push_back(body_of(l, block.point[l], p, centre));
    return others & ~requested;
}

// Return the searches of all bodies in both halves of the screw, sorted into groups.
// A group has equal padded numbers of rows and columns and equal balls; its searches
// run together.
typedef std::map<std::vector<int>, std::vector<Task>> Groups;

inline Groups searches_of(const std::vector<Body> &bodies, const double *tolerance) {
    Groups groups;
    for (const Body &body : bodies) {
        const int p = (body.p + FILLED - 1) / FILLED * FILLED;
        std::vector<int> size = {p, body.cones.discs, body.cones.intervals};
        size.insert(size.end(), body.cones.balls.begin(), body.cones.balls.end());
        for (int half = 0; half < 2; ++half)
            groups[size].push_back({&body, 3 * half, tolerance[half]});
    }
    return groups;
}

}  // namespace LANE_SPACE
