// Elimination of the free motions and of the springs at several postures in parallel.
// It leaves a small cone programme, and computes the solution of the full problem from
// that of the small one.  assembly/linear/reference/reduction.py does the same in
// another order.
//
// Vectors are stored as rows.  One function, a Householder triangulation with pivoting,
// eliminates free motions, eliminates springs and computes free motions of least norm.
// Springs that occur in the same closures are first combined into six equivalent
// springs.  Each spring column is multiplied by the square root of the spring's
// compliance.
//
// ========  =============  ============================================================
// symbol    shape          meaning
// ========  =============  ============================================================
// F         (nq, m)        closure columns of the free motions, as rows
// L         (ng, 6, 6)     columns of the six equivalent springs of each group, lower
//                          triangular except for pivoting
// Y         (.., 6 ng)     Z times the closure columns of the equivalent springs
// Z         (m - rank, m)  orthonormal rows, orthogonal to all free motions, stored in
//                          one table with Y; after the elimination of the springs
//                          L_Y^-1 Z, with the triangle L_Y of Y, and then the rows to
//                          which no spring contributes
// G, h      (r, nu), (r,)  strains due to the clearances and due to the errors
// u, v, y                  clearances, strains G u + h, multipliers of the springs
// ========  =============  ============================================================
#pragma once

#include "../solvers/dual_newton.h"
#include "../solvers/householder.h"
#include "linearised.h"

namespace LANE_SPACE {

// Return the rank in the first of these lanes.
inline int rank_of_first(Whole ranks, Whole lanes) {
    int l = 0;
    while (!lanes[l]) ++l;
    return int(ranks[l]);
}

// Number the patterns of frames with clearances.  Return the number of each pattern,
// -1 for the others.
inline Array<int> loose_patterns(const Robot &s) {
    Array<int> slot(s.np, -1);
    int next = 0;
    for (int c = 0; c < s.nu; ++c) {
        int &number = slot[s.pattern_of[s.cone_frame[c]]];
        if (number < 0) number = next++;
    }
    return slot;
}

// The linear model after the elimination of free motions and springs.
class Reduction : public Linearised {
public:
    Reduction(const Robot &s, const Points &points);

protected:
    const Cones cones;
    Array<int> slot;  // positions of the patterns in `parts`, or -1
    Triangle free, springs;  // F; Y and Z
    Table L, parts;          // parts: values of Z's rows for screws of each pattern
    Programme programme;
    Array<Real *> Z;  // rows of Z; Y is in the same table
    int widest;             // largest number of springs in a group, at least six

    Whole triangulate_free(Real tolerance);
    void orthogonal_rows(int rank, int count);
    struct Ranks { int free, springs; Whole same, unclear; };
    Ranks eliminate(Real tolerance, Whole requested);
    Ranks read_and_eliminate(const Points &points, const Block &block, Whole requested);
    void clearance_parts(int count);
    void right_sides(int r);
    void small_problem(int r);
    Row spring_strains(int r, const Row &v);
    Row moved_by(const Row &grouped);
    Row least_motions(int rank, const Row &moved);
    Whole balance_free_motions(int rank, const Row &drive, Real still, Row &closing);
    Whole balance_free_motions(int rank, int row, double still, Row &closing);
    void minimise_spring_energy(int r, Row &deformation, Row &closing);
    int spring_group(int g, Triangle &rows);

private:
    Ranks kept;  // result of the last elimination

    void grouped_springs();
    void spring_rows(int count);
    void eliminate_springs(int rank, int count);
};

inline Reduction::Reduction(const Robot &s, const Points &points)
    : Linearised(s, points), cones(s.starts, int(s.cones)), slot(loose_patterns(s)),
      free(nq, m), springs(m, 6 * ng + m), L(6 * ng, 6),
      parts(m, 6 * (1 + *std::max_element(slot.begin(), slot.end()))),
      programme(cones, m), Z(m), widest(6) {
    for (int g = 0; g < ng; ++g)
        widest = std::max(widest, int(s.groups[g + 1] - s.groups[g]));
}

// Triangulate the free motions.  Return the rank in each lane, -1 where it is
// ambiguous.
inline Whole Reduction::triangulate_free(Real tolerance) {
    for (int c = 0; c < nq; ++c) {
        std::fill(free.F[c], free.F[c] + m, Real{});
        for (const Entry &e : patterns[s.pattern_of[s.free_frame[c]]])
            for (int a = 0; a < 6; ++a)
                free.F[c][6 * e.closure + a] = e.sign * motion[c][a];
    }
    return triangulate(free, nq, m, tolerance, Real{}, 1e-11, m);
}

// Copy the columns of a group's springs into `rows` (6, springs).  Return the number
// of columns, at least six.
inline int Reduction::spring_group(int g, Triangle &rows) {
    const int count = int(s.groups[g + 1] - s.groups[g]);
    for (int i = 0; i < 6; ++i)
        for (int c = 0; c < std::max(6, count); ++c)
            rows.F[i][c] = c < count ? elastic[int(s.groups[g]) + c][i] : Real{};
    return std::max(6, count);
}

// Combine the springs of each group into six equivalent springs, which have the same
// sum of column products.
inline void Reduction::grouped_springs() {
    Triangle rows(6, widest);
    for (int g = 0; g < ng; ++g) {
        const int count = spring_group(g, rows);
        const Whole rank = triangulate(rows, 6, count, Real{}, Real{}, -1.0, count);
        for (int i = 0; i < 6; ++i) {
            Real row[6] = {};
            for (int b = 0; b < i; ++b) row[b] = rank > b ? rows.F[i][b] : Real{};
            row[i] = rank > i ? rows.diagonal[i] : Real{};
            for (int b = 0; b < 6; ++b)
                for (int l = 0; l < LANES; ++l)
                    L[int(6 * g + rows.order[i][l])][b][l] = row[b][l];
        }
    }
}

// Compute Z, whose rows are orthogonal to the free motions.
inline void Reduction::orthogonal_rows(int rank, int count) {
    for (int i = 0; i < count; ++i) {
        Z[i] = springs.F[i] + 6 * ng;
        std::fill(Z[i], Z[i] + m, Real{});
        Z[i][rank + i] = real(1.0);
    }
    turn_all(free, rank, m, Z.data(), count);
}

// Compute Y = Z times the columns of the equivalent springs.
inline void Reduction::spring_rows(int count) {
    for (int i = 0; i < count; ++i)
        for (int g = 0; g < ng; ++g) {
            Real of_group[6], product[6] = {};
            part(Z[i], s.group_pattern[g], of_group);
            for (int a = 0; a < 6; ++a)
                for (int b = 0; b < 6; ++b) product[b] += of_group[a] * L[6 * g + a][b];
            std::copy(product, product + 6, springs.F[i] + 6 * g);
        }
}

// Replace Z, in the order of Y's rows, by L_Y^-1 Z.  Rows to which springs contribute
// come first.
inline void Reduction::eliminate_springs(int rank, int count) {
    Row weights(rank);
    for (int i = 0; i < count; ++i) {
        const Real *Y = springs.F[i];
        Z[i] = springs.F[i] + 6 * ng;
        const int before = std::min(i, rank);
        for (int l = 0; l < before; ++l) weights[l] = -Y[l];
        combine(Z.data(), before, weights.data(), m, Z[i]);
        // rows to which no spring contributes are scaled to length 1; their rounding
        // errors are then relative to that length
        const Real size = i < rank ? springs.diagonal[i] : root(inner(Z[i], Z[i], m));
        const Real over = 1.0 / size;
        for (int a = 0; a < m; ++a) Z[i][a] *= over;
    }
}

// Triangulate the free motions, then the springs.  Lanes are eliminated together if
// they have the same ranks as the first requested lane.
inline Reduction::Ranks Reduction::eliminate(Real tolerance, Whole requested) {
    Ranks ranks = {};
    const Whole free_rank = triangulate_free(tolerance);
    ranks.unclear = requested & (free_rank < 0);
    if (!any(requested &= free_rank >= 0)) return ranks;
    ranks.free = rank_of_first(free_rank, requested);
    const int count = m - ranks.free;
    requested &= free_rank == ranks.free;
    grouped_springs();
    orthogonal_rows(ranks.free, count);
    spring_rows(count);
    const Whole spring_rank = triangulate(
        springs, count, 6 * ng, tolerance, NOISE * largest_spring, -1.0, 6 * ng + m);
    ranks.unclear |= requested & (spring_rank < 0);
    if (!any(requested &= spring_rank >= 0)) return ranks;
    ranks.springs = rank_of_first(spring_rank, requested);
    ranks.same = requested & (spring_rank == ranks.springs);
    eliminate_springs(ranks.springs, count);
    return ranks;
}

// Compute, for the requested lanes, all quantities that do not depend on errors and
// loads.  While the posture does not change, the stored quantities are used.
inline Reduction::Ranks Reduction::read_and_eliminate(
    const Points &points, const Block &block, Whole requested) {
    const bool unchanged = same_posture(points, block);
    read(points, block, unchanged);
    if (unchanged) {  // all lanes have the same posture
        const bool unclear = any(kept.unclear);
        return {
            kept.free, kept.springs, unclear ? Whole{} : requested,
            unclear ? requested : Whole{}};
    }
    kept = eliminate(tolerance(points, block), requested);
    if (any(kept.same)) clearance_parts(m - kept.free);
    return kept;
}

// Compute the values of Z's rows for screws of each pattern with clearances.
inline void Reduction::clearance_parts(int count) {
    for (int i = 0; i < count; ++i)
        for (int g = 0; g < np; ++g)
            if (slot[g] >= 0) part(Z[i], g, parts[i] + 6 * slot[g]);
}

// Compute h, the strains due to the errors.
inline void Reduction::right_sides(int r) {
    for (int i = 0; i < r; ++i) programme.h[i] = -inner(known.data(), Z[i], m);
}

// Compute G and h of the small cone programme.  Its columns are in the order that the
// solver requires.
inline void Reduction::small_problem(int r) {
    programme.r = r;
    right_sides(r);
    for (int c = 0; c < nu; ++c) {
        const int index = int(cones.column[c]), g = slot[s.pattern_of[s.cone_frame[index]]];
        Real screw[6];
        for (int a = 0; a < 6; ++a) screw[a] = -clearance[index][a];
        for (int i = 0; i < r; ++i) {
            Real total = {};
            for (int a = 0; a < 6; ++a) total += screw[a] * parts[i][6 * g + a];
            programme.M[i][c] = total;
        }
    }
}

// Compute the deformations of the equivalent springs from the strains v.
inline Row Reduction::spring_strains(int r, const Row &v) {
    Row spring(6 * ng);
    std::copy(v.begin(), v.begin() + r, spring.begin());
    Real *row = spring.data();
    turn_all(springs, r, 6 * ng, &row, 1);
    return spring;
}

// Compute the closure error that errors, clearances and equivalent springs cause, and
// add the motions of clearances and springs to the platform screw.
inline Row Reduction::moved_by(const Row &grouped) {
    Row total = known;
    Real step[6];
    for (int c = 0; c < nu; ++c) {
        const int64_t index = cones.column[c], j = s.cone_frame[index];
        for (int a = 0; a < 6; ++a) step[a] = clearance[int(index)][a] * programme.u[c];
        move(s.pattern_of[j], s.on_path[j], step, total);
    }
    for (int g = 0; g < ng; ++g) {
        for (int a = 0; a < 6; ++a) step[a] = inner(L[6 * g + a], &grouped[6 * g], 6);
        move(s.group_pattern[g], s.group_on_path[g], step, total);
    }
    return total;
}

// Compute the free motions of least norm that close the remaining closure error.
inline Row Reduction::least_motions(int rank, const Row &moved) {
    Row right(std::max(m, nq)), least(nq), motions(nq);
    for (int a = 0; a < m; ++a) right[a] = -moved[a];
    turn_back(free, rank, m, right.data());
    if (rank == nq) {
        for (int i = nq - 1; i >= 0; --i) {
            least[i] = right[i];
            for (int l = i + 1; l < nq; ++l) least[i] -= free.F[l][i] * least[l];
            least[i] /= free.diagonal[i];
        }
    } else {
        // for dependent free motions the columns of the triangle are triangulated, too;
        // this gives the solution of least norm
        Triangle R(rank, nq);
        for (int i = 0; i < rank; ++i) {
            R.F[i][i] = free.diagonal[i];
            for (int l = i + 1; l < nq; ++l) R.F[i][l] = free.F[l][i];
        }
        triangulate(R, rank, nq, Real{}, Real{}, -1.0, nq);
        for (int i = 0; i < rank; ++i) {
            for (int l = 0; l < LANES; ++l) least[i][l] = right[R.order[i][l]][l];
            for (int l = 0; l < i; ++l) least[i] -= R.F[i][l] * least[l];
            least[i] /= R.diagonal[i];
        }
        Real *row = least.data();
        turn_all(R, rank, nq, &row, 1);
    }
    for (int i = 0; i < nq; ++i)
        for (int l = 0; l < LANES; ++l) motions[free.order[i][l]][l] = least[i][l];
    return motions;
}

// Compute the wrenches of least norm on the closures that balance the forces `drive`
// on the free motions.  A force of at most `still` counts as balanced.  Return the
// lanes where a force cannot be balanced.
inline Whole Reduction::balance_free_motions(
    int rank, const Row &drive, Real still, Row &closing) {
    Whole loose = {};
    std::fill(closing.begin(), closing.end(), Real{});
    for (int i = 0; i < nq; ++i) {
        Real left;
        for (int l = 0; l < LANES; ++l) left[l] = -drive[free.order[i][l]][l];
        for (int l = 0; l < std::min(i, rank); ++l) left -= free.F[i][l] * closing[l];
        if (i < rank)
            closing[i] = left / free.diagonal[i];
        else
            loose |= magnitude(left) > still;
    }
    Real *row = closing.data();
    turn_all(free, rank, m, &row, 1);
    return loose;
}

// Compute the same wrenches for a unit wrench on the platform, component `row`.
inline Whole Reduction::balance_free_motions(
    int rank, int row, double still, Row &closing) {
    Row drive(nq);
    for (int c = 0; c < nq; ++c)
        drive[c] = s.on_path[s.free_frame[c]] * motion[c][row];
    return balance_free_motions(rank, drive, real(still), closing);
}

// Add wrenches on the closures that minimise the energy of the springs.  `deformation`
// contains the deformations of the equivalent springs due to the other wrenches.  Its
// first r entries are overwritten with the coefficients of Z's first r rows.
inline void Reduction::minimise_spring_energy(int r, Row &deformation, Row &closing) {
    turn_back(springs, r, 6 * ng, deformation.data());
    for (int i = 0; i < r; ++i) deformation[i] = -deformation[i];
    combine(Z.data(), r, deformation.data(), m, closing.data());
}

}  // namespace LANE_SPACE
