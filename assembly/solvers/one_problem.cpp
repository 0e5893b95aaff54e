// One cone programme, and one body's farthest screw, with cones of any size: interior.py
// and farthest.py for callers with a single problem.
#define FEW_LANES
#include "cpp/block.h"
#include "cpp/farthest.h"

// minimise |G u + h|^2 / 2 - d.u subject to H u = k and |u_k| <= 1 for each cone.
struct Given {
    int64_t r, p, cones;
    const int64_t *starts;                // (cones + 1,)
    const double *G, *h, *d, *H, *k;      // (r, nu), (r,), (nu,), (p, nu), (p,)
    double tolerance;
};

// Overwrites u (nu,) and the multipliers n (p,) of H.
EXPORTED void interior_point(const Given *given, double *u, double *n) {
    const int r = int(given->r), p = int(given->p);
    const Cones cones(given->starts, int(given->cones));
    const int nu = cones.nu;
    Programme q(cones, r + p);
    q.r = r, q.p = p, q.loaded = true;
    for (int c = 0; c < nu; ++c) {
        const int64_t own = cones.column[c];
        for (int i = 0; i < r; ++i) q.M[i][c] = real(given->G[i * nu + own]);
        for (int i = 0; i < p; ++i) q.M[r + i][c] = real(given->H[i * nu + own]);
        q.d[c] = real(given->d[own]);
    }
    for (int i = 0; i < r; ++i) q.h[i] = real(given->h[i]);
    for (int i = 0; i < p; ++i) q.e[i] = real(given->k[i]);
    Solver(cones, r + p).interior_point(q, real(given->tolerance), 0.0, whole(-1));
    for (int c = 0; c < nu; ++c) u[cones.column[c]] = q.u[c][0];
    for (int i = 0; i < p; ++i) n[i] = q.y[r + i][0];
}

// A body of platform screws; the half, 0 or 3, that is meant, and what is asked of upper
// minus lower bounds.
struct Asked {
    int64_t p, cones, half;
    const int64_t *starts;                      // (cones + 1,)
    const double *centre, *map, *rows, *start;  // (6,), (6, nv), (p, nv), (nv,)
    double tolerance;
};

// Overwrites lower and upper bound (2,), and the screw (6,) that attains the lower; how
// many support functions it took, or -1 where the bounds are not as close as asked.
EXPORTED int64_t farthest(const Asked *asked, double *bounds, double *screw) {
    const Cones given(asked->starts, int(asked->cones));
    const int nv = given.nu, p = int(asked->p);
    Body body = {0, Cones(given.discs, given.intervals, given.balls), given.discs,
                 given.intervals, p, {}, {}, {}, {}};
    const auto ordered = [&](const double *from, int rows, std::vector<double> &to) {
        for (int i = 0; i < rows; ++i)
            for (int64_t column : given.column) to.push_back(from[i * nv + column]);
    };
    std::copy(asked->centre, asked->centre + 6, body.centre);
    ordered(asked->map, 6, body.X);
    ordered(asked->rows, p, body.H);
    ordered(asked->start, 1, body.start);
    int64_t supports = -1;
    const Task task = {&body, int(asked->half), asked->tolerance};
    Farthest(body, p).search({task}, [&](const Search &own, bool done) {
        bounds[0] = own.low, bounds[1] = own.high;
        std::copy(own.best, own.best + 6, screw);
        if (done) supports = own.supports;
    });
    return supports;
}
