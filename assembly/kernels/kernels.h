// Declarations of the compiled functions that Python calls.
//
// Numbers in parentheses, such as (22), refer to the equations of docs/theory.md.
#pragma once

#include "records.h"

// Problems (22) and (21) at every point.  few_lanes computes two points in parallel,
// many_lanes as many as a vector register holds.  The results are bit-identical.  For
// one or two points few_lanes is faster: no lane is unused, and the data of two lanes
// fit into the first-level cache.
namespace few_lanes {
void assemble_all(const Robot &robot, const Points &points, Solutions &out);
void all_margins(const Robot &robot, const Points &points, Margins &out);
}  // namespace few_lanes
namespace many_lanes {
void assemble_all(const Robot &robot, const Points &points, Solutions &out);
void all_margins(const Robot &robot, const Points &points, Margins &out);
}  // namespace many_lanes

// Bounds of the largest pose errors, (27), at the points whose outcome is 0.
void bound_all(
    const Robot &robot, const Points &points, const Centres &centres,
    const ClearanceLoads &loads, const PoseErrorRequest &requested, Bounds &out);

// Springs' deformations that determine the classical compliance of the platform, at
// every point.
void comply_all(const Robot &robot, const Points &points, Compliances &out);

// Solve one cone programme by an interior-point method.  u (nu,) and y (r + p,) are
// overwritten with the solution; the entries of y for the rows of G are not changed.
void interior_point(const ConeProblem &given, const Limits &limits, double *u, double *y);

// Solve the same programme by Newton's method on the dual problem.  u and the
// multipliers of H are initial guesses.
void newton(const ConeProblem &given, const Limits &limits, double *u, double *y);

// Bound the farthest screw of one body.  Overwrite `bounds` (2,), the lower and the
// upper bound, and `screw` (6,), which attains the lower bound.  Return the number of
// support functions computed.  If that number reaches its limit, the bounds differ by
// more than the required width.
int64_t farthest(const BodyRequest &requested, double *bounds, double *screw);

// Solve cone programmes that share G and H.  Overwrite the positions u (count, nu)
// and the multipliers y (count, r + p) of the rows of G and H.
void minimise_all(const ConeProblems &given, double *u, double *y);

// Find the points of {|u_k| <= 1 for each cone k, H u = H u0} that are closest to
// given points.  `u` (count, nu) contains u0.  A row of `u` is overwritten where its
// entry of `solved` (count,) becomes 1.
void closest_points(const Projections &given, double *u, int64_t *solved);

// Move a robot to every target along a straight line of poses and coordinates.
void follow_all(const Tree &tree, const Targets &targets, Tracks &out);

// Find the farthest points of a set along given directions.
void farthest_points(const Directions &requested, FarthestPoints &out);

// Find the start of every chain: a point (nu,) near the boundary, in a random
// direction from u (nu,).  Overwrite `walks` (chains, nu).
void start_chains(
    const Ellipsoid &given, const double *u, bitgen *random, int64_t chains, double *walks);

// Continue a billiard walk from u (nu,), which is overwritten with the last point.
// Overwrite `trace` (kept, 6) with platform screws.
void billiard_walk(
    const Ellipsoid &given, const Trajectories &requested, bitgen *random, double *u,
    double *trace);
