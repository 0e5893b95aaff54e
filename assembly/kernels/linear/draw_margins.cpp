// Problem (21) for many right sides w at one posture, several side by side: B is shared.
#include "../kernels.h"
#include "../solvers/block.h"
#include "../solvers/least_factor.h"

using namespace LANE_SPACE;

void least_margins(const SharedRows &given, DrawMargins &out) {
    const Cones cones(given.starts, int(given.cones));
    const int p = int(given.p), nu = cones.nu;
    Table B(p, nu);
    for (int i = 0; i < p; ++i)
        for (int c = 0; c < nu; ++c) B[i][c] = real(given.rows[i * nu + cones.column[c]]);
    Programme q(cones, p);
    Solver solver(cones, p);
    Row w(p), gradient(nu);
    in_blocks(all_of(given.count), [&](const Block &block, Whole pending) {
        for (int i = 0; i < p; ++i) {
            w[i] = block.read(given.right, p, i);
            std::copy(B[i], B[i] + nu, q.M[i]);
        }
        const Real size = root(inner(w.data(), w.data(), p));
        const Whole some = pending & (size > 0.0);  // others need no clearance
        Real reach = real(1.0), most = real(1.0);
        if (any(some)) {
            first_along(q, p, w.data(), some ? size : real(1.0));
            gradient = reach_along_first(solver, q, p, some, reach, most);
        }
        const Real margin = some ? size / reach : Real{};
        const Real bound = some ? size / most : Real{};
        // written so that NaN fails
        const Whole proved =
            ~some | ((reach > 0.0) & (margin - bound <= MARGIN_GAP * margin));
        block.write(out.margin, 1, 0, proved ? margin : real(NAN), pending);
        block.write(out.bound, 1, 0, bound, pending);
        for (int i = 0; i < p; ++i) {
            const Real own = inner(B[i], gradient.data(), nu) / most;
            block.write(out.multipliers, p, i, some ? own : Real{}, pending);
        }
        return Whole{};
    });
}
