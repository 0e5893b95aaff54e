// Arguments from Python to the kernels: addresses of arrays and their numbers of rows.
#pragma once

#include <cstdint>
#include <functional>

// A robot: Structure of assembly/linear/robot_structure.py, and its array sizes.
struct Robot {
    double size;
    int64_t platform;
    const double *on_path, *patterns;
    const int64_t *pattern_of;
    const double *springs;
    const int64_t *spring_frame, *spring_order, *of_joint, *groups, *group_pattern;
    const double *group_on_path;
    const int64_t *cone_frame, *cone_axis;
    const double *cone_size;
    const int64_t *starts, *free_frame, *free_axis;
    const double *free_lead, *free_bound;
    int64_t n, closures, np, ny, ng, nu, cones, nq;
};

// Points: (k or 1, n, 4, 4) frames with as many nominal closure errors, (k or 1, n, 6)
// errors; (k or 1, 2, n, 6) loads on bodies and on joints, in the frames' axes, or none.
// One row serves all points, where each has no own: 0 for 1.
struct Points {
    int64_t count;
    const double *T, *mismatch, *errors, *loads;
    int64_t own_posture, own_errors, own_loads;
};

// Solution of problem (22), one row for each point: `out` of assembly/linear/lanes.py;
// `elastic` only on request.
struct Solutions {
    int64_t *outcome;
    double *energy, *bound, *without_clearance, *work, *platform_screw, *clearances,
        *motions, *multipliers, *residual, *elastic;
};

// Margins (21), their bounds, and the forces (k, nu) on clearances that prove these: their
// sizes on all cones add up to 1; one row a point.
struct Margins {
    double *margin, *bound, *forces;
    int64_t *outcome;
};

// Deformation of every spring under six unit wrenches on the platform, (k, 6, ny), and
// whether a point has one.
struct Compliances {
    double *springs;
    int64_t *status;
};

// Inputs of later problems from the solution of (22), one row for each point; see
// lanes.py.
struct Centres {
    const double *screws, *clearances, *motions;
};

// Loads and slack of the clearances, one row a point; see lanes.py.
struct ClearanceLoads {
    const Robot *robot;
    const double *multipliers, *clearances, *energy, *without_clearance;
    const int64_t *cone_of;
};

// Request of (27): vector from the platform's origin to the point whose error is bounded,
// and required width between upper and lower bound.
struct Asked {
    const double *offset, *tolerance;  // (3,), (2,)
};

// Bounds of (27), one row a point: those of rotation, then translation.
struct Bounds {
    double *bounds[2], *screw[2];
    int64_t *supports, *outcome;
};

// minimise |G u + h|^2 / 2 - d.u subject to H u = k and |u_k| <= 1 for each cone.
struct ConeProblem {
    int64_t r, p, cones;
    const int64_t *starts;                // (cones + 1,)
    const double *G, *h, *d, *H, *k;      // (r, nu), (r,), (nu,), (p, nu), (p,)
};

// count of these problems with the same G, H and cones: h (count, r), d (count, nu), k
// (count, p).
struct ConeProblems {
    int64_t count, r, p, cones;
    const int64_t *starts;
    const double *G, *h, *d, *H, *k;
};

// Points of one set: count points (count, nu) of which the closest one is asked, rows (p,
// nu) that keep their values, and the cones (count, nu) whose positions are kept: 1.
struct Projections {
    int64_t count, p, cones;
    const int64_t *starts;
    const double *rows, *from, *kept;
};

// Required gap; for Newton's method the largest number of steps and the first sigma.
struct Limits {
    double relative, absolute, first_sigma;
    int64_t steps;
};

// A body of platform screws, its half (0 or 3), and the required width between upper and
// lower bound.
struct AskedBody {
    int64_t p, cones, half;
    const int64_t *starts;                      // (cones + 1,)
    const double *centre, *map, *rows, *start;  // (6,), (6, nv), (p, nv), (nv,)
    double tolerance;
    // if no support function is found here: for a direction (3,) its certified height,
    // the screw (6,) that attains it, and the gradient X^T d - H^T n (nv,)
    std::function<void(const double *, double *, double *, double *)> support;
};

// A set {|u_k| <= 1 for each cone k, H u = e}, with different right sides e, and the
// request: count directions d of length 1, each with the accepted gap of d.u.
struct Directions {
    int64_t count, p, cones;
    const int64_t *starts;                                  // (cones + 1,)
    const double *rows, *directions, *right, *tolerance;  // (p, nu), (count, nu),
                                                          // (count, p), (count,)
};

// The farthest points, one row for each direction: u (count, nu), the multipliers (count,
// p) of H u = e, and whether the gap was reached.
struct FarthestPoints {
    double *points, *multipliers;
    int64_t *solved;
};

// A robot's frames, in the order of their parents: fixed (n, 4, 4) transforms, kinds of
// joints (0 fixed, 1 turns, 2 slides), leads [m/rad] of helical joints (which turn, too),
// pairs of frames that closures join, and for each closure, then the platform, the joints
// that move it, with signs.
struct Tree {
    int64_t n, closures, platform;
    double size;
    const int64_t *parents, *kinds, *pairs, *moves, *groups;
    const double *fixed, *leads;
};

// (n,) coordinates at home, (k, 6) poses, if any, and (k, n) coordinates held, NaN where
// free: the same entries in every row.
struct Targets {
    int64_t count;
    const double *start, *poses, *held;
    int64_t guess;
};

// (k, n) coordinates, (k,) progress, (k, n, 4, 4) frames, (k, closures) left open.
struct Tracks {
    double *ends, *progress, *transforms, *still_open;
};

// Unit cones of positions u (nu,), and in columns (nu, n) the axes M of Dikin's ellipsoid
// there, with M M^T.
struct Ellipsoid {
    int64_t nu, n, cones;
    const double *axes, *gram;
    const int64_t *starts;  // (cones + 1,)
};

// Trajectories of a walk, `every` of them between two stored platform screws.
struct Trajectories {
    int64_t kept, every;
    const double *to_screw;  // (6, nu)
};

struct bitgen;  // NumPy's generator of random bits
