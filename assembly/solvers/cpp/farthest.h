// The farthest points of convex bodies of platform screws, bracketed: problem (27) by
// outer approximation, support.py and farthest.py in lanes.
//
// A body is {centre + X (v - start) : |v_k| <= 1, H (v - start) = 0}.  Each lane searches
// one body in one half of the screw, and takes the next where it ends.
//
// Sources: those of farthest.py.
#pragma once

#include "majorant.h"

constexpr int CLIMBS = 8, MOST_SUPPORTS = 400, MOST_KEPT = 32;
constexpr double GAIN = 1e-3;  // [tolerances] a climb that gains less is over
constexpr double SHARE = 0.1;  // of the tolerance that a support may leave open ..
constexpr double POOR = 0.5;   // .. and with which the search still goes on
constexpr double SYMMETRIC = 1e-14;  // H start counts as zero
constexpr double ROUNDING = 1e-14;   // by which a cone may be exceeded

// A body, its columns filled up with zeros to a number that others have too.
struct Body {
    int64_t point;
    Cones cones;                   // of the columns
    int own_discs, own_intervals;  // that are not filled up
    int p;
    double centre[6];
    std::vector<double> X, H, start;  // (6, nv), (p, nv), (nv,)

    int nv() const { return cones.nu; }
    double inner_of(const double *a, const double *b) const {
        double total = 0.0;
        for (int j = 0; j < nv(); ++j) total += a[j] * b[j];
        return total;
    }
};

// A search: of a body, in the rotation (0) or the translation (3), to bounds so close.
struct Task {
    const Body *body;
    int half;
    double tolerance;
};

// The state of a search.
struct Search {
    const Body *body = nullptr;
    int half = 0;
    double tolerance, low, high;
    double best[6];          // attains the lower bound
    Point direction = {};    // of the next support
    enum Stage { CLIMBING, BOXING, CUTTING } stage;
    int supports;
    bool gained;             // by the last support
    Point axes[3];           // of the box
    Point heights[2];        // of the box, low and high, NaN where not known
    struct Plane { Point normal; double height; };
    std::vector<Plane> planes;  // found before there was a box
    Polytope outer;

    void begin(const Task &task);
    void improve(const double *screw);
    void add_plane(const Point &normal, double height);
    void choose();

private:
    void first_direction();
    void set_side(const Plane &plane);
    void start_boxing();
    void towards(const double *point) {
        const double size =
            std::sqrt(point[0] * point[0] + point[1] * point[1] + point[2] * point[2]);
        for (int a = 0; a < 3; ++a) direction[a] = point[a] / size;
    }
};

inline void Search::begin(const Task &task) {
    body = task.body, half = task.half, tolerance = task.tolerance;
    std::copy(body->centre, body->centre + 6, best);
    const double *own = best + half;
    low = std::sqrt(own[0] * own[0] + own[1] * own[1] + own[2] * own[2]);
    high = INFINITY;
    stage = CLIMBING, supports = 0, gained = false;
    heights[0].fill(NAN), heights[1].fill(NAN);
    planes.clear();
    if (body->nv())
        first_direction();
    else
        high = low;
}

// The direction of farthest reach if there were no closures.
inline void Search::first_direction() {
    const Body &b = *body;
    const int nv = b.nv();
    std::vector<double> free(&b.X[half * nv], &b.X[half * nv] + 3 * nv);
    for (int i = 0; i < b.p; ++i)
        for (int a = 0; a < 3; ++a) {
            const double along = b.inner_of(&free[a * nv], &b.H[i * nv]);
            for (int j = 0; j < nv; ++j) free[a * nv + j] -= along * b.H[i * nv + j];
        }
    Point Q[3], values, V[3];
    for (int a = 0; a < 3; ++a)
        for (int c = 0; c < 3; ++c) Q[a][c] = b.inner_of(&free[a * nv], &free[c * nv]);
    eigenvectors(Q, values, V);
    double most = -1.0;
    for (int candidate = 0; candidate < 4; ++candidate) {
        Point d;
        for (int a = 0; a < 3; ++a)
            d[a] = candidate < 3 ? V[a][candidate] : b.centre[half + a];
        const double size = std::sqrt(inner(d, d));
        if (!(size > 0.0)) continue;
        double middle = 0.0, height = 0.0;
        for (int a = 0; a < 3; ++a) {
            d[a] /= size;
            middle += d[a] * b.centre[half + a];
        }
        b.cones.each([&](int columns, int, int at) {
            double length = 0.0;
            for (int j = at; j < at + columns; ++j) {
                const double own =
                    d[0] * free[j] + d[1] * free[nv + j] + d[2] * free[2 * nv + j];
                length += own * own;
                middle -= own * b.start[j];
            }
            height += std::sqrt(length);
        });
        if (height + std::fabs(middle) > most) {
            most = height + std::fabs(middle);
            for (int a = 0; a < 3; ++a) direction[a] = middle >= 0.0 ? d[a] : -d[a];
        }
    }
}

// Keeps a screw that is farther than the best.
inline void Search::improve(const double *screw) {
    const double *own = screw + half;
    const double size = std::sqrt(own[0] * own[0] + own[1] * own[1] + own[2] * own[2]);
    if (!(size > low)) return;
    if (size > low + GAIN * tolerance) gained = true;
    low = size;
    std::copy(screw, screw + 6, best);
}

// A plane for the box, for those kept for it, or for the polytope.
inline void Search::add_plane(const Point &normal, double height) {
    if (stage == CUTTING)
        outer.cut(normal, height);
    else if (stage == BOXING)
        set_side({normal, height});
    else if (planes.size() < MOST_KEPT)
        planes.push_back({normal, height});
}

// A side of the box, if the plane's normal is one of its axes or the opposite.
inline void Search::set_side(const Plane &plane) {
    for (int axis = 0; axis < 3; ++axis) {
        bool along = true, against = true;
        for (int a = 0; a < 3; ++a) {
            along = along && plane.normal[a] == axes[axis][a];
            against = against && plane.normal[a] == -axes[axis][a];
        }
        if (along)
            heights[1][axis] = plane.height;
        else if (against)
            heights[0][axis] = -plane.height;
    }
}

// The next direction, and the stage.
inline void Search::choose() {
    if (stage == CLIMBING) {
        if (gained && supports < CLIMBS) return towards(best + half);
        start_boxing();
    }
    if (stage == BOXING) {
        for (int axis = 0; axis < 3; ++axis)
            for (int side = 0; side < 2; ++side)
                if (std::isnan(heights[side][axis])) {
                    for (int a = 0; a < 3; ++a)
                        direction[a] = (2 * side - 1) * axes[axis][a];
                    return;
                }
        outer.start_box(axes, heights[0], heights[1]);
        stage = CUTTING;
        for (const Plane &plane : planes) outer.cut(plane.normal, plane.height);
    }
    const Point corner = outer.farthest_corner();
    high = std::max(low, std::min(high, std::sqrt(inner(corner, corner))));
    // where the last support gained, the direction of its point gains more, and the
    // second bound is tightest there; else the farthest vertex
    towards(gained ? best + half : corner.data());
}

// A box along the best point's direction, its planes not known yet.
inline void Search::start_boxing() {
    stage = BOXING;
    const Point own = direction;
    int least = 0;
    for (int a = 1; a < 3; ++a)
        if (std::fabs(own[a]) < std::fabs(own[least])) least = a;
    axes[0] = own;
    for (int a = 0; a < 3; ++a) axes[1][a] = (a == least) - own[least] * own[a];
    const double size = std::sqrt(inner(axes[1], axes[1]));
    for (double &x : axes[1]) x /= size;
    for (int a = 0; a < 3; ++a) {
        const int b = (a + 1) % 3, c = (a + 2) % 3;
        axes[2][a] = own[b] * axes[1][c] - own[c] * axes[1][b];
    }
    for (const Plane &plane : planes) set_side(plane);
}

// Searches bodies with cones as the first one, of at most p rows.
class Farthest {
public:
    Farthest(const Body &first, int p)
        : cones(first.cones), body(cones, p), whole_map(6, cones.nu), q(cones, p),
          solver(cones, p), majorant(cones.nu, p), gradient(cones.nu), v(cones.nu) {}

    // Does all tasks; settle(search, solved) is called at the end of each.
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
            double least[LANES];
            majorant.bound(body, gradient, busy, least);
            Whole again = busy & symmetric;
            for (int l = 0; l < LANES; ++l) {
                if (!busy[l]) continue;
                Search &own = searches[l];
                const double reached = along(own.direction, screw, l);
                // written so that NaN fails
                if (!(height[l] - reached <= POOR * own.tolerance)) {
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
    Search searches[LANES];
    Whole symmetric = {};   // v -> -v leaves the rows satisfied
    Real centre[6], tolerances = {};
    // what `support` and `opposite` leave
    Real height, screw[6];
    Row gradient, v;

    double along(const Point &d, const Real *of, int l) const {
        const Real *own = of + searches[l].half;
        return d[0] * own[0][l] + d[1] * own[1][l] + d[2] * own[2][l];
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

// The same along the opposite directions, where the body is symmetric.
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
    // the longest part of the step, from a start inside, that stays in all cones
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
        share = beyond & (most < share) ? most : share;
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
