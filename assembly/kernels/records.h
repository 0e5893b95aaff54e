// Records that pass arrays from Python to the kernels: addresses of the arrays and
// their numbers of rows.
//
// Numbers in parentheses, such as (22), refer to the equations of docs/theory.md.
// Units are those of assembly/linear/lanes.py.
#pragma once

#include <cstdint>
#include <functional>

// The arrays of a robot, and their sizes.  The class Structure of
// assembly/linear/robot_structure.py describes every array.
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

// Postures, errors and loads of `count` points:
//
// - T (k, n, 4, 4) transforms of the frames, mismatch (k,) their nominal closure
//   errors,
// - errors (k, n, 6) geometric errors,
// - loads (k, 2, n, 6) wrenches on bodies and on joints, in the frames' axes, or null.
//
// An array may have one row that serves all points.  The row's flag, posture_per_point,
// errors_per_point or loads_per_point, is then 0, otherwise 1.
struct Points {
    int64_t count;
    const double *T, *mismatch, *errors, *loads;
    int64_t posture_per_point, errors_per_point, loads_per_point;
};

// Solution of problem (22), one row for each point.  assembly/linear/lanes.py describes
// the arrays as `out`.  `elastic` is null if the deformations of the springs are not
// requested.
struct Solutions {
    int64_t *outcome;
    double *energy, *bound, *without_clearance, *work, *platform_screw, *clearances,
        *motions, *multipliers, *residual, *elastic;
};

// Margins (21) and their lower bounds, one row for each point.  `forces` (k, nu) on the
// clearances prove the bounds; the magnitudes of the forces on all cones add up to 1.
struct Margins {
    double *margin, *bound, *forces;
    int64_t *outcome;
};

// Deformations (k, 6, ny) of all springs under six unit wrenches on the platform, and
// for each point a code that says whether they exist.
struct Compliances {
    double *springs;
    int64_t *status;
};

// Centres of the sets of possible positions (27): solution of (22), one row for each
// point. assembly/linear/lanes.py describes the arrays as `centres`.
struct Centres {
    const double *screws, *clearances, *motions;
};

// Solution of (22) from which the forces on the clearances and their remaining
// distances to contact are computed, one row for each point.  assembly/linear/lanes.py
// describes the arrays as `loads`.
struct ClearanceLoads {
    const Robot *robot;
    const double *multipliers, *clearances, *energy, *without_clearance;
    const int64_t *cone_of;
};

// Request of (27): the vector [m] from the platform's origin to the point whose error
// is bounded, and the required differences [rad, m] between upper and lower bound.
struct PoseErrorRequest {
    const double *offset, *tolerance;  // (3,), (2,)
};

// Bounds of (27), one row for each point.  The first array of each pair is for the
// rotation, the second for the translation.
struct Bounds {
    double *bounds[2], *screw[2];
    int64_t *supports, *outcome;
};

// The problem: minimise |G u + h|^2 / 2 - d.u subject to H u = k and |u_k| <= 1 for
// each cone.
struct ConeProblem {
    int64_t r, p, cones;
    const int64_t *starts;                // (cones + 1,)
    const double *G, *h, *d, *H, *k;      // (r, nu), (r,), (nu,), (p, nu), (p,)
};

// `count` such problems that share G, H and the cones: h (count, r), d (count, nu), k
// (count, p).
struct ConeProblems {
    int64_t count, r, p, cones;
    const int64_t *starts;
    const double *G, *h, *d, *H, *k;
};

// Projections onto one set.  The closest point is requested for each of `count` points
// `from` (count, nu).  `rows` (p, nu) are the rows of H, whose values H u are kept.
// Where `kept` (count, nu) is 1, the position of the cone is kept.
struct Projections {
    int64_t count, p, cones;
    const int64_t *starts;
    const double *rows, *from, *kept;
};

// Accepted gap: `absolute` plus `relative` times the energy.  For Newton's method also
// the largest number of steps and the factor of the first sigma (dual_newton.h).
struct Limits {
    double relative, absolute, first_sigma;
    int64_t steps;
};

// A convex body of platform screws (search.h).  `half` is 0 if the rotation is bounded
// and 3 if the translation is bounded.  `tolerance` is the required difference between
// upper and lower bound.
struct BodyRequest {
    int64_t p, cones, half;
    const int64_t *starts;                      // (cones + 1,)
    const double *centre, *map, *rows, *start;  // (6,), (6, nv), (p, nv), (nv,)
    double tolerance;
    // Alternative that is called if the kernel cannot compute a support function.  From
    // a direction (3,) it computes a certified value of the support function, a screw
    // (6,) that attains it, and the gradient X^T d - H^T n (nv,).
    std::function<void(const double *, double *, double *, double *)> support;
};

// Sets {|u_k| <= 1 for each cone k, H u = e} that differ in e, and the request: `count`
// unit directions d, each with an accepted gap of d.u.
struct Directions {
    int64_t count, p, cones;
    const int64_t *starts;                                  // (cones + 1,)
    const double *rows, *directions, *right, *tolerance;  // (p, nu), (count, nu),
                                                          // (count, p), (count,)
};

// The farthest points, one row for each direction: u (count, nu), the multipliers
// (count, p) of H u = e, and 1 where the accepted gap was reached, else 0.
struct FarthestPoints {
    double *points, *multipliers;
    int64_t *solved;
};

// A robot's frames; parents come before their children.
//
// - size [m] reference length,
// - kinds (n,) of joints: 0 fixed, 1 revolute or helical, 2 prismatic,
// - pairs (closures, 2) of frames that the closures join,
// - moves (.., 2) the joints that move each closure and then the platform, each with
//   its sign,
// - groups (closures + 2,) first row of `moves` for each closure, for the platform, and
//   the end,
// - fixed (n, 4, 4) transforms from the parents at zero joint coordinate,
// - leads (n,) [m/rad] of the joints; not zero only for helical joints.
struct Tree {
    int64_t n, closures, platform;
    double size;
    const int64_t *parents, *kinds, *pairs, *moves, *groups;
    const double *fixed, *leads;
};

// Targets: `start` (n,) coordinates of the home configuration; `poses` (count, 6)
// required platform poses, or null; `held` (count, n) prescribed coordinates, NaN where
// the coordinate is free.  The same entries are NaN in every row.  `guess` is 1 if
// `start` is itself a guess of the solution.
struct Targets {
    int64_t count;
    const double *start, *poses, *held;
    int64_t guess;
};

// Results: `ends` (k, n) coordinates, `progress` (k,) from 0 to 1, `transforms` (k, n,
// 4, 4) of the frames, and `still_open` (k, closures) the largest closure errors [rad,
// m].
struct Tracks {
    double *ends, *progress, *transforms, *still_open;
};

// Unit cones of positions u (nu,), and Dikin's ellipsoid in them.  The columns of
// `axes` (nu, n) are its axes M; `gram` (nu, nu) is M M^T.
struct Ellipsoid {
    int64_t nu, n, cones;
    const double *axes, *gram;
    const int64_t *starts;  // (cones + 1,)
};

// Trajectories of a walk: `kept` platform screws are stored, one after every `every`
// trajectories.
struct Trajectories {
    int64_t kept, every;
    const double *to_screw;  // (6, nu)
};

struct bitgen;  // NumPy's bit generator
