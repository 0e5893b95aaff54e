// Residuals of a robot's closures and of its platform's pose in every lane, and the
// step of Newton's method that reduces them.
#pragma once

#include "../records.h"
#include "../solvers/block.h"
#include "../solvers/rotations.h"

namespace LANE_SPACE {

// least ratio of a pivot to the damping with which a step is determined
constexpr double CLEAR = 1e4;

namespace {

// An unknown joint that moves a closure: its row of the Jacobian J and its column of N.
struct Mover {
    int row, column;
};

// Poses of all frames, the residuals r, their Jacobian J, and the step x that reduces
// r.  N is the normal matrix J^T J.  R and p are rotations and origins of the frames
// before the motion of their own joints; after_R and after_p those after it.
class Motion {
public:
    Motion(const Tree &tree, const Targets &targets);

protected:
    const Tree &tree;
    const Targets &targets;
    const int n, closures;
    const bool posed;
    // unknown joints; column of each frame's joint or -1
    std::vector<int> joints, columns;
    std::vector<double> unit;
    // columns after i that are coupled with row i of N
    std::vector<std::vector<int>> coupled;
    // unknown joints of each closure, then of the platform
    std::vector<std::vector<Mover>> movers;
    std::vector<bool> straight;  // frames that are not rotated in their parents
    bool requested[6], all_turns, turns;
    Row q, R, p, after_R, after_p, r, J, x;
    Table N;
    // required pose of the platform: vector, rotation matrix
    Real pose[6] = {}, turn[9] = {};

    void forward();
    void equations();
    Whole least_step(Real damped);

private:
    void couple();
    void platform_turn(int first, int last, Real *out);
};

Motion::Motion(const Tree &tree, const Targets &targets)
    : tree(tree), targets(targets), n(tree.n), closures(tree.closures),
      posed(targets.poses != nullptr), columns(n, -1), q(n), R(9 * n), p(3 * n),
      after_R(9 * n), after_p(3 * n), r(6 * closures + 6),
      J(6 * tree.groups[closures + 1]), N(n, n) {
    for (int j = 0; j < n; ++j)
        if (tree.kinds[j] && !(targets.count && std::isfinite(targets.held[j]))) {
            columns[j] = joints.size();
            joints.push_back(j);
            unit.push_back(tree.kinds[j] == 2 ? tree.size : 1.0);
        }
    x.resize(joints.size());
    for (int k = 0; k < 6; ++k)
        requested[k] = posed && targets.count && std::isfinite(targets.poses[k]);
    all_turns = requested[3] && requested[4] && requested[5];
    turns = requested[3] || requested[4] || requested[5];
    couple();
    for (int i = 0; i < n; ++i) {
        bool identity = true;
        for (int k = 0; k < 9; ++k)
            identity = identity && tree.fixed[16 * i + k / 3 * 4 + k % 3] == (k % 4 == 0);
        straight.push_back(identity);
    }
}

// Find the unknown joints that move each closure, and the entries of N that can differ
// from zero: joints of one closure are coupled, and the elimination couples further
// ones.
void Motion::couple() {
    const int m = joints.size();
    std::vector<std::vector<char>> entered(m, std::vector<char>(m, 0));
    for (int g = 0; g < closures + posed; ++g) {
        movers.emplace_back();
        for (int e = tree.groups[g]; e < tree.groups[g + 1]; ++e)
            if (columns[tree.moves[2 * e]] >= 0)
                movers[g].push_back({e, columns[tree.moves[2 * e]]});
        for (const Mover &a : movers[g])
            for (const Mover &b : movers[g]) entered[a.column][b.column] = 1;
    }
    coupled.resize(m);
    for (int i = 0; i < m; ++i) {
        for (int k = i + 1; k < m; ++k)
            if (entered[i][k]) coupled[i].push_back(k);
        for (int k : coupled[i])
            for (int j : coupled[i]) entered[k][j] = 1;
    }
}

// Compute the rotations and origins of all frames, before and after their own motion.
void Motion::forward() {
    for (int i = 0; i < n; ++i) {
        const double *fixed = tree.fixed + 16 * i;
        Real *rotation = &R[9 * i], *at = &p[3 * i];
        if (tree.parents[i] < 0) {
            for (int k = 0; k < 9; ++k) rotation[k] = real(fixed[k / 3 * 4 + k % 3]);
            for (int k = 0; k < 3; ++k) at[k] = real(fixed[4 * k + 3]);
        } else {
            const int64_t parent = tree.parents[i];
            const bool turns_on = tree.kinds[parent] == 1;
            const bool slides_on = tree.kinds[parent] == 2 || tree.leads[parent] != 0.0;
            const Real *A = turns_on ? &after_R[9 * parent] : &R[9 * parent];
            const Real *o = slides_on ? &after_p[3 * parent] : &p[3 * parent];
            for (int k = 0; k < 3; ++k) {
                const Real a = A[3 * k], b = A[3 * k + 1], c = A[3 * k + 2];
                at[k] = o[k] + a * fixed[3] + b * fixed[7] + c * fixed[11];
                if (straight[i])
                    rotation[3 * k] = a, rotation[3 * k + 1] = b, rotation[3 * k + 2] = c;
                else
                    for (int l = 0; l < 3; ++l)
                        rotation[3 * k + l] =
                            a * fixed[l] + b * fixed[4 + l] + c * fixed[8 + l];
            }
        }
        if (tree.kinds[i] == 1) {
            Real s, c, *A = &after_R[9 * i];
            sine_cosine(q[i], &s, &c);
            for (int k = 0; k < 3; ++k) {
                const Real a = rotation[3 * k], b = rotation[3 * k + 1];
                A[3 * k] = c * a + s * b, A[3 * k + 1] = c * b - s * a;
                A[3 * k + 2] = rotation[3 * k + 2];
            }
            if (const double lead = tree.leads[i])
                for (int k = 0; k < 3; ++k)
                    after_p[3 * i + k] = at[k] + lead * q[i] * rotation[3 * k + 2];
        } else if (tree.kinds[i] == 2) {
            for (int k = 0; k < 3; ++k)
                after_p[3 * i + k] = at[k] + q[i] * rotation[3 * k + 2];
        }
    }
}

// Compute the scaled residuals and their derivatives, six numbers for each row of
// `moves`. Lengths are divided by the reference length.
void Motion::equations() {
    const double scale = 1.0 / tree.size;
    for (int g = 0; g < closures + posed; ++g) {
        const int64_t a = g < closures ? tree.pairs[2 * g] : tree.platform;
        const Real *origin = &p[3 * a];
        if (g < closures) {
            const int64_t b = tree.pairs[2 * g + 1];
            rotation_between(&R[9 * a], &R[9 * b], &r[6 * g]);
            for (int k = 0; k < 3; ++k)
                r[6 * g + 3 + k] = (origin[k] - p[3 * b + k]) * scale;
        }
        for (int e = tree.groups[g]; e < tree.groups[g + 1]; ++e) {
            const int64_t j = tree.moves[2 * e];
            if (columns[j] < 0) continue;
            const double factor = tree.moves[2 * e + 1] * unit[columns[j]];
            Real *row = &J[6 * e], v[3];
            for (int k = 0; k < 3; ++k) v[k] = factor * R[9 * j + 3 * k + 2];
            if (tree.kinds[j] == 1) {
                const Real *o = &p[3 * j];
                const Real d[3] = {origin[0] - o[0], origin[1] - o[1], origin[2] - o[2]};
                for (int k = 0; k < 3; ++k) row[k] = v[k];
                row[3] = (v[1] * d[2] - v[2] * d[1]) * scale;
                row[4] = (v[2] * d[0] - v[0] * d[2]) * scale;
                row[5] = (v[0] * d[1] - v[1] * d[0]) * scale;
                if (const double lead = tree.leads[j])
                    for (int k = 0; k < 3; ++k) row[3 + k] += v[k] * (lead * scale);
            } else {
                for (int k = 0; k < 3; ++k) row[k] = Real{}, row[3 + k] = v[k] * scale;
            }
        }
    }
    if (!posed) return;
    const int first = tree.groups[closures], last = tree.groups[closures + 1];
    Real *out = &r[6 * closures];
    platform_turn(first, last, out);
    for (int k = 0; k < 3; ++k) out[3 + k] = (p[3 * tree.platform + k] - pose[k]) * scale;
    for (int k = 0; k < 6; ++k)
        if (!requested[(k + 3) % 6]) {
            out[k] = Real{};
            for (int e = first; e < last; ++e) J[6 * e + k] = Real{};
        }
}

// Compute the rotation from the required to the current orientation of the platform,
// and its derivatives.  If all three rotations are required, the residual is regular
// near half a turn, too.
void Motion::platform_turn(int first, int last, Real *out) {
    const Real *rotation = &R[9 * tree.platform];
    if (all_turns) {
        rotation_between(rotation, turn, out);
        return;
    }
    if (!turns) return;
    Real left[9];
    for (int l = 0; l < LANES; ++l) {
        double A[9], vector[3];
        for (int k = 0; k < 9; ++k) A[k] = rotation[k][l];
        rotation_log(A, vector);
        for (int k = 0; k < 3; ++k) out[k][l] = vector[k] - pose[3 + k][l];
        inverse_left_jacobian(vector, A);
        for (int k = 0; k < 9; ++k) left[k][l] = A[k];
    }
    for (int e = first; e < last; ++e) {
        Real *row = &J[6 * e];
        const Real a = row[0], b = row[1], c = row[2];
        for (int k = 0; k < 3; ++k)
            row[k] = left[3 * k] * a + left[3 * k + 1] * b + left[3 * k + 2] * c;
    }
}

// Compute the least-squares step x; the damping selects the one of least norm.
// Return the lanes in which all joints are determined.
Whole Motion::least_step(Real damped) {
    const int m = joints.size();
    for (int i = 0; i < m; ++i) {
        x[i] = N[i][i] = Real{};
        for (int j : coupled[i]) N[i][j] = Real{};
    }
    for (int g = 0; g < closures + posed; ++g) {
        const Real *open = &r[6 * g];
        for (size_t a = 0; a < movers[g].size(); ++a) {
            const Real *row = &J[6 * movers[g][a].row];
            const int i = movers[g][a].column;
            Real number[6];
            for (int k = 0; k < 6; ++k) {
                number[k] = once(row[k]);
                x[i] += number[k] * open[k];
            }
            for (size_t b = 0; b <= a; ++b) {
                const Real *other = &J[6 * movers[g][b].row];
                Real even = number[0] * other[0], odd = number[1] * other[1];
                even += number[2] * other[2], odd += number[3] * other[3];
                even += number[4] * other[4], odd += number[5] * other[5];
                N[movers[g][b].column][i] += even + odd;
            }
        }
    }
    Real damping = real(1e-30);
    for (int i = 0; i < m; ++i) damping += damped * N[i][i];
    Whole determined = whole(-1);
    for (int i = 0; i < m; ++i) {  // N = U^T D U
        Real *row = N[i];
        const Real pivot = row[i] + damping;
        determined &= pivot > CLEAR * damping;
        const Real inverse = 1.0 / larger(pivot, 0.1 * damping);
        const std::vector<int> &entered = coupled[i];
        const int count = entered.size();
        for (int a = 0; a < count; ++a) {
            const int k = entered[a];
            const Real factor = once(row[k] * inverse);
            Real *to = N[k];
            for (int b = a; b < count; ++b) to[entered[b]] -= factor * row[entered[b]];
            x[k] -= factor * x[i];
            row[k] = factor;
        }
        x[i] *= inverse;
    }
    for (int i = m - 1; i >= 0; --i)
        for (int j : coupled[i]) x[i] -= N[i][j] * x[j];
    return determined;
}

}  // namespace

}  // namespace LANE_SPACE
