// Farthest points of sets {|u_k| <= 1 for each cone k, H u = e} that share H, along
// many directions, several in parallel.
#include "../kernels.h"
#include "block.h"
#include "cones.h"

using namespace LANE_SPACE;

void farthest_points(const Directions &requested, FarthestPoints &out) {
    const Cones cones(requested.starts, int(requested.cones));
    const int p = int(requested.p), nu = cones.nu;
    Programme q(cones, p);
    Solver solver(cones, p);
    q.r = 0, q.p = p, q.loaded = true;
    for (int i = 0; i < p; ++i)
        for (int c = 0; c < nu; ++c)
            q.M[i][c] = real(requested.rows[i * nu + cones.column[c]]);
    in_blocks(all_of(requested.count), [&](const Block &block, Whole pending) {
        for (int c = 0; c < nu; ++c)
            q.d[c] = block.read(requested.directions, nu, cones.column[c]);
        for (int i = 0; i < p; ++i) q.e[i] = block.read(requested.right, p, i);
        const Real tolerance = block.read(requested.tolerance, 1, 0);
        const Whole solved = solver.interior_point(q, tolerance, 0.0, pending);
        for (int c = 0; c < nu; ++c)
            block.write(out.points, nu, cones.column[c], q.u[c], pending);
        for (int i = 0; i < p; ++i)
            block.write(out.multipliers, p, i, q.y[i], pending);
        for (int l = 0; l < LANES; ++l)
            if (pending[l]) out.solved[block.point[l]] = solved[l] ? 1 : 0;
        return Whole{};
    });
}
