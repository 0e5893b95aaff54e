// One cone programme, and the farthest screw of one body, with cones of any size.
// Python calls these functions for a single problem.
#define FEW_LANES
#include "../kernels.h"
#include "block.h"
#include "dual_newton.h"
#include "farthest.h"

using namespace LANE_SPACE;

namespace {

// Apply `method` to one problem.  u (nu,) and the multipliers y (r + p,), those of
// H's rows last, contain an initial guess and are overwritten with the result.  All
// lanes contain the same problem.
template <typename Method>
void solve(const ConeProblem &given, double *u, double *y, Method method) {
    const Cones cones(given.starts, int(given.cones));
    const int r = int(given.r), p = int(given.p), nu = cones.nu;
    Programme q(cones, r + p);
    q.r = r, q.p = p, q.loaded = true;
    for (int c = 0; c < nu; ++c) {
        const int64_t column = cones.column[c];
        for (int i = 0; i < r; ++i) q.M[i][c] = real(given.G[i * nu + column]);
        for (int i = 0; i < p; ++i) q.M[r + i][c] = real(given.H[i * nu + column]);
        q.d[c] = real(given.d[column]);
        q.u[c] = real(u[column]);
    }
    for (int i = 0; i < r; ++i) q.h[i] = real(given.h[i]);
    for (int i = 0; i < p; ++i) q.e[i] = real(given.k[i]);
    for (int i = 0; i < r + p; ++i) q.y[i] = real(y[i]);
    Solver solver(cones, r + p);
    method(solver, q);
    for (int c = 0; c < nu; ++c) u[cones.column[c]] = q.u[c][0];
    for (int i = 0; i < r + p; ++i) y[i] = q.y[i][0];
}

}  // namespace

void interior_point(
    const ConeProblem &given, const Limits &limits, double *u, double *y) {
    solve(given, u, y, [&](Solver &solver, Programme &q) {
        solver.interior_point(q, real(limits.absolute), limits.relative, whole(-1));
    });
}

void newton(const ConeProblem &given, const Limits &limits, double *u, double *y) {
    solve(given, u, y, [&](Solver &solver, Programme &q) {
        solver.dual_newton(
            q, int(limits.steps), limits.first_sigma, limits.relative,
            real(limits.absolute), whole(-1));
    });
}

int64_t farthest(const BodyRequest &requested, double *bounds, double *screw) {
    const Cones given(requested.starts, int(requested.cones));
    const int nv = given.nu, p = int(requested.p);
    Body body = {0, Cones(given.discs, given.intervals, given.balls), given.discs,
                 given.intervals, p, {}, {}, {}, {}};
    const auto ordered = [&](const double *from, int rows, std::vector<double> &to) {
        for (int i = 0; i < rows; ++i)
            for (int64_t column : given.column) to.push_back(from[i * nv + column]);
    };
    std::copy(requested.centre, requested.centre + 6, body.centre);
    ordered(requested.map, 6, body.X);
    ordered(requested.rows, p, body.H);
    ordered(requested.start, 1, body.start);
    int64_t supports = 0;
    const Task task = {&body, int(requested.half), requested.tolerance};
    std::vector<double> gradient(nv);
    const auto support = [&](const Point &direction, double *height, double *attains,
                             double *w) {
        requested.support(direction.data(), height, attains, gradient.data());
        for (int j = 0; j < nv; ++j) w[j] = gradient[given.column[j]];
    };
    Farthest(body, p, support).search({task}, [&](const Search &found, bool) {
        bounds[0] = found.low, bounds[1] = found.high;
        std::copy(found.best, found.best + 6, screw);
        supports = found.supports;
    });
    return supports;
}
