// Cone programmes that share G and H, and closest points of sets that share their rows,
// several in parallel.
#include "../kernels.h"
#include "block.h"
#include "closest.h"
#include "dual_newton.h"

using namespace LANE_SPACE;

namespace {

// required gap, relative to the energy and to the energy without clearance.  A few more
// Newton steps then aim at a smaller gap; their result is used where they reach it.
// Each of these steps squares the error, so that the strains become exact except for
// rounding
constexpr double ENERGY = 1e-11, WITHOUT_CLEARANCE = 1e-17;
constexpr double POLISHED = 1e-4;  // smaller gap as a share of the required one
constexpr int STEPS_POLISHING = 6;

// The problems of a block, read from arrays and written to arrays.  Each problem is
// scaled so that the largest entries are of order 1.
class Scaled {
public:
    Scaled(const ConeProblems &given, Programme &q) : problems(given), q(q) {
        const int r = int(problems.r), p = int(problems.p), nu = q.cones.nu;
        q.r = r, q.p = p, q.loaded = true;
        for (int c = 0; c < nu; ++c) {
            double square = 0.0;
            for (int i = 0; i < r; ++i) square += G(i, c) * G(i, c);
            largest = std::max(largest, square);
        }
        for (int i = 0; i < p; ++i)
            for (int c = 0; c < nu; ++c)
                q.M[r + i][c] = real(problems.H[i * nu + q.cones.column[c]]);
    }

    // Read the problems of a block.  Return their scaled energy without clearance.
    Real read(const Block &block) {
        const int r = q.r, p = q.p, nu = q.cones.nu;
        for (int i = 0; i < r; ++i) q.h[i] = block.read(problems.h, r, i);
        for (int i = 0; i < p; ++i) q.e[i] = block.read(problems.k, p, i);
        Real square = larger(inner(q.h.data(), q.h.data(), r), real(largest));
        for (int c = 0; c < nu; ++c) {
            q.d[c] = block.read(problems.d, nu, q.cones.column[c]);
            square = larger(magnitude(q.d[c]), square);
        }
        size = root(larger(square, real(1e-300)));
        const Real over = 1.0 / size;
        for (int i = 0; i < r; ++i) {
            q.h[i] *= over;
            for (int c = 0; c < nu; ++c) q.M[i][c] = G(i, c) * over;
        }
        for (int c = 0; c < nu; ++c) q.d[c] *= over * over;
        std::fill(q.u.begin(), q.u.end(), Real{});
        std::fill(q.y.begin(), q.y.end(), Real{});
        return 0.5 * inner(q.h.data(), q.h.data(), r);
    }

    void write(const Block &block, Whole where, double *u, double *y) const {
        const int r = q.r, rows = q.r + q.p, nu = q.cones.nu;
        for (int c = 0; c < nu; ++c) block.write(u, nu, q.cones.column[c], q.u[c], where);
        for (int i = 0; i < rows; ++i)
            block.write(y, rows, i, q.y[i] * (i < r ? size : size * size), where);
    }

private:
    double G(int row, int c) const {
        return problems.G[row * q.cones.nu + q.cones.column[c]];
    }
    const ConeProblems &problems;
    Programme &q;
    double largest = 0.0;
    Real size;
};

// Shorten positions that rounding has moved out of their cones.
void into_cones(Programme &q) {
    q.cones.each([&](auto size, int, int at) {
        const Real length = root(inner(&q.u[at], &q.u[at], size));
        for (int i = at; i < at + size; ++i) q.u[i] /= larger(length, real(1.0));
    });
}

}  // namespace

void minimise_all(const ConeProblems &given, double *u, double *y) {
    const Cones cones(given.starts, int(given.cones));
    const int rows = int(given.r + given.p);
    Programme q(cones, rows);
    Solver solver(cones, rows);
    Scaled scaled(given, q);
    // problems that Newton's method did not solve; the interior-point method solves
    // them in full blocks
    std::vector<int64_t> left;
    in_blocks(all_of(given.count), [&](const Block &block, Whole pending) {
        const Real without = scaled.read(block);
        const Real tight = POLISHED * WITHOUT_CLEARANCE * without;
        const Whole done = solver.newton_alone(q, POLISHED * ENERGY, tight, pending);
        scaled.write(block, pending & done, u, y);
        for (int l = 0; l < LANES; ++l)
            if (pending[l] && !done[l]) left.push_back(block.point[l]);
        return Whole{};
    });
    in_blocks(left, [&](const Block &block, Whole pending) {
        const Real without = scaled.read(block), absolute = WITHOUT_CLEARANCE * without;
        solver.interior_point(q, NEAR_WITHOUT_CLEARANCE * without, NEAR, pending);
        into_cones(q);
        const Whole done = solver.dual_newton(
            q, STEPS, FIRST_SIGMA, ENERGY, absolute, pending);
        scaled.write(block, done, u, y);
        const Whole polished = solver.dual_newton(
            q, STEPS_POLISHING, FIRST_SIGMA, POLISHED * ENERGY, POLISHED * absolute, done);
        scaled.write(block, polished, u, y);
        const Whole others = pending & ~done;
        if (!any(others)) return Whole{};
        solver.interior_point(q, absolute, ENERGY, others);
        into_cones(q);
        scaled.write(block, others, u, y);
        return Whole{};
    });
}

void closest_points(const Projections &given, double *u, int64_t *solved) {
    const Cones cones(given.starts, int(given.cones));
    const int p = int(given.p), nu = cones.nu;
    Programme q(cones, p);
    Solver solver(cones, p);
    Row from(nu), kept(nu);
    q.r = 0, q.p = p;
    for (int i = 0; i < p; ++i)
        for (int c = 0; c < nu; ++c) q.M[i][c] = real(given.rows[i * nu + cones.column[c]]);
    in_blocks(all_of(given.count), [&](const Block &block, Whole pending) {
        for (int c = 0; c < nu; ++c) {
            const int64_t column = cones.column[c];
            q.u[c] = block.read(u, nu, column);
            from[c] = block.read(given.from, nu, column);
            kept[c] = block.read(given.kept, nu, column);
        }
        const Whole done = solver.closest(q, from, kept, pending);
        for (int c = 0; c < nu; ++c) block.write(u, nu, cones.column[c], q.u[c], done);
        for (int l = 0; l < LANES; ++l)
            if (pending[l]) solved[block.point[l]] = done[l] ? 1 : 0;
        return Whole{};
    });
}
