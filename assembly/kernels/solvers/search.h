// State of one search for (27): bounds of the farthest point of a convex body of
// platform screws.  Each support function improves the bounds.
//
// A body is {centre + X (v - start) : |v_k| <= 1, H (v - start) = 0}.  The largest
// rotation, or the largest translation, depends on three components of the screw.
// Planes approximate the projection onto these three components from outside.
//
// - A support function gives a plane, for the upper bound, and a point, for the lower
//   bound.  If the body is symmetric, it also gives both for the opposite direction.
// - In the first stage, the next direction is that of the supporting point; the lower
//   bound then increases.
// - Then a box along the best direction is computed.  From then on, the next direction
//   is that of the farthest corner of the polytope, unless the last support improved
//   the lower bound.
// - majorant.h computes an upper bound for round bodies, which would need many planes.
//
// Source: Horst, Tuy (1996), Global Optimization, ch. II (outer approximation of a
// convex maximisation).
#pragma once

#include "majorant.h"

namespace LANE_SPACE {

// largest number of support functions in the first stage; largest number of planes that
// are stored before there is a box
constexpr int CLIMBS = 8, MOST_KEPT = 32;
// [1] least gain of the first stage, as a share of the tolerance
constexpr double GAIN = 1e-3;

// A body.  Its columns are padded with zeros, so that several bodies have equal numbers
// of columns.
struct Body {
    int64_t point;
    Cones cones;                   // cones of the padded columns
    int unpadded_discs, unpadded_intervals;  // numbers of cones without padding
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

// The request of a search: a body, the half of the screw (0 for the rotation, 3 for the
// translation), and the required difference between upper and lower bound.
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
    double best[6];          // screw that attains the lower bound
    Point direction = {};    // direction of the next support function
    enum Stage { CLIMBING, BOXING, CUTTING } stage;
    int supports;
    bool gained;             // the last support function raised the lower bound
    Point axes[3];           // directions of the box
    Point heights[2];        // lower and upper sides of the box; NaN if unknown
    struct Plane { Point normal; double height; };
    std::vector<Plane> planes;  // planes found before there is a box
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
    const double *part = best + half;
    low = std::sqrt(part[0] * part[0] + part[1] * part[1] + part[2] * part[2]);
    high = INFINITY;
    stage = CLIMBING, supports = 0, gained = false;
    heights[0].fill(NAN), heights[1].fill(NAN);
    planes.clear();
    if (body->nv())
        first_direction();
    else
        high = low;
}

// Choose the direction of the farthest point of an approximation of the body: X is
// projected orthogonally to the rows H.
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
                const double component =
                    d[0] * free[j] + d[1] * free[nv + j] + d[2] * free[2 * nv + j];
                length += component * component;
                middle -= component * b.start[j];
            }
            height += std::sqrt(length);
        });
        if (height + std::fabs(middle) > most) {
            most = height + std::fabs(middle);
            for (int a = 0; a < 3; ++a) direction[a] = middle >= 0.0 ? d[a] : -d[a];
        }
    }
}

// Store a screw that is farther from the origin than the best one.
inline void Search::improve(const double *screw) {
    const double *part = screw + half;
    const double size =
        std::sqrt(part[0] * part[0] + part[1] * part[1] + part[2] * part[2]);
    if (!(size > low)) return;
    if (size > low + GAIN * tolerance) gained = true;
    low = size;
    std::copy(screw, screw + 6, best);
}

// Add a plane to the box, to the stored planes, or to the polytope.
inline void Search::add_plane(const Point &normal, double height) {
    if (stage == CUTTING)
        outer.cut(normal, height);
    else if (stage == BOXING)
        set_side({normal, height});
    else if (planes.size() < MOST_KEPT)
        planes.push_back({normal, height});
}

// Store the plane as a side of the box if its normal is parallel to an axis of the
// box.
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

// Choose the next direction and the stage.
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
    // if the last support function raised the lower bound, the direction of its point
    // is expected to raise it again, and the bound of majorant.h is sharpest there;
    // otherwise the farthest corner is next
    towards(gained ? best + half : corner.data());
}

// Start a box along the current direction; its planes are not known yet.
inline void Search::start_boxing() {
    stage = BOXING;
    const Point first = direction;
    int least = 0;
    for (int a = 1; a < 3; ++a)
        if (std::fabs(first[a]) < std::fabs(first[least])) least = a;
    axes[0] = first;
    for (int a = 0; a < 3; ++a) axes[1][a] = (a == least) - first[least] * first[a];
    const double size = std::sqrt(inner(axes[1], axes[1]));
    for (double &x : axes[1]) x /= size;
    for (int a = 0; a < 3; ++a) {
        const int b = (a + 1) % 3, c = (a + 2) % 3;
        axes[2][a] = first[b] * axes[1][c] - first[c] * axes[1][b];
    }
    for (const Plane &plane : planes) set_side(plane);
}

}  // namespace LANE_SPACE
