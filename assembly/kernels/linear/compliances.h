// The classical compliance of the platform at several postures in parallel.
//
// Under a unit wrench e on the platform the closures carry the wrench
// lambda = lambda_e + Z^T mu.  lambda_e balances e: lambda does no work on any free
// motion.  mu minimises the energy of the springs,
//
//     |y|^2 / 2,   y = B e + Y^T mu,    Y = Z A_y,
//
// where B e are the deformations of the springs under e and lambda_e.  By Castigliano's
// theorem the compliance C is the sum of y y^T over the springs, with y for the six
// unit wrenches.  No compliances are added before free motions and springs are
// eliminated.  The result is therefore as accurate as that of problem (22).
#pragma once

#include "reduction.h"

namespace LANE_SPACE {

enum { COMPLIANT, LOOSE, UNCLEAR };
// work of a unit wrench on a unit free motion that counts as zero
constexpr double STILL = 1e-9;

// Solver of blocks of points of one robot, in sequence.
class Compliance : public Reduction {
public:
    using Reduction::Reduction;

    Whole comply(
        const Points &points, const Block &block, Whole requested, Compliances &out);
};

// Compute the deformations y of the springs under six unit wrenches on the platform.
// It solves the requested lanes that have the same ranks as the first of them.  Return
// the requested lanes that remain.
inline Whole Compliance::comply(
    const Points &points, const Block &block, Whole requested, Compliances &out) {
    const auto settle = [&](Whole where, int64_t status) {
        for (int l = 0; l < LANES; ++l)
            if (where[l]) out.status[block.point[l]] = status;
        return ~where;
    };
    Whole others = requested;
    read(points, block);
    const Ranks ranks = eliminate(tolerance(points, block), requested);
    others &= settle(ranks.unclear, UNCLEAR);
    if (!any(requested = ranks.same)) return others;
    const int rank = ranks.free, r = ranks.springs;
    Row closing(m), deformation(6 * ng), on(6 * np);
    for (int row = 0; row < 6; ++row) {
        const Whole loose = balance_free_motions(rank, row, STILL, closing);
        others &= settle(requested & loose, LOOSE);
        if (!any(requested &= ~loose)) return others;
        for (int g = 0; g < np; ++g) part(closing.data(), g, &on[6 * g]);
        for (int g = 0; g < ng; ++g)
            for (int b = 0; b < 6; ++b) {
                Real total = s.group_on_path[g] * L[6 * g + row][b];
                for (int a = 0; a < 6; ++a)
                    total += L[6 * g + a][b] * on[6 * s.group_pattern[g] + a];
                deformation[6 * g + b] = total;
            }
        minimise_spring_energy(r, deformation, closing);
        for (int g = 0; g < np; ++g) part(closing.data(), g, &on[6 * g]);
        for (int c = 0; c < s.ny; ++c) {
            const int64_t j = s.spring_frame[c];
            Real total = s.on_path[j] * elastic[c][row];
            for (int a = 0; a < 6; ++a)
                total += elastic[c][a] * on[6 * s.pattern_of[j] + a];
            block.write(out.springs, 6 * s.ny, row * s.ny + c, total, requested);
        }
    }
    return others & settle(requested, COMPLIANT);
}

}  // namespace LANE_SPACE
