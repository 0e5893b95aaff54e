// Declarations of the compiled functions that Python calls.
#pragma once

#include "records.h"

// (22) and (21) of every point.  Unused lanes cost time, and what two lanes
// touch fits into the fastest cache: bit-identical results sooner for one or two points.
namespace few_lanes {
void assemble_all(const Robot &robot, const Points &points, Solutions &out);
void all_margins(const Robot &robot, const Points &points, Margins &out);
}  // namespace few_lanes
namespace many_lanes {
void assemble_all(const Robot &robot, const Points &points, Solutions &out);
void all_margins(const Robot &robot, const Points &points, Margins &out);
}  // namespace many_lanes

// Bounds of the largest pose errors, (27), of the points whose outcome is 0.
void bound_all(
    const Robot &robot, const Points &points, const Centres &centres,
    const ClearanceLoads &loads, const Asked &asked, Bounds &out);

// The classical compliance of every point.
void comply_all(const Robot &robot, const Points &points, Compliances &out);

// Interior-point method of a cone programme, from any guess u (nu,); y (r + p,) of G's
// rows is not changed.
void interior_point(const ConeProblem &given, const Limits &limits, double *u, double *y);

// Newton's method for the same programme, from a guess of u and of H's multipliers.
void newton(const ConeProblem &given, const Limits &limits, double *u, double *y);

// Overwrites lower and upper bound (2,), and the screw (6,) that attains the lower one.
// Returns the number of support functions; with too many of them the bounds are wider
// than required.
int64_t farthest(const AskedBody &asked, double *bounds, double *screw);

// Cone programmes of the same G and H: positions u (count, nu) and multipliers (count,
// r + p) of the rows of G and H.
void minimise_all(const ConeProblems &given, double *u, double *y);

// The points of {|u_k| <= 1 for each cone k, H u = H u0} closest to given ones.
// Overwrites u0 (count, nu), where solved (count,) is set.
void closest_points(const Projections &given, double *u, int64_t *solved);

// Follows every target along its straight line.
void follow_all(const Tree &tree, const Targets &targets, Tracks &out);

// Farthest points of a set along directions.
void farthest_points(const Directions &asked, FarthestPoints &out);

// Points (chains, nu) close to the boundary, from u (nu,) in random directions.
void start_chains(
    const Ellipsoid &given, const double *u, bitgen *random, int64_t chains, double *walks);

// A billiard walk from u (nu,), which is overwritten; its platform screws (kept, 6).
void billiard_walk(
    const Ellipsoid &given, const Trajectories &asked, bitgen *random, double *u,
    double *trace);
