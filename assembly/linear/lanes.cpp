// Problems (22), without loads, and (21), and the classical compliance, several postures
// side by side, from the frames' poses to the certified answer: compiled_reduction.py,
// compiled_energy.py, compiled_zone.py and compiled_compliance.py in lanes.
//
// ========  =============  ============================================================
// symbol    shape          meaning
// ========  =============  ============================================================
// P         (n, 6, 6)      row `axis`: unit screw of frame j along it, read at the
//                          platform in base axes, translations by the reference length;
//                          of the slides only what the turns say is kept
// m                        6 closures, the rows A of (16)-(20)
// F         (nq, m)        columns of the free motions as rows
// L         (ng, 6, 6)     each group's springs as six, lower triangular but for pivoting
// Y         (.., 6 ng)     Z times the springs' columns
// Z         (m - rank, m)  orthonormal, orthogonal to all free motions, in one table
//                          with Y; later L^-1 Z, and the rows that no spring enters
// known     (m,)           closure error that the geometric errors cause
// G, h      (r, nu), (r,)  strains by clearances and by errors
// u, v, y                  clearances, strains G u + h, multipliers of the springs
// B, w      (p, nu), (p,)  of (21): B u = w must hold, B's rows orthonormal, |u_k| <= t
// ========  =============  ============================================================
#include "../solvers/cpp/block.h"
#include "../solvers/cpp/cones.h"
#include "../solvers/cpp/householder.h"

// assembly/linear/thresholds.py and assembly/solvers/conic.py
constexpr double RANK = 1e-10, MISMATCH_FACTOR = 30.0, NOISE = 1e-12, OPEN = 1e-11;
constexpr double ROWS_RANK = 1e-9, INFEASIBLE = 1e-13, MARGIN_GAP = 1e-8;
constexpr double GAP = 1e-8, GAP_WITHOUT_CLEARANCE = 1e-12;
// assembly/linear/compiled_energy.py
enum Outcome { NEWTON, INTERIOR, RIGID, AMBIGUOUS, UNCERTIFIED, BOUNDED };
constexpr double STOP = 3e-3;
// assembly/linear/compiled_zone.py
enum { SOLVED, FALLBACK };
constexpr double MARGIN_STOP = 1e-9;

// A robot: assembly/linear/compiled_structure.py's Structure, and how many there are.
struct Robot {
    double size;
    int64_t platform;
    const double *on_path, *patterns;
    const int64_t *pattern_of;
    const double *springs;
    const int64_t *spring_frame, *spring_order, *groups, *group_pattern;
    const double *group_on_path;
    const int64_t *cone_frame, *cone_axis;
    const double *cone_size;
    const int64_t *starts, *free_frame, *free_axis;
    const double *free_bound;
    int64_t n, closures, np, ny, ng, nu, cones, nq;
};

// Points: (k, n, 4, 4) frames, (k or 1, n, 6) errors, (k,) nominal closure errors.
struct Points {
    int64_t count;
    const double *T, *errors, *mismatch;
    int64_t own_errors;
};

// compiled_energy.py's Solutions, one row a point; no `elastic` where nobody asks.
struct Solutions {
    int64_t *outcome;
    double *energy, *bound, *without_clearance, *platform_screw, *clearances, *motions,
        *multipliers, *residual, *elastic;
};

// Margins (21) and their bounds, one a point.
struct Margins {
    double *margin, *bound;
    int64_t *outcome;
};

// Deformation of every spring under six unit wrenches on the platform, (k, 6, ny), and
// whether a point has one: platform_stiffness/compiled_compliance.py.
struct Compliances {
    double *springs;
    int64_t *status;
};
enum { COMPLIANT, LOOSE, UNCLEAR };
constexpr double STILL = 1e-9;

namespace {

// The rank in the first of these lanes.
inline int rank_of_first(Whole ranks, Whole lanes) {
    int l = 0;
    while (!lanes[l]) ++l;
    return int(ranks[l]);
}

// A closure that a frame enters, and the sign.
struct Entry {
    int closure;
    double sign;
};

// Places of the patterns with clearances; -1 for the others.
inline std::vector<int> loose_patterns(const Robot &s) {
    std::vector<int> slot(s.np, -1);
    int next = 0;
    for (int c = 0; c < s.nu; ++c) {
        int &own = slot[s.pattern_of[s.cone_frame[c]]];
        if (own < 0) own = next++;
    }
    return slot;
}

// Solves blocks of points of one robot, one after the other.
class Assembler {
public:
    Assembler(const Robot &s, const Points &points);

    bool covers() const { return cones.known; }
    Whole solve(const Points &points, const Block &block, Whole asked, Solutions &out);
    Whole margins(const Points &points, const Block &block, Whole asked, Margins &out);
    Whole comply(const Points &points, const Block &block, Whole asked, Compliances &out);

private:
    const Robot &s;
    const int n, m, np, ng, nu, nq;
    const Cones cones;
    std::vector<std::vector<Entry>> patterns;
    std::vector<bool> felt, erring;  // frames
    std::vector<int> slot;         // of the patterns with clearances, in parts; else -1
    Table P;                       // (n, 18) the three turns of each frame: `column`
    Table motion, play, elastic;   // (.., 6) columns of free motions, clearances, springs
    Triangle free, springs;        // F; Y with Z beside it
    Triangle rows;                 // of (21), with their right sides
    Table L, parts;                // parts: Z's rows, for a screw of each pattern
    Row known;
    Real screw[6];  // of the platform
    Programme programme;
    Solver solver;
    Row v;
    std::vector<Real *> Z;  // rows beside Y's
    int widest;
    Real largest_error, largest_spring;

    void read(const Points &points, const Block &block);
    void read_frame(const Points &points, const Block &block, int j, const Real *origin);
    void read_errors(const Points &points, const Block &block, int j);
    void column(int64_t j, int64_t axis, Real *out) const;
    void columns();
    void part(const Real *row, int64_t pattern, Real *out) const;
    int spring_group(int g, Triangle &rows);
    void grouped_springs();
    void orthogonal_rows(int rank, int count);
    void spring_rows(int count);
    void eliminate_springs(int rank, int count);
    struct Ranks { int free, springs; Whole same, unclear; };
    Ranks eliminate(Real tolerance, Whole asked);
    void clearance_parts(int count);
    Whole rigid_rows(int rank, int count, Real tolerance);
    Real enters(int c, const Real *part) const;
    Real largest_clearance() const;
    void small_problem(int r);
    Whole minimise(int r, Whole asked);
    Row least_multipliers(int r, int count);
    void move(int64_t pattern, double on_path, const Real *step, Row &open);
    Row moved_by(int r);
    Row least_motions(int rank, const Row &moved);
    void own_springs(int r, const Block &block, double *elastic, Whole where);
    Row spring_strains(int r);
    struct Proof { Real gain, cost; };
    Proof complementary(const Row &motions, const Row &multipliers);
    Whole hold_free_motions(int rank, int row, Row &closing);
    void first_along(int count, Real *w, Real size);
    void farthest(int count, Whole asked, Real &reach, Real &most);
};

Assembler::Assembler(const Robot &s, const Points &points)
    : s(s), n(int(s.n)), m(int(6 * s.closures)), np(int(s.np)), ng(int(s.ng)),
      nu(int(s.nu)), nq(int(s.nq)), cones(s.starts, int(s.cones)), patterns(np), felt(n),
      erring(n), slot(loose_patterns(s)), P(n, 18), motion(nq, 6), play(nu, 6), elastic(int(s.ny), 6),
      free(nq, m), springs(m, 6 * ng + m), rows(ng ? 0 : m, nu + 1), L(6 * ng, 6), parts(m, 6 * (1 + *std::max_element(slot.begin(), slot.end()))), known(m),
      programme(cones, m), solver(cones, m), v(m), Z(m), widest(6) {
    for (int g = 0; g < np; ++g)
        for (int k = 0; k < s.closures; ++k)
            if (const double sign = s.patterns[g * s.closures + k])
                patterns[g].push_back({k, sign});
    for (int g = 0; g < ng; ++g)
        widest = std::max(widest, int(s.groups[g + 1] - s.groups[g]));
    for (int c = 0; c < nu; ++c) felt[s.cone_frame[c]] = true;
    for (int c = 0; c < nq; ++c) felt[s.free_frame[c]] = true;
    for (int c = 0; c < s.ny; ++c) felt[s.spring_frame[c]] = true;
    // a frame without errors at any point adds exact zeros
    const int64_t sets = points.own_errors ? points.count : 1;
    for (int64_t i = 0; i < sets * n; ++i)
        for (int axis = 0; axis < 6; ++axis)
            if (points.errors[6 * i + axis] != 0.0) erring[i % n] = true;
}

// The columns that the frames' poses give, the closure error and the platform's screw
// that their errors cause.
void Assembler::read(const Points &points, const Block &block) {
    Real origin[3];
    for (int a = 0; a < 3; ++a)
        origin[a] = block.read(points.T, n * 16, s.platform * 16 + 4 * a + 3);
    std::fill(known.begin(), known.end(), Real{});
    std::fill(screw, screw + 6, Real{});
    largest_error = Real{};
    for (int j = 0; j < n; ++j) {
        if (felt[j] || erring[j]) read_frame(points, block, j, origin);
        if (erring[j]) read_errors(points, block, j);
    }
    columns();
}

// A frame's turns: unit screws about its axes.
void Assembler::read_frame(
    const Points &points, const Block &block, int j, const Real *origin) {
    const auto entry = [&](int a, int b) {
        return block.read(points.T, n * 16, j * 16 + 4 * a + b);
    };
    const Real x = (entry(0, 3) - origin[0]) / s.size;
    const Real y = (entry(1, 3) - origin[1]) / s.size;
    const Real z = (entry(2, 3) - origin[2]) / s.size;
    for (int axis = 0; axis < 3; ++axis) {
        const Real a = entry(0, axis), b = entry(1, axis), c = entry(2, axis);
        Real *turned = P[j] + 6 * axis;
        turned[0] = a, turned[1] = b, turned[2] = c;
        turned[3] = y * c - z * b, turned[4] = z * a - x * c, turned[5] = x * b - y * a;
    }
}

// What a frame's errors move.
void Assembler::read_errors(const Points &points, const Block &block, int j) {
    Real own[6] = {}, step[6];
    for (int axis = 0; axis < 6; ++axis) {
        const Real error = points.own_errors
                               ? block.read(points.errors, n * 6, j * 6 + axis)
                               : real(points.errors[j * 6 + axis]);
        column(j, axis, step);
        for (int a = axis < 3 ? 0 : 3; a < 6; ++a) {
            step[a] *= error;
            own[a] += step[a];
            largest_error = larger(magnitude(step[a]), largest_error);
        }
    }
    move(s.pattern_of[j], s.on_path[j], own, known);
}

// P's row `axis` of frame j.
void Assembler::column(int64_t j, int64_t axis, Real *out) const {
    const Real *turned = P[int(j)] + 6 * (axis % 3);
    for (int a = 0; a < 3; ++a) {
        out[a] = axis < 3 ? turned[a] : Real{};
        out[3 + a] = axis < 3 ? turned[3 + a] : turned[a] * (1.0 / s.size);
    }
}

// Columns of free motions, clearances and springs.
void Assembler::columns() {
    for (int c = 0; c < nq; ++c) {
        const int64_t j = s.free_frame[c];
        column(j, s.free_axis[c], motion[c]);
        std::fill(free.F[c], free.F[c] + m, Real{});
        for (const Entry &e : patterns[s.pattern_of[j]])
            for (int a = 0; a < 6; ++a)
                free.F[c][6 * e.closure + a] = e.sign * motion[c][a];
    }
    for (int c = 0; c < nu; ++c) {
        column(s.cone_frame[c], s.cone_axis[c], play[c]);
        for (int a = 0; a < 6; ++a) play[c][a] *= s.cone_size[c];
    }
    Real step[6];
    largest_spring = Real{};
    for (int c = 0; c < s.ny; ++c) {
        std::fill(elastic[c], elastic[c] + 6, Real{});
        for (int axis = 0; axis < 6; ++axis)
            if (const double weight = s.springs[6 * c + axis]) {
                column(s.spring_frame[c], axis, step);
                for (int a = 0; a < 6; ++a) elastic[c][a] += weight * step[a];
            }
        for (int a = 0; a < 6; ++a)
            largest_spring = larger(magnitude(elastic[c][a]), largest_spring);
    }
}

// Adds a step of a frame to the platform's screw and to what closures are open.
void Assembler::move(int64_t pattern, double on_path, const Real *step, Row &open) {
    if (on_path)
        for (int a = 0; a < 6; ++a) screw[a] += on_path * step[a];
    for (const Entry &e : patterns[pattern])
        for (int a = 0; a < 6; ++a) open[6 * e.closure + a] += e.sign * step[a];
}

// What a screw of this pattern is in a row over the closures.
void Assembler::part(const Real *row, int64_t pattern, Real *out) const {
    Real own[6] = {};
    for (const Entry &e : patterns[pattern])
        for (int a = 0; a < 6; ++a) own[a] += e.sign * row[6 * e.closure + a];
    std::copy(own, own + 6, out);
}

// (6, springs) columns of a group's springs; returns how many, at least six.
int Assembler::spring_group(int g, Triangle &rows) {
    const int count = int(s.groups[g + 1] - s.groups[g]);
    for (int i = 0; i < 6; ++i)
        for (int c = 0; c < std::max(6, count); ++c)
            rows.F[i][c] = c < count ? elastic[int(s.groups[g]) + c][i] : Real{};
    return std::max(6, count);
}

// Springs that act together, combined into six with the same sum of squares.
void Assembler::grouped_springs() {
    Triangle rows(6, widest);
    for (int g = 0; g < ng; ++g) {
        const int count = spring_group(g, rows);
        const Whole rank = triangulate(rows, 6, count, Real{}, Real{}, -1.0, count);
        for (int i = 0; i < 6; ++i) {
            Real own[6] = {};
            for (int b = 0; b < i; ++b) own[b] = rank > b ? rows.F[i][b] : Real{};
            own[i] = rank > i ? rows.diagonal[i] : Real{};
            for (int b = 0; b < 6; ++b)
                for (int l = 0; l < LANES; ++l)
                    L[int(6 * g + rows.order[i][l])][b][l] = own[b][l];
        }
    }
}

// Z, orthogonal to the free motions.
void Assembler::orthogonal_rows(int rank, int count) {
    for (int i = 0; i < count; ++i) {
        Z[i] = springs.F[i] + 6 * ng;
        std::fill(Z[i], Z[i] + m, Real{});
        Z[i][rank + i] = real(1.0);
    }
    turn_all(free, rank, m, Z.data(), count);
}

// Y = Z times the grouped springs' columns.
void Assembler::spring_rows(int count) {
    for (int i = 0; i < count; ++i)
        for (int g = 0; g < ng; ++g) {
            Real of_group[6], own[6] = {};
            part(Z[i], s.group_pattern[g], of_group);
            for (int a = 0; a < 6; ++a)
                for (int b = 0; b < 6; ++b) own[b] += of_group[a] * L[6 * g + a][b];
            std::copy(own, own + 6, springs.F[i] + 6 * g);
        }
}

// Divides Z, ordered like Y's triangle, by it: rows that springs enter first.
void Assembler::eliminate_springs(int rank, int count) {
    Row weights(rank);
    for (int i = 0; i < count; ++i) {
        const Real *Y = springs.F[i];
        Z[i] = springs.F[i] + 6 * ng;
        const int before = std::min(i, rank);
        for (int l = 0; l < before; ++l) weights[l] = -Y[l];
        combine(Z.data(), before, weights.data(), m, Z[i]);
        if (i < rank) {
            const Real over = 1.0 / springs.diagonal[i];
            for (int a = 0; a < m; ++a) Z[i][a] *= over;
        }
    }
}

// Free motions, then springs brought to triangles, in the lanes asked for that have the
// ranks of the first of them.
Assembler::Ranks Assembler::eliminate(Real tolerance, Whole asked) {
    Ranks ranks = {};
    const Whole free_rank = triangulate(free, nq, m, tolerance, Real{}, 1e-11, m);
    ranks.unclear = asked & (free_rank < 0);
    if (!any(asked &= free_rank >= 0)) return ranks;
    ranks.free = rank_of_first(free_rank, asked);
    const int count = m - ranks.free;
    asked &= free_rank == ranks.free;
    grouped_springs();
    orthogonal_rows(ranks.free, count);
    spring_rows(count);
    const Whole spring_rank = triangulate(
        springs, count, 6 * ng, tolerance, NOISE * largest_spring, -1.0, 6 * ng + m);
    ranks.unclear |= asked & (spring_rank < 0);
    if (!any(asked &= spring_rank >= 0)) return ranks;
    ranks.springs = rank_of_first(spring_rank, asked);
    ranks.same = asked & (spring_rank == ranks.springs);
    eliminate_springs(ranks.springs, count);
    return ranks;
}

// What a screw of each pattern is in Z's rows.
void Assembler::clearance_parts(int count) {
    for (int i = 0; i < count; ++i)
        for (int g = 0; g < np; ++g)
            if (slot[g] >= 0) part(Z[i], g, parts[i] + 6 * slot[g]);
}

// What clearance c is in a row, of which screws of its pattern are `part`.
Real Assembler::enters(int c, const Real *part) const {
    Real total = {};
    for (int a = s.cone_axis[c] < 3 ? 0 : 3; a < 6; ++a) total += play[c][a] * part[a];
    return total;
}

// Largest entry of the clearances' closure columns, for the noise floor.
Real Assembler::largest_clearance() const {
    Real largest = {};
    for (int c = 0; c < nu; ++c)
        for (const Entry &e : patterns[s.pattern_of[s.cone_frame[c]]])
            for (int a = 0; a < 6; ++a)
                largest = larger(magnitude(e.sign * play[c][a]), largest);
    return largest;
}

// Lanes where clearances or errors enter rows that no spring enters.
Whole Assembler::rigid_rows(int rank, int count, Real tolerance) {
    std::vector<Real> most(np), sizes(nu);
    for (int g = 0; g < np; ++g)
        for (int i = rank; slot[g] >= 0 && i < count; ++i)
            for (int a = 0; a < 6; ++a)
                most[g] = larger(magnitude(parts[i][6 * slot[g] + a]), most[g]);
    Real worst = {};
    for (int c = 0; c < nu; ++c)
        for (int a = 0; a < 6; ++a) sizes[c] = larger(magnitude(play[c][a]), sizes[c]);
    const Real limit = largest_clearance() * (NOISE / CLEAR);
    for (int c = 0; c < nu; ++c) {
        const int64_t g = s.pattern_of[s.cone_frame[c]];
        const Whole near = 6.0 * sizes[c] * most[g] > limit;
        if (!any(near)) continue;  // as nearly all are
        for (int i = rank; i < count; ++i) {
            const Real total = enters(c, parts[i] + 6 * slot[g]);
            worst = near ? larger(magnitude(total), worst) : worst;
        }
    }
    Whole rigid = worst > limit;
    const Real allowed = 1e-12 / CLEAR + tolerance * largest_error;
    for (int i = rank; i < count; ++i)  // written so that NaN is rigid
        rigid |= ~(magnitude(inner(known.data(), Z[i], m)) <= allowed);
    return rigid;
}

// G and h, in the solver's order of columns.
void Assembler::small_problem(int r) {
    programme.r = r;
    for (int i = 0; i < r; ++i) programme.h[i] = -inner(known.data(), Z[i], m);
    for (int c = 0; c < nu; ++c) {
        const int own = int(cones.column[c]), g = slot[s.pattern_of[s.cone_frame[own]]];
        Real screw[6];
        for (int a = 0; a < 6; ++a) screw[a] = -play[own][a];
        for (int i = 0; i < r; ++i) {
            Real total = {};
            for (int a = 0; a < 6; ++a) total += screw[a] * parts[i][6 * g + a];
            programme.M[i][c] = total;
        }
    }
}

// Least |G u + h|^2 / 2: u, v = G u + h, and the multipliers y.  Newton alone where all
// constraints are active, else after an interior point.  Returns the outcomes.
Whole Assembler::minimise(int r, Whole asked) {
    Programme &q = programme;
    Real square = inner(q.h.data(), q.h.data(), r), size = square;
    for (int c = 0; c < nu; ++c) {
        Real column = {};
        for (int i = 0; i < r; ++i) column += q.M[i][c] * q.M[i][c];
        size = larger(column, size);
    }
    size = root(size);
    std::fill(q.u.begin(), q.u.end(), Real{});
    std::copy(q.h.begin(), q.h.begin() + r, q.y.begin());
    std::copy(q.h.begin(), q.h.begin() + r, v.begin());
    asked &= square > 0.0;
    if (nu == 0 || !any(asked)) return Whole{};
    const Real over = 1.0 / (square > 0.0 ? size : real(1.0));
    for (int i = 0; i < r; ++i) {
        q.h[i] *= over;
        for (int c = 0; c < nu; ++c) q.M[i][c] *= over;
    }
    const Real absolute =
        STOP * GAP_WITHOUT_CLEARANCE * 0.5 * inner(q.h.data(), q.h.data(), r);
    const Whole left = asked & ~solver.newton_alone(q, STOP * GAP, absolute, asked);
    solver.interior_then_newton(q, STOP * GAP, absolute, left);
    multiply(q.M.rows(), r, q.u.data(), nu, v.data());
    for (int i = 0; i < r; ++i) {
        v[i] = (v[i] + q.h[i]) * size;
        q.y[i] = asked ? q.y[i] * size : q.y[i];
        q.h[i] *= size;
    }
    return left ? whole(INTERIOR) : whole(NEWTON);
}

// Multipliers of the closures, the least ones where they are not unique.
Row Assembler::least_multipliers(int r, int count) {
    Row multipliers(m);
    combine(Z.data(), r, programme.y.data(), m, multipliers.data());
    // nothing feels those along Z's other rows, made orthonormal here
    for (int i = r; i < count; ++i) {
        Real *own = Z[i];
        for (int l = r; l < i; ++l) {
            const Real along = inner(Z[l], own, m);
            for (int a = 0; a < m; ++a) own[a] -= along * Z[l][a];
        }
        const Real over = 1.0 / root(inner(own, own, m));
        for (int a = 0; a < m; ++a) own[a] *= over;
        const Real along = inner(own, multipliers.data(), m);
        for (int a = 0; a < m; ++a) multipliers[a] -= along * own[a];
    }
    return multipliers;
}

// Deformation of the grouped springs.
Row Assembler::spring_strains(int r) {
    Row spring(6 * ng);
    std::copy(v.begin(), v.begin() + r, spring.begin());
    Real *own = spring.data();
    turn_all(springs, r, 6 * ng, &own, 1);
    return spring;
}

// Closure error of errors, clearances and springs, which move the platform.
Row Assembler::moved_by(int r) {
    Row total = known;
    Real step[6];
    for (int c = 0; c < nu; ++c) {
        const int64_t own = cones.column[c], j = s.cone_frame[own];
        for (int a = 0; a < 6; ++a) step[a] = play[int(own)][a] * programme.u[c];
        move(s.pattern_of[j], s.on_path[j], step, total);
    }
    const Row spring = spring_strains(r);
    for (int g = 0; g < ng; ++g) {
        for (int a = 0; a < 6; ++a) step[a] = inner(L[6 * g + a], &spring[6 * g], 6);
        move(s.group_pattern[g], s.group_on_path[g], step, total);
    }
    return total;
}

// Free motions of least size that close the rest.
Row Assembler::least_motions(int rank, const Row &moved) {
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
        // the triangle's columns, as rows, triangulated once more
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
        Real *own = least.data();
        turn_all(R, rank, nq, &own, 1);
    }
    for (int i = 0; i < nq; ++i)
        for (int l = 0; l < LANES; ++l) motions[free.order[i][l]][l] = least[i][l];
    return motions;
}

// Deformation of every spring, from that of the groups' six.
void Assembler::own_springs(int r, const Block &block, double *elastic, Whole where) {
    const Row grouped = spring_strains(r);
    Triangle rows(6, widest);
    for (int g = 0; g < ng; ++g) {
        const int count = spring_group(g, rows);
        triangulate(rows, 6, count, Real{}, Real{}, -1.0, count);
        Row own(count);
        std::copy(&grouped[6 * g], &grouped[6 * g] + 6, own.begin());
        Real *x = own.data();
        turn_all(rows, 6, count, &x, 1);
        for (int64_t c = s.groups[g]; c < s.groups[g + 1]; ++c)
            block.write(elastic, s.ny, s.spring_order[c], own[c - s.groups[g]], where);
    }
}

// Wrenches times f prove f gain - f^2 cost / 2, on the problem before elimination.
Assembler::Proof Assembler::complementary(const Row &motions, const Row &multipliers) {
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

// Solves the lanes asked for that have the ranks of the first of them, and writes their
// rows; returns the others.
Whole Assembler::solve(
    const Points &points, const Block &block, Whole asked, Solutions &out) {
    const auto settle = [&](Whole where, int64_t outcome) {
        for (int l = 0; l < LANES; ++l)
            if (where[l]) out.outcome[block.point[l]] = outcome;
    };
    const Whole all = asked;
    read(points, block);
    const Real tolerance = RANK + MISMATCH_FACTOR * block.read(points.mismatch, 1, 0);
    const Ranks ranks = eliminate(tolerance, asked);
    settle(ranks.unclear, AMBIGUOUS);
    const Whole settled = ranks.unclear | ranks.same;
    if (!any(asked = ranks.same)) return all & ~settled;
    const int rank = ranks.free, count = m - rank, r = ranks.springs;
    clearance_parts(count);
    const Whole rigid = rigid_rows(r, count, tolerance);
    settle(asked & rigid, RIGID);
    if (!any(asked &= ~rigid)) return all & ~settled;
    small_problem(r);
    const Real without = 0.5 * inner(programme.h.data(), programme.h.data(), r);
    const Whole solved = minimise(r, asked);
    // back to the full problem
    Row multipliers = least_multipliers(r, count);
    Row moved = moved_by(r);
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
    Real residual = {}, work = {};
    for (int a = 0; a < m; ++a) {
        residual = larger(magnitude(moved[a]), residual);
        work += magnitude(moved[a] * multipliers[a]);
    }
    const Real energy = 0.5 * inner(v.data(), v.data(), r);
    const Proof proof = complementary(motions, multipliers);
    // any multiple of the wrenches proves a bound: the best one, zero inside a zone
    const Real gain = proof.gain - work, cost = proof.cost;
    const Whole some = (gain > 0.0) & (cost > 0.0);
    const Real factor = some ? gain / cost : Real{};
    const Real bound = 0.5 * factor * factor * cost;
    // written so that NaN fails
    const Real allowed = GAP * energy + GAP_WITHOUT_CLEARANCE * without;
    const Whole proved = (energy - bound <= allowed) & (residual <= OPEN);
    outcome = (outcome == whole(BOUNDED)) | proved ? outcome : whole(UNCERTIFIED);
    for (int l = 0; l < LANES; ++l)
        if (asked[l]) out.outcome[block.point[l]] = outcome[l];
    block.write(out.energy, 1, 0, energy, asked);
    block.write(out.bound, 1, 0, bound, asked);
    block.write(out.without_clearance, 1, 0, without, asked);
    block.write(out.residual, 1, 0, residual, asked);
    for (int a = 0; a < 6; ++a)
        block.write(out.platform_screw, 6, a, a < 3 ? screw[a] : screw[a] * s.size, asked);
    for (int c = 0; c < nu; ++c)
        block.write(out.clearances, nu, cones.column[c], programme.u[c], asked);
    for (int c = 0; c < nq; ++c) block.write(out.motions, nq, c, motions[c], asked);
    for (int a = 0; a < m; ++a)
        block.write(out.multipliers, m, a, factor * multipliers[a], asked);
    if (out.elastic) own_springs(r, block, out.elastic, asked);
    return all & ~settled;
}

// The closures' least wrenches with which a unit wrench moves nothing free; returns the
// lanes that have none.
Whole Assembler::hold_free_motions(int rank, int row, Row &closing) {
    Whole loose = {};
    std::fill(closing.begin(), closing.end(), Real{});
    for (int i = 0; i < nq; ++i) {
        Real left;
        for (int l = 0; l < LANES; ++l) {
            const int c = int(free.order[i][l]);
            left[l] = -s.on_path[s.free_frame[c]] * motion[c][row][l];
        }
        for (int l = 0; l < std::min(i, rank); ++l) left -= free.F[i][l] * closing[l];
        if (i < rank)
            closing[i] = left / free.diagonal[i];
        else
            loose |= magnitude(left) > STILL;
    }
    Real *own = closing.data();
    turn_all(free, rank, m, &own, 1);
    return loose;
}

// The classical compliance of the lanes asked for that have the ranks of the first of
// them; returns the others.  Of the springs y = B e + Y^T mu under a unit wrench e, the
// closures' wrenches mu make |y| least.
Whole Assembler::comply(
    const Points &points, const Block &block, Whole asked, Compliances &out) {
    const auto settle = [&](Whole where, int64_t status) {
        for (int l = 0; l < LANES; ++l)
            if (where[l]) out.status[block.point[l]] = status;
        return ~where;
    };
    Whole others = asked;
    read(points, block);
    const Real tolerance = RANK + MISMATCH_FACTOR * block.read(points.mismatch, 1, 0);
    const Ranks ranks = eliminate(tolerance, asked);
    others &= settle(ranks.unclear, UNCLEAR);
    if (!any(asked = ranks.same)) return others;
    const int rank = ranks.free, r = ranks.springs;
    Row closing(m), bent(6 * ng), on(6 * np);
    for (int row = 0; row < 6; ++row) {
        const Whole loose = hold_free_motions(rank, row, closing);
        others &= settle(asked & loose, LOOSE);
        if (!any(asked &= ~loose)) return others;
        for (int g = 0; g < np; ++g) part(closing.data(), g, &on[6 * g]);
        for (int g = 0; g < ng; ++g)
            for (int b = 0; b < 6; ++b) {
                Real total = s.group_on_path[g] * L[6 * g + row][b];
                for (int a = 0; a < 6; ++a)
                    total += L[6 * g + a][b] * on[6 * s.group_pattern[g] + a];
                bent[6 * g + b] = total;
            }
        turn_back(springs, r, 6 * ng, bent.data());
        for (int i = 0; i < r; ++i) bent[i] = -bent[i];
        combine(Z.data(), r, bent.data(), m, closing.data());
        for (int g = 0; g < np; ++g) part(closing.data(), g, &on[6 * g]);
        for (int c = 0; c < s.ny; ++c) {
            const int64_t j = s.spring_frame[c];
            Real total = s.on_path[j] * elastic[c][row];
            for (int a = 0; a < 6; ++a)
                total += elastic[c][a] * on[6 * s.pattern_of[j] + a];
            block.write(out.springs, 6 * s.ny, row * s.ny + c, total, asked);
        }
    }
    return others & settle(asked, COMPLIANT);
}

// Margins of the lanes asked for that have the ranks of the first of them; returns the
// others.  With every link and joint rigid, B u = w must hold: the least factor t on the
// clearances is |w| over the most that g.u can be with |u_k| <= 1 and the rest of B u
// zero, g = B^T w / |w|.  The multipliers n of these rows bound it from below,
//
//     t >= |w| / sum_k |(g - B_rest^T n)_k|.
Whole Assembler::margins(
    const Points &points, const Block &block, Whole asked, Margins &out) {
    const auto settle = [&](Whole where, Real margin, Real bound, Whole proved) {
        block.write(out.margin, 1, 0, margin, where);
        block.write(out.bound, 1, 0, bound, where);
        for (int l = 0; l < LANES; ++l)
            if (where[l]) out.outcome[block.point[l]] = proved[l] ? SOLVED : FALLBACK;
        return ~where;
    };
    const Real unknown = real(NAN);
    Whole others = asked;
    read(points, block);
    const Whole closed = asked & (inner(known.data(), known.data(), m) == 0.0);
    others &= settle(closed, Real{}, Real{}, closed);  // no clearance is needed
    if (!any(asked = others)) return others;
    const Real tolerance = RANK + MISMATCH_FACTOR * block.read(points.mismatch, 1, 0);
    const Whole ranks = triangulate(free, nq, m, tolerance, Real{}, 1e-11, m);
    others &= settle(asked & (ranks < 0), unknown, unknown, Whole{});
    if (!any(asked &= ranks >= 0)) return others;
    const int rank = rank_of_first(ranks, asked), count = m - rank;
    asked &= ranks == rank;
    orthogonal_rows(rank, count);
    clearance_parts(count);
    small_problem(count);
    // rows u = right, beside each other
    for (int i = 0; i < count; ++i) {
        std::copy(programme.M[i], programme.M[i] + nu, rows.F[i]);
        rows.F[i][nu] = -programme.h[i];
    }
    const Whole clear = triangulate(
        rows, count, nu, real(ROWS_RANK), NOISE * largest_clearance(), -1.0, nu + 1);
    others &= settle(asked & (clear < 0), unknown, unknown, Whole{});
    if (!any(asked &= clear >= 0)) return others;
    const int left = rank_of_first(clear, asked);
    asked &= clear == left;
    Row w(count);
    Whole possible = whole(-1);
    for (int i = 0; i < count; ++i) {
        Real total = rows.F[i][nu];
        for (int l = 0; l < std::min(i, left); ++l) total -= rows.F[i][l] * w[l];
        if (i < left)
            w[i] = total / rows.diagonal[i];
        else  // what no clearance enters; written so that NaN is not possible
            possible &= magnitude(total) <= INFEASIBLE;
    }
    const Real size = root(inner(w.data(), w.data(), left));
    possible &= size > 0.0;
    Real reach = {}, most = real(1.0);
    if (any(asked & possible)) {
        first_along(left, w.data(), size);
        farthest(left, asked & possible, reach, most);
    }
    possible &= reach > 0.0;
    const Real margin = size / reach, bound = size / most;
    // motions of passive joints must stay within their ranges
    for (Real &own : programme.u) own *= margin;
    const Row motions = least_motions(rank, moved_by(0));
    for (int c = 0; c < nq; ++c) possible &= magnitude(motions[c]) <= s.free_bound[c];
    const Whole proved = possible & (margin - bound <= MARGIN_GAP * margin);
    return others & settle(
        asked, possible ? margin : unknown, possible ? bound : unknown, proved);
}

// B's rows, the triangle's own, turned so that the first is along w, the others across.
void Assembler::first_along(int count, Real *w, Real size) {
    Real *const *B = programme.M.rows();
    for (int i = 0; i < count; ++i) {
        std::fill(B[i], B[i] + nu, Real{});
        B[i][i] = real(1.0);
    }
    turn_all(rows, count, nu, B, count);
    for (int i = 0; i < count; ++i) w[i] /= size;
    const Real sign = w[0] <= 0.0 ? real(1.0) : real(-1.0);
    w[0] -= sign;
    const Real factor = -2.0 / inner(w, w, count);
    Row dots(nu), weights(count);
    combine(B, count, w, nu, dots.data());
    for (int i = 0; i < count; ++i)
        for (int c = 0; c < nu; ++c) B[i][c] += factor * w[i] * dots[c];
    for (int c = 0; c < nu; ++c) B[0][c] *= sign;
}

// u within the cones with the most B[0].u, its reach, and no B[1:] u; the most that it
// can be, by the multipliers.
void Assembler::farthest(int count, Whole asked, Real &reach, Real &most) {
    Programme &q = programme;
    Real **B = q.M.rows();
    std::rotate(B, B + 1, B + count);  // the rows H u = 0 first
    q.r = 0, q.p = count - 1, q.loaded = true;
    const Real *along = B[q.p];
    std::copy(along, along + nu, q.d.begin());
    solver.interior_point(q, real(MARGIN_STOP), 0.0, asked);
    Row gradient = q.d, against(q.p);
    for (int i = 0; i < q.p; ++i) against[i] = -q.y[i];
    combine(B, q.p, against.data(), nu, gradient.data());
    // the residual of the rest by rounding is removed, then u scaled into the cones
    for (int i = 0; i < q.p; ++i) {
        const Real residual = inner(B[i], q.u.data(), nu);
        for (int c = 0; c < nu; ++c) q.u[c] -= residual * B[i][c];
    }
    Real worst = real(1.0);
    most = Real{};
    cones.each([&](auto of, int, int at) {
        worst = larger(inner(&q.u[at], &q.u[at], of), worst);
        most += root(inner(&gradient[at], &gradient[at], of));
    });
    worst = root(worst);
    for (int c = 0; c < nu; ++c) q.u[c] /= worst;
    reach = inner(along, q.u.data(), nu);
}

}  // namespace

// Solves every point, as assemble_all of compiled_energy.py does.  Returns whether this
// kind of robot is covered: no cone of more than two columns.
EXPORTED int assemble_all(
    const Robot *robot, const Points *points, Solutions *out) {
    Assembler assembler(*robot, *points);
    if (!assembler.covers()) return 0;
    in_blocks(all_of(points->count), [&](const Block &block, Whole pending) {
        return assembler.solve(*points, block, pending, *out);
    });
    return 1;
}

// Margins of every point of a robot without springs, as compiled_zone.py's all_margins.
EXPORTED int all_margins(
    const Robot *robot, const Points *points, Margins *out) {
    Assembler assembler(*robot, *points);
    if (robot->ng || !assembler.covers()) return 0;
    in_blocks(all_of(points->count), [&](const Block &block, Whole pending) {
        return assembler.margins(*points, block, pending, *out);
    });
    return 1;
}

// Compliances of every point, as compiled_compliance.py's comply_all.
EXPORTED int comply_all(const Robot *robot, const Points *points, Compliances *out) {
    Assembler assembler(*robot, *points);
    in_blocks(all_of(points->count), [&](const Block &block, Whole pending) {
        return assembler.comply(*points, block, pending, *out);
    });
    return 1;
}
