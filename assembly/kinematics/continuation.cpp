// Continuation to several targets side by side: compiled_continuation.py in lanes.
//
// Each lane follows a target of its own, and takes the next one where its own ends.  A
// round is one iteration of Newton's method in every lane; what comes of it each lane
// decides for itself.
#include <algorithm>

#include "../solvers/cpp/block.h"
#include "../solvers/cpp/rotations.h"

// assembly/kinematics/compiled_continuation.py, which says what they are
constexpr double SOLVED = 1e-10, ROUNDED = 1e-5, NEAR = 1e-4, JUMP = 0.4, FAR = 1.0;
constexpr double LONG = 0.7, SHORT = 0.03, FIRST_STEP = 0.125, CURVED = 0.25;
constexpr double LEAST = 1e-13, SPREAD = 1e-9, CLEAR = 1e4, SMALLEST_STEP = 1e-5;
constexpr int NEWTON = 12;
constexpr double ENDLESS = HUGE_VAL;

// compiled_continuation.py's Tree, and how many there are.
struct Tree {
    int64_t n, closures, platform;
    double size;
    const int64_t *parents, *kinds, *pairs, *moves, *groups;
    const double *fixed;
};

// (n,) coordinates at home, (k, 6) poses, if any, and (k, n) coordinates held, NaN where
// free: the same entries in every row.
struct Targets {
    int64_t count;
    const double *start, *poses, *held;
    int64_t guess;
};

// (k, n) coordinates, (k,) progress, (k, n, 4, 4) frames, (k, closures) left open.
struct Tracks {
    double *ends, *progress, *transforms, *still_open;
};

namespace {

// After an iteration Newton's method goes on, begins on another step, or the track ended.
enum Next { GOES_ON, BEGINS, ENDED };

// Largest absolute number, NaN if one is NaN.
inline Real largest_of(const Real *v, int count) {
    Real largest = {}, total = {};
    for (int i = 0; i < count; ++i) {
        largest = larger(magnitude(v[i]), largest);
        total += v[i];
    }
    return total == total ? largest : total;
}

// What one lane follows, and how far it has come.
struct Lane {
    int64_t target = -1;
    double done, step, goal, jump, ahead, before, first;
    bool careful;
    int iteration;
    std::vector<double> q;  // where it stands
};

// A joint that is solved for and moves a closure: its row of J, and its column of N.
struct Mover {
    int row, column;
};

class Follower {
public:
    Follower(const Tree &tree, const Targets &targets);

    void follow(Tracks &out);
    void frames(Tracks &out);

private:
    const Tree &tree;
    const Targets &targets;
    const int n, closures;
    const bool posed;
    const double longest;
    std::vector<int> joints, columns;  // solved for; -1 for the others
    std::vector<double> unit;
    std::vector<std::vector<int>> coupled;  // later columns that a row of N enters
    std::vector<std::vector<Mover>> movers;  // of each closure, then of the platform
    std::vector<bool> straight;             // frames that are not turned in their parents
    bool asked[6], all_turns, turns;
    double home_pose[6];
    Lane lanes[LANES];
    Row q, R, p, after_R, after_p, r, J, x;
    Table N;
    Real pose[6] = {}, turn[9] = {};  // of the platform, asked for on the way

    void couple();
    void start(int l, int64_t target);
    void begin(int l);
    Next next(int l, bool fine, bool determined);
    void forward();
    void equations();
    void platform_turn(int first, int last, Real *out);
    Whole least_step(Real damped);
    Next iterate(int l, double worst, double largest, bool determined);
};

Follower::Follower(const Tree &tree, const Targets &targets)
    : tree(tree), targets(targets), n(tree.n), closures(tree.closures),
      posed(targets.poses != nullptr), longest(tree.size > 1.0 ? tree.size : 1.0),
      columns(n, -1), q(n), R(9 * n), p(3 * n), after_R(9 * n), after_p(3 * n),
      r(6 * closures + 6), J(6 * tree.groups[closures + 1]), N(n, n) {
    for (int j = 0; j < n; ++j)
        if (tree.kinds[j] && !(targets.count && std::isfinite(targets.held[j]))) {
            columns[j] = joints.size();
            joints.push_back(j);
            unit.push_back(tree.kinds[j] == 2 ? tree.size : 1.0);
        }
    x.resize(joints.size());
    for (int k = 0; k < 6; ++k)
        asked[k] = posed && targets.count && std::isfinite(targets.poses[k]);
    all_turns = asked[3] && asked[4] && asked[5];
    turns = asked[3] || asked[4] || asked[5];
    couple();
    for (int i = 0; i < n; ++i) {
        bool identity = true;
        for (int k = 0; k < 9; ++k)
            identity = identity && tree.fixed[16 * i + k / 3 * 4 + k % 3] == (k % 4 == 0);
        straight.push_back(identity);
    }
    for (int j = 0; j < n; ++j) q[j] = real(targets.start[j]);
    forward();
    double home[9];
    for (int k = 0; k < 9; ++k) home[k] = R[9 * tree.platform + k][0];
    for (int k = 0; k < 3; ++k) home_pose[k] = p[3 * tree.platform + k][0];
    rotation_log(home, home_pose + 3);
    for (Lane &lane : lanes) lane.q.resize(n);
}

// Joints that move the same closure, and those that elimination couples.
void Follower::couple() {
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

void Follower::start(int l, int64_t target) {
    Lane &lane = lanes[l];
    lane.target = target;
    lane.careful = targets.guess;
    lane.jump = targets.guess ? ENDLESS : FAR * longest;
    lane.done = 0.0, lane.step = 1.0;
    lane.q.assign(targets.start, targets.start + n);
    begin(l);
}

// Newton's method, from where the lane stands to as far as its step goes.
void Follower::begin(int l) {
    Lane &lane = lanes[l];
    lane.goal = std::fmin(1.0, lane.done + lane.step);
    lane.iteration = 0, lane.before = ENDLESS, lane.first = 0.0, lane.ahead = 0.0;
    const double *held = targets.held + lane.target * n;
    for (int j = 0; j < n; ++j) {
        q[j][l] = lane.q[j];
        if (columns[j] >= 0 || !std::isfinite(held[j])) continue;
        double goal = held[j];
        if (lane.goal < 1.0)
            goal = targets.start[j] + lane.goal * (held[j] - targets.start[j]);
        lane.ahead = std::fmax(lane.ahead, std::fabs(goal - lane.q[j]));
        q[j][l] = goal;
    }
    if (!posed) return;
    double own[6];
    for (int k = 0; k < 6; ++k) {
        own[k] = targets.poses[lane.target * 6 + k];
        if (lane.goal < 1.0) own[k] = home_pose[k] + lane.goal * (own[k] - home_pose[k]);
        pose[k][l] = own[k];
    }
    if (all_turns) {
        double A[9];
        rotation_exp(own + 3, A);
        for (int k = 0; k < 9; ++k) turn[k][l] = A[k];
    }
}

// After Newton's method: a step that is done, or a shorter one.
Next Follower::next(int l, bool fine, bool determined) {
    Lane &lane = lanes[l];
    if (!lane.careful && (!determined || lane.step < SHORT)) {
        // the way is hard: by short steps from here on
        lane.careful = true, lane.jump = JUMP * longest;
        if (!determined) {
            // and where it ends depends on all of the way
            lane.q.assign(targets.start, targets.start + n);
            lane.done = 0.0, lane.step = FIRST_STEP;
        }
    } else {
        for (int j = 0; j < n; ++j)
            // a jump, or a coordinate that is NaN: another assembly mode
            fine = fine && std::fabs(q[j][l] - lane.q[j]) < lane.jump;
        if (fine || targets.guess)
            for (int j = 0; j < n; ++j) lane.q[j] = q[j][l];
        if (fine) lane.done = lane.goal;
        if (targets.guess) {
            lane.done = fine ? 1.0 : 0.0;
            return ENDED;
        }
        double factor = fine ? 2.0 : 0.5;
        if (!lane.careful && (fine || lane.ahead > lane.jump))
            factor = std::fmin(4.0, LONG * lane.jump / std::fmax(lane.ahead, 1e-9));
        lane.step *= factor;
    }
    return lane.done < 1.0 && lane.step > SMALLEST_STEP ? BEGINS : ENDED;
}

// Rotations and origins of all frames before their own motion.
void Follower::forward() {
    for (int i = 0; i < n; ++i) {
        const double *fixed = tree.fixed + 16 * i;
        Real *own = &R[9 * i], *at = &p[3 * i];
        if (tree.parents[i] < 0) {
            for (int k = 0; k < 9; ++k) own[k] = real(fixed[k / 3 * 4 + k % 3]);
            for (int k = 0; k < 3; ++k) at[k] = real(fixed[4 * k + 3]);
        } else {
            const int64_t parent = tree.parents[i];
            const bool turns_on = tree.kinds[parent] == 1, slides_on = tree.kinds[parent] == 2;
            const Real *A = turns_on ? &after_R[9 * parent] : &R[9 * parent];
            const Real *o = slides_on ? &after_p[3 * parent] : &p[3 * parent];
            for (int k = 0; k < 3; ++k) {
                const Real a = A[3 * k], b = A[3 * k + 1], c = A[3 * k + 2];
                at[k] = o[k] + a * fixed[3] + b * fixed[7] + c * fixed[11];
                if (straight[i])
                    own[3 * k] = a, own[3 * k + 1] = b, own[3 * k + 2] = c;
                else
                    for (int l = 0; l < 3; ++l)
                        own[3 * k + l] = a * fixed[l] + b * fixed[4 + l] + c * fixed[8 + l];
            }
        }
        if (tree.kinds[i] == 1) {
            Real s, c, *A = &after_R[9 * i];
            sine_cosine(q[i], &s, &c);
            for (int k = 0; k < 3; ++k) {
                const Real a = own[3 * k], b = own[3 * k + 1];
                A[3 * k] = c * a + s * b, A[3 * k + 1] = c * b - s * a;
                A[3 * k + 2] = own[3 * k + 2];
            }
        } else if (tree.kinds[i] == 2) {
            for (int k = 0; k < 3; ++k) after_p[3 * i + k] = at[k] + q[i] * own[3 * k + 2];
        }
    }
}

// Scaled residuals and, six numbers for each of the tree's moves, their derivatives.
void Follower::equations() {
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
        if (!asked[(k + 3) % 6]) {
            out[k] = Real{};
            for (int e = first; e < last; ++e) J[6 * e + k] = Real{};
        }
}

// The turn that the platform lacks: regular near half a turn where all of it is given.
void Follower::platform_turn(int first, int last, Real *out) {
    const Real *own = &R[9 * tree.platform];
    if (all_turns) {
        rotation_between(own, turn, out);
        return;
    }
    if (!turns) return;
    Real left[9];
    for (int l = 0; l < LANES; ++l) {
        double A[9], vector[3];
        for (int k = 0; k < 9; ++k) A[k] = own[k][l];
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

// Least-squares step x, of least norm by damping; where it is determined without.
Whole Follower::least_step(Real damped) {
    const int m = joints.size();
    for (int i = 0; i < m; ++i) {
        x[i] = N[i][i] = Real{};
        for (int j : coupled[i]) N[i][j] = Real{};
    }
    for (int g = 0; g < closures + posed; ++g) {
        const Real *open = &r[6 * g];
        for (size_t a = 0; a < movers[g].size(); ++a) {
            const Real *own = &J[6 * movers[g][a].row];
            const int i = movers[g][a].column;
            Real number[6];
            for (int k = 0; k < 6; ++k) {
                number[k] = once(own[k]);
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
    for (int i = 0; i < m; ++i) {  // U^T D U
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

// What one lane does with its iteration; Newton's method goes on only if it says so.
Next Follower::iterate(int l, double worst, double largest, bool determined) {
    Lane &lane = lanes[l];
    if (lane.goal < 1.0 && !lane.careful && worst < NEAR) return next(l, true, true);
    if (lane.iteration == 0 && !lane.careful) {
        for (size_t i = 0; i < joints.size(); ++i)
            lane.ahead = std::fmax(lane.ahead, std::fabs(x[i][l] * unit[i]));
        if (lane.ahead > lane.jump || !determined) return next(l, false, determined);
    }
    if (lane.iteration == 1 && !lane.careful && largest > CURVED * lane.first)
        return next(l, false, true);  // the tangent is no guide: a shorter step
    lane.first = std::fmax(lane.first, largest);
    const double part = 0.5 / std::fmax(0.5, largest);
    const bool still = largest < 1e-9;
    for (size_t i = 0; i < joints.size(); ++i)
        q[joints[i]][l] -= x[i][l] * part * unit[i];
    if (worst < 1e-14 || still || !std::isfinite(worst))
        // solved, or as well as a rounded overconstrained file can be
        return next(l, worst < SOLVED || (still && worst < ROUNDED), true);
    if (worst > ROUNDED && worst > 0.7 * lane.before)
        return next(l, false, true);  // it does not converge: try a smaller step
    lane.before = worst;
    return ++lane.iteration < NEWTON ? GOES_ON : next(l, worst < SOLVED, true);
}

void Follower::follow(Tracks &out) {
    if (!targets.count) return;
    int64_t waiting = std::min<int64_t>(LANES, targets.count);
    for (int l = 0; l < LANES; ++l) {
        start(l, std::min<int64_t>(l, waiting - 1));
        if (l >= waiting) lanes[l].target = -1;  // rests
    }
    bool running = true;
    while (running) {
        forward();
        equations();
        Real damped;
        for (int l = 0; l < LANES; ++l) damped[l] = lanes[l].careful ? SPREAD : LEAST;
        const Whole determined = least_step(damped);
        const Real worst = largest_of(r.data(), 6 * (closures + posed));
        const Real largest = largest_of(x.data(), x.size());
        running = false;
        for (int l = 0; l < LANES; ++l) {
            Lane &lane = lanes[l];
            if (lane.target < 0) continue;
            const Next then = iterate(l, worst[l], largest[l], determined[l]);
            if (then == ENDED) {
                std::copy_n(lane.q.data(), n, out.ends + lane.target * n);
                out.progress[lane.target] = lane.done;
                if (waiting < targets.count)
                    start(l, waiting++);
                else
                    lane.target = -1;
            } else if (then == BEGINS) {
                begin(l);
            }
            running = running || lane.target >= 0;
        }
    }
}

// Where tracks end: rotations and origins of all frames, what stays open of closures.
void Follower::frames(Tracks &out) {
    in_blocks(all_of(targets.count), [&](const Block &block, Whole inside) {
        for (int j = 0; j < n; ++j) q[j] = block.read(out.ends, n, j);
        forward();
        for (int j = 0; j < n; ++j)
            for (int k = 0; k < 12; ++k) {
                const Real own = k % 4 < 3 ? R[9 * j + k / 4 * 3 + k % 4] : p[3 * j + k / 4];
                block.write(out.transforms, 16 * n, 16 * j + k, own, inside);
            }
        for (int c = 0; c < closures; ++c) {
            const int64_t a = tree.pairs[2 * c], b = tree.pairs[2 * c + 1];
            Real open[6];
            rotation_between(&R[9 * a], &R[9 * b], open);
            for (int k = 0; k < 3; ++k) open[3 + k] = p[3 * a + k] - p[3 * b + k];
            block.write(out.still_open, closures, c, largest_of(open, 6), inside);
        }
        return Whole{};
    });
}

}  // namespace

// Follows every target along its straight line, as follow_all does.
EXPORTED void follow_all(const Tree *tree, const Targets *targets, Tracks *out) {
    Follower follower(*tree, *targets);
    follower.follow(*out);
    follower.frames(*out);
}
