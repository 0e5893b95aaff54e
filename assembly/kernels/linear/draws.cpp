// Problem (22) for many right sides h at one posture, several side by side.  The
// certificate is from matrices made once of the columns before any elimination.
//
// ========  ========  =================================================================
// G, h      (r, nu)   strains by clearances, shared, and by each draw's errors
// u, y                clearances, multipliers of the springs
// cones     (nu, r)   generalised force of y on each clearance, before elimination
// d         (nu,)     and what it carries in the tight robot under its loads
// gram      (r, r)    the springs' complementary energy is y.gram y / 2
// ========  ========  =================================================================
#include "../kernels.h"
#include "../solvers/block.h"
#include "../solvers/dual_newton.h"

using namespace LANE_SPACE;

// assembly/solvers/conic.py; the solvers stop at a fraction of the accepted gap
constexpr double GAP = 1e-8, GAP_WITHOUT_CLEARANCE = 1e-12, STOP = 1e-2, INWARDS = 0.8;
constexpr int PROJECTIONS = 30;
enum { SOLVED, UNCERTIFIED };

namespace {

class Draws {
public:
    Draws(const Reduced &shared, const double *h, DrawEnergies &out)
        : s(shared), given(h), out(out), nu(int(s.nu)), r(int(s.r)),
          cones(s.starts, int(s.cones)), q(cones, r), solver(cones, r), h(r), y(r),
          left(r), loaded(shared.loaded) {
        q.loaded = loaded;
        for (int c = 0; c < nu; ++c) {
            double squares = 0.0;
            for (int i = 0; i < r; ++i) squares += s.Gt[c * r + i] * s.Gt[c * r + i];
            norm = std::max(norm, std::sqrt(squares));
            if (loaded) norm = std::max(norm, std::sqrt(std::abs(s.d[c])));
        }
    }

    // Draws inside the zone, and those that Newton's method solves alone; returns the
    // lanes that it leaves.
    Whole begin(const Block &block, Whole asked) {
        read(block);
        const Whole within = loaded ? Whole{} : inside(asked);
        Whole solved = loaded ? Whole{} : asked & ((without == 0.0) | within);
        for (int i = 0; i < r; ++i) y[i] = solved ? Real{} : h[i];
        for (Real &own : q.u) own = within ? own : Real{};
        if (nu && any(asked & ~solved)) {
            const Whole alone =
                solver.newton_alone(q, STOP * GAP, absolute, asked & ~solved);
            for (int i = 0; i < r; ++i) y[i] = alone ? q.y[i] * size : y[i];
            solved |= alone;
        } else {
            solved = asked;
        }
        write(block, solved);
        return asked & ~solved;
    }

    // The others.
    void finish(const Block &block, Whole asked) {
        read(block);
        std::fill(q.u.begin(), q.u.end(), Real{});
        Real near = NEAR_WITHOUT_CLEARANCE * 0.5 * inner(q.h.data(), q.h.data(), r);
        near += (NEAR + NEAR_WITHOUT_CLEARANCE) * bent;
        solver.interior_then_newton(q, STOP * GAP, absolute, near, asked);
        for (int i = 0; i < r; ++i) y[i] = q.y[i] * size;
        write(block, asked);
    }

private:
    const Reduced &s;
    const double *given;
    DrawEnergies &out;
    const int nu, r;
    const Cones cones;
    Programme q;
    Solver solver;
    Row h, y, left;
    const bool loaded;
    double norm = 0.0;
    Real without, size, absolute, bent;

    // The draws' right sides, and the problems in numbers of order 1.
    void read(const Block &block) {
        for (int i = 0; i < r; ++i) h[i] = block.read(given, r, i);
        without = 0.5 * inner(h.data(), h.data(), r);
        size = larger(root(2.0 * without), real(norm));
        const Real over = 1.0 / (size > 0.0 ? size : real(1.0));
        for (int i = 0; i < r; ++i) {
            q.h[i] = h[i] * over;
            for (int c = 0; c < nu; ++c)
                q.M[i][c] = s.Gt[cones.column[c] * r + i] * over;
        }
        absolute = STOP * GAP_WITHOUT_CLEARANCE * without * over * over;
        bent = s.stored * over * over;
        absolute += STOP * (GAP + GAP_WITHOUT_CLEARANCE) * bent;
        for (int c = 0; loaded && c < nu; ++c)
            q.d[c] = s.d[cones.column[c]] * over * over;
    }

    // (r columns of a shared matrix, one row a clearance) times x.
    Real product(const double *matrix, int c, const Row &x) const {
        const double *row = matrix + cones.column[c] * r;
        Real total = {};
        for (int i = 0; i < r; ++i) total += row[i] * x[i];
        return total;
    }

    // Lanes with clearances q.u within their cones and G u = -h: zero energy.  y = h may
    // prove that there are none; else alternating projections.
    Whole inside(Whole asked) {
        Real worth = 2.0 * without;
        cones.each([&](auto size, int, int at) {
            Real squares = {};
            for (int c = at; c < at + size; ++c) {
                const Real force = product(s.Gt, c, h);
                squares += force * force;
            }
            worth -= root(squares);
        });
        // written so that NaN is none
        Whole going = asked & (worth <= 0.0) & (without > 0.0), found = {};
        std::fill(q.u.begin(), q.u.end(), Real{});
        for (int turn = 0; turn < PROJECTIONS && any(going); ++turn) {
            multiply(q.M.rows(), r, q.u.data(), nu, left.data());
            for (int i = 0; i < r; ++i) left[i] = left[i] * size + h[i];
            for (int c = 0; c < nu; ++c)
                q.u[c] -= going ? product(s.inverse, c, left) : Real{};
            Whole outside = {};
            cones.each([&](auto size, int, int at) {
                const Real squares = inner(&q.u[at], &q.u[at], size);
                const Whole out = going & (squares > 1.0);
                outside |= out;
                // a little further inside, so that the projections end
                const Real shorter = out ? INWARDS / root(squares) : real(1.0);
                for (int c = at; c < at + size; ++c) q.u[c] *= shorter;
            });
            found |= going & ~outside;
            going &= outside;
        }
        return found;
    }

    // Answers and their certificates.
    void write(const Block &block, Whole where) {
        multiply(q.M.rows(), r, q.u.data(), nu, left.data());
        for (int i = 0; i < r; ++i) left[i] = left[i] * size + h[i];
        Real energy = 0.5 * inner(left.data(), left.data(), r), bound, cost = {};
        const Real slip = s.slip * root(inner(y.data(), y.data(), r)) + s.slack;
        for (int i = 0; i < r; ++i) {
            Real along = {};
            for (int l = 0; l < r; ++l) along += s.gram[i * r + l] * y[l];
            cost += y[i] * along;
        }
        Real most = {}, gains = {}, factor = real(1.0);  // of clearances
        cones.each([&](auto size, int, int at) {
            Real squares = {}, work = {};
            for (int c = at; c < at + size; ++c) {
                Real force = product(s.forces, c, y);
                if (loaded) force += s.d[cones.column[c]], work += force * q.u[c];
                squares += force * force;
            }
            most += root(squares);
            gains += larger(root(squares) - work, Real{});
        });
        if (loaded) {
            // strains that balance y, and what clearances could still gain
            const Real off = energy - inner(left.data(), y.data(), r) + 0.5 * cost;
            energy += s.stored;
            bound = energy - larger(off, Real{}) - gains - slip;
        } else {
            const Real worth = inner(h.data(), y.data(), r) - slip - most;
            // any multiple of y proves a bound: the best one, zero inside a zone
            factor = ((worth > 0.0) & (cost > 0.0)) ? worth / cost : Real{};
            bound = 0.5 * factor * factor * cost;
        }
        // written so that NaN fails
        const Whole proved =
            energy - bound <= GAP * energy + GAP_WITHOUT_CLEARANCE * (without + s.stored);
        for (int c = 0; c < nu; ++c)
            block.write(out.u, nu, cones.column[c], q.u[c], where);
        for (int i = 0; i < r; ++i) block.write(out.y, r, i, factor * y[i], where);
        block.write(out.energy, 1, 0, energy, where);
        block.write(out.bound, 1, 0, bound, where);
        for (int l = 0; l < LANES; ++l)
            if (where[l])
                out.outcome[block.point[l]] = proved[l] ? SOLVED : UNCERTIFIED;
    }
};

}  // namespace

// Draws that need the interior point stand together: no lane waits.
void least_energies(
    const Reduced &reduced, const double *h, int64_t count, DrawEnergies &out) {
    Draws draws(reduced, h, out);
    std::vector<int64_t> others;
    in_blocks(all_of(count), [&](const Block &block, Whole pending) {
        const Whole unsolved = draws.begin(block, pending);
        for (int l = 0; l < LANES; ++l)
            if (unsolved[l]) others.push_back(block.point[l]);
        return Whole{};
    });
    in_blocks(others, [&](const Block &block, Whole pending) {
        draws.finish(block, pending);
        return Whole{};
    });
}
