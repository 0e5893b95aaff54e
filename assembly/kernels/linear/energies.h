// Problem (22) at several postures in parallel, from the poses of the frames to the
// certified solution.
//
// assembly/linear/reference solves the points that this code cannot solve; the outcome
// contains the reason.  A point is solved only if its certificate proves the required
// gap.  The certificate is computed from the wrenches, on the problem before any
// elimination.
#pragma once

#include "loads.h"

namespace LANE_SPACE {

// accepted gap, relative to the energy and to the energy without clearance:
// assembly/solvers/conic.py
constexpr double GAP = 1e-8, GAP_WITHOUT_CLEARANCE = 1e-12;
// [rad, lengths] accepted closure error of a solution
constexpr double OPEN = 1e-11;
// outcome codes; assembly/linear/energy.py has the same
enum Outcome { NEWTON, INTERIOR, RIGID, AMBIGUOUS, UNCERTIFIED, BOUNDED, DRIVEN };
// gap at which the solvers stop, as a share of the accepted gap
constexpr double STOP = 3e-3;

// Solver of blocks of points of one robot, in sequence.
class Energies : public Loaded {
public:
    Energies(const Robot &s, const Points &points)
        : Loaded(s, points), postpones(!points.posture_per_point), solver(cones, m), v(m),
          G(m, nu), springless(m, m) {}

    // If all points have one posture, points that need the interior-point method are
    // solved later, in full blocks.  They are solved at once if all points of a block
    // need it, because no lane is then unused.
    bool postpones;
    std::vector<int64_t> waiting;

    Whole solve(
        const Points &points, const Block &block, Whole requested, Solutions &out);

private:
    Solver solver;
    Row v;  // G u + h
    // quantities that are stored while the posture does not change
    int64_t prepared = -1;  // value of `changes` when they were computed
    // springless: orthonormal rows of Z to which no spring contributes
    Table G, springless;
    Real largest_column;    // largest square of the norm of a column of G
    Whole rigid_clearance;  // lanes where clearances contribute to such rows

    void prepare(int r, int count);
    Whole rigid_clearances(int rank, int count);
    Whole rigid_rows(int rank, int count, Real tolerance);
    bool waits(Whole left, Whole requested) const {
        return postpones && any(requested & ~left);
    }
    Whole minimise(int r, Whole requested);
    Row least_multipliers(int r, int count);
    void write_springs(
        const Row &grouped, const Block &block, double *elastic, Whole where);
    struct Proof { Real gain, cost; };
    Proof complementary(const Row &motions, const Row &multipliers);
    Real loaded_gap(
        int r, const Row &grouped, const Row &motions, const Row &multipliers);
};

// Return the lanes where clearances contribute to rows to which no spring contributes.
inline Whole Energies::rigid_clearances(int rank, int count) {
    Array<Real> most(np), sizes(nu);
    for (int g = 0; g < np; ++g)
        for (int i = rank; slot[g] >= 0 && i < count; ++i)
            for (int a = 0; a < 6; ++a)
                most[g] = larger(magnitude(parts[i][6 * slot[g] + a]), most[g]);
    Real worst = {};
    for (int c = 0; c < nu; ++c)
        for (int a = 0; a < 6; ++a)
            sizes[c] = larger(magnitude(clearance[c][a]), sizes[c]);
    const Real limit = largest_clearance() * (NOISE / CLEAR);
    for (int c = 0; c < nu; ++c) {
        const int64_t g = s.pattern_of[s.cone_frame[c]];
        const Whole near = 6.0 * sizes[c] * most[g] > limit;
        if (!any(near)) continue;  // nearly all columns are certainly below the limit
        for (int i = rank; i < count; ++i) {
            const Real total = enters(c, parts[i] + 6 * slot[g]);
            worst = near ? larger(magnitude(total), worst) : worst;
        }
    }
    return worst > limit;
}

// Return the lanes where clearances or errors contribute to rows to which no spring
// contributes.
inline Whole Energies::rigid_rows(int rank, int count, Real tolerance) {
    Whole rigid = rigid_clearance;
    const Real allowed = 1e-12 / CLEAR + tolerance * largest_error;
    for (int i = rank; i < count; ++i)  // the comparison makes NaN rigid
        rigid |= ~(magnitude(inner(known.data(), Z[i], m)) <= allowed);
    return rigid;
}

// Compute the quantities that depend only on the posture, and G and h.
inline void Energies::prepare(int r, int count) {
    if (!posture.empty() && prepared == changes) return right_sides(r);
    prepared = changes;
    rigid_clearance = rigid_clearances(r, count);
    small_problem(r);
    largest_column = Real{};
    for (int i = 0; i < r; ++i) std::copy(programme.M[i], programme.M[i] + nu, G[i]);
    for (int c = 0; c < nu; ++c) {
        Real column = {};
        for (int i = 0; i < r; ++i) column += G[i][c] * G[i][c];
        largest_column = larger(column, largest_column);
    }
    for (int i = 0; i < count - r; ++i) {
        Real *row = springless[i];
        std::copy(Z[r + i], Z[r + i] + m, row);
        for (int l = 0; l < i; ++l) {
            const Real along = inner(springless[l], row, m);
            for (int a = 0; a < m; ++a) row[a] -= along * springless[l][a];
        }
        const Real over = 1.0 / root(inner(row, row, m));
        for (int a = 0; a < m; ++a) row[a] *= over;
    }
}

// Minimise |G u + h|^2 / 2 - d.u.  Compute u, v = G u + h and the multipliers y.
// Newton's method alone converges if all cone constraints are active.  In the other
// lanes Newton's method follows the interior-point method, unless these points are
// solved later.  Return the outcomes.
inline Whole Energies::minimise(int r, Whole requested) {
    Programme &q = programme;
    const Real square = inner(q.h.data(), q.h.data(), r);
    Real size = larger(largest_column, square);
    Whole deformed = square > 0.0;
    for (int c = 0; loaded && c < nu; ++c) {
        size = larger(magnitude(q.d[c]), size);
        deformed |= q.d[c] != 0.0;
    }
    size = root(size);
    std::fill(q.u.begin(), q.u.end(), Real{});
    std::copy(q.h.begin(), q.h.begin() + r, q.y.begin());
    std::copy(q.h.begin(), q.h.begin() + r, v.begin());
    requested &= deformed;
    if (nu == 0 || !any(requested)) return Whole{};
    const Real over = 1.0 / (deformed ? size : real(1.0));
    for (int i = 0; i < r; ++i) {
        q.h[i] *= over;
        for (int c = 0; c < nu; ++c) q.M[i][c] = G[i][c] * over;
    }
    const Real without = 0.5 * inner(q.h.data(), q.h.data(), r);
    Real absolute = STOP * GAP_WITHOUT_CLEARANCE * without;
    Real near = NEAR_WITHOUT_CLEARANCE * without;
    if (loaded) {
        const Real scaled = stored * over * over;
        absolute += STOP * (GAP + GAP_WITHOUT_CLEARANCE) * scaled;
        near += (NEAR + NEAR_WITHOUT_CLEARANCE) * scaled;
        for (int c = 0; c < nu; ++c) q.d[c] *= over * over;
    }
    const Whole left =
        requested & ~solver.newton_alone(q, STOP * GAP, absolute, requested);
    if (!waits(left, requested))
        solver.interior_then_newton(q, STOP * GAP, absolute, near, left);
    multiply(q.M.rows(), r, q.u.data(), nu, v.data());
    for (int i = 0; i < r; ++i) {
        v[i] = (v[i] + q.h[i]) * size;
        q.y[i] = requested ? q.y[i] * size : q.y[i];
        q.h[i] *= size;
    }
    for (int c = 0; loaded && c < nu; ++c) q.d[c] *= size * size;
    return left ? whole(INTERIOR) : whole(NEWTON);
}

// Return the multipliers of the closures; if they are not unique, those of least norm.
inline Row Energies::least_multipliers(int r, int count) {
    Row multipliers = loaded ? closure_wrench : Row(m);
    combine(Z.data(), r, programme.y.data(), m, multipliers.data());
    for (int i = 0; i < count - r; ++i) {
        const Real *row = springless[i];
        const Real along = inner(row, multipliers.data(), m);
        for (int a = 0; a < m; ++a) multipliers[a] -= along * row[a];
    }
    return multipliers;
}

// Write the deformation of every spring from those of its group's equivalent springs.
inline void Energies::write_springs(
    const Row &grouped, const Block &block, double *elastic, Whole where) {
    Triangle rows(6, widest);
    for (int g = 0; g < ng; ++g) {
        const int count = spring_group(g, rows);
        triangulate(rows, 6, count, Real{}, Real{}, -1.0, count);
        Row strains(count);
        std::copy(&grouped[6 * g], &grouped[6 * g] + 6, strains.begin());
        Real *x = strains.data();
        turn_all(rows, 6, count, &x, 1);
        for (int64_t c = s.groups[g]; c < s.groups[g + 1]; ++c) {
            Real strain = strains[c - s.groups[g]];
            if (loaded) strain += load_strain[c];
            block.write(elastic, s.ny, s.spring_order[c], strain, where);
        }
    }
    for (int64_t c = s.groups[ng]; loaded && c < s.ny; ++c)
        block.write(elastic, s.ny, s.spring_order[c], load_strain[int(c)], where);
}

// Compute the bound that the multipliers prove on the problem before elimination: for
// any factor f the energy is at least f gain - f^2 cost / 2.
inline Energies::Proof Energies::complementary(const Row &motions, const Row &multipliers) {
    Real gain = -inner(multipliers.data(), known.data(), m), cost = {};
    Row at_platform(6 * np);
    for (int g = 0; g < np; ++g) part(multipliers.data(), g, &at_platform[6 * g]);
    const auto on = [&](int64_t j) { return &at_platform[6 * s.pattern_of[j]]; };
    for (int c = 0; c < s.ny; ++c) {
        Real force = {};
        for (int a = 0; a < 6; ++a) force += elastic[c][a] * on(s.spring_frame[c])[a];
        cost += force * force;
    }
    cones.each([&](auto size, int, int at) {
        Real squares = {};
        for (int i = at; i < at + size; ++i) {
            const int c = int(cones.column[i]);
            const Real force = enters(c, on(s.cone_frame[c]));
            squares += force * force;
        }
        gain -= root(squares);
    });
    for (int c = 0; c < nq; ++c) {
        Real force = {};
        for (int a = 0; a < 6; ++a) force += motion[c][a] * on(s.free_frame[c])[a];
        gain -= magnitude(force * motions[c]);
    }
    return {gain, cost};
}

// Return the difference between the objective, energy minus work, and the lower bound
// that the multipliers prove on the problem before elimination.  It is |y - s|^2 / 2,
// with the strains s of the springs in balance with the wrenches, plus the largest
// additional work on the clearances and on the free motions.  Loads change both y and s
// by t, which cancels.
inline Real Energies::loaded_gap(
    int r, const Row &grouped, const Row &motions, const Row &multipliers) {
    Row closing(m);
    combine(Z.data(), r, programme.y.data(), m, closing.data());
    Row on = on_patterns(closing);
    Real gap = 0.5 * inner(v.data(), v.data(), r);
    for (int g = 0; g < ng; ++g)
        for (int a = 0; a < 6; ++a)
            gap -= inner(L[6 * g + a], &grouped[6 * g], 6) * on[6 * s.group_pattern[g] + a];
    for (int c = 0; c < s.ny; ++c) {
        const Real force = along(elastic[c], &on[6 * s.pattern_of[s.spring_frame[c]]]);
        gap += 0.5 * force * force;
    }
    gap = larger(gap, Real{});
    on = on_patterns(multipliers);
    cones.each([&](auto size, int, int at) {
        Real squares = {}, work = {};
        for (int i = at; i < at + size; ++i) {
            const int c = int(cones.column[i]);
            const Real force =
                clearance_load[c] + enters(c, &on[6 * s.pattern_of[s.cone_frame[c]]]);
            squares += force * force, work += force * programme.u[i];
        }
        gap += larger(root(squares) - work, Real{});
    });
    for (int c = 0; c < nq; ++c) {
        const Real work =
            motions[c] * (drive[c] + along(motion[c], &on[6 * s.pattern_of[s.free_frame[c]]]));
        gap += magnitude(work) - work;
    }
    return gap;
}

// Solve the requested lanes that have the same ranks as the first of them, and write
// their results.  Return the requested lanes that remain.
inline Whole Energies::solve(
    const Points &points, const Block &block, Whole requested, Solutions &out) {
    const auto settle = [&](Whole where, int64_t outcome) {
        for (int l = 0; l < LANES; ++l)
            if (where[l]) out.outcome[block.point[l]] = outcome;
    };
    const Whole all = requested;
    const Ranks ranks = read_and_eliminate(points, block, requested);
    settle(ranks.unclear, AMBIGUOUS);
    const Whole settled = ranks.unclear | ranks.same;
    if (!any(requested = ranks.same)) return all & ~settled;
    const int rank = ranks.free, count = m - rank, r = ranks.springs;
    prepare(r, count);
    const Whole rigid = rigid_rows(r, count, tolerance(points, block));
    settle(requested & rigid, RIGID);
    if (!any(requested &= ~rigid)) return all & ~settled;
    Real without = 0.5 * inner(programme.h.data(), programme.h.data(), r);
    if (loaded) {
        const Whole driven = bring_into_balance(points, block, rank, r);
        settle(requested & driven, DRIVEN);
        if (!any(requested &= ~driven)) return all & ~settled;
        without += stored;
    }
    const Whole solved = minimise(r, requested);
    const Whole open = requested & (solved == whole(INTERIOR));
    if (waits(open, requested)) {
        for (int l = 0; l < LANES; ++l)
            if (open[l]) waiting.push_back(block.point[l]);
        if (!any(requested &= ~open)) return all & ~settled;
    }
    // solution of the full problem from that of the small one
    Row multipliers = least_multipliers(r, count);
    for (int i = 0; loaded && i < r; ++i) v[i] -= strain_error[i];
    const Row grouped = spring_strains(r, v);
    Row moved = moved_by(grouped);
    for (int c = 0; loaded && c < s.ny; ++c) {
        const int64_t j = s.spring_frame[c];
        Real step[6];
        for (int a = 0; a < 6; ++a) step[a] = elastic[c][a] * load_strain[c];
        move(s.pattern_of[j], s.on_path[j], step, moved);
    }
    const Row motions = least_motions(rank, moved);
    Whole outcome = solved;
    for (int c = 0; c < nq; ++c) {
        outcome = magnitude(motions[c]) > s.free_bound[c] ? whole(BOUNDED) : outcome;
        const int64_t j = s.free_frame[c];
        Real step[6];
        for (int a = 0; a < 6; ++a)
            step[a] = motion[c][a] * motions[c];
        move(s.pattern_of[j], s.on_path[j], step, moved);
    }
    Real residual = {}, slip = {};
    for (int a = 0; a < m; ++a) {
        residual = larger(magnitude(moved[a]), residual);
        slip += magnitude(moved[a] * multipliers[a]);
    }
    Real energy = 0.5 * inner(v.data(), v.data(), r), bound, work = {}, factor = real(1.0);
    if (loaded) {
        energy += stored + inner(v.data(), strain_error.data(), r);
        bound = energy - loaded_gap(r, grouped, motions, multipliers) - slip;
        // t is orthogonal to the closure columns of the springs; `known` is the error
        // that they have to close
        work = 2.0 * stored + inner(programme.d.data(), programme.u.data(), nu) +
               inner(closure_wrench.data(), known.data(), m);
    } else {
        const Proof proof = complementary(motions, multipliers);
        // any multiple of the multipliers proves a bound; `factor` gives the best one,
        // which is zero where no deformation is needed
        const Real gain = proof.gain - slip, cost = proof.cost;
        const Whole positive = (gain > 0.0) & (cost > 0.0);
        factor = positive ? gain / cost : Real{};
        bound = 0.5 * factor * factor * cost;
    }
    // both comparisons are false for NaN
    const Real allowed =
        GAP * energy + GAP_WITHOUT_CLEARANCE * (without + magnitude(work));
    const Whole proved = (energy - bound <= allowed) & (residual <= OPEN);
    outcome = (outcome == whole(BOUNDED)) | proved ? outcome : whole(UNCERTIFIED);
    for (int l = 0; l < LANES; ++l)
        if (requested[l]) out.outcome[block.point[l]] = outcome[l];
    block.write(out.energy, 1, 0, energy, requested);
    block.write(out.bound, 1, 0, bound, requested);
    block.write(out.without_clearance, 1, 0, without, requested);
    block.write(out.work, 1, 0, work, requested);
    block.write(out.residual, 1, 0, residual, requested);
    for (int a = 0; a < 6; ++a)
        block.write(
            out.platform_screw, 6, a, a < 3 ? screw[a] : screw[a] * s.size, requested);
    for (int c = 0; c < nu; ++c)
        block.write(out.clearances, nu, cones.column[c], programme.u[c], requested);
    for (int c = 0; c < nq; ++c) block.write(out.motions, nq, c, motions[c], requested);
    for (int a = 0; a < m; ++a)
        block.write(out.multipliers, m, a, factor * multipliers[a], requested);
    if (out.elastic) write_springs(grouped, block, out.elastic, requested);
    return all & ~settled;
}

}  // namespace LANE_SPACE
