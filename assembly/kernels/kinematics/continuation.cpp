// Continuation to several targets in parallel.  Each lane follows one target, and takes
// the next target at the end.  A round is one iteration of Newton's method in every lane;
// each lane decides on its result independently.
#include "../kernels.h"
#include "motion.h"

using namespace LANE_SPACE;

constexpr double SOLVED = 1e-10;  // scaled residual of a configuration that is solved
constexpr double ROUNDED = 1e-5;  // accepted residual if it does not decrease further
constexpr double NEAR = 1e-4;     // accepted residual before the last step
constexpr double JUMP = 0.4;  // [rad or lengths] largest step: keeps the assembly mode
constexpr double FAR = 1.0;   // largest step if the tangent predicts the whole step
constexpr double LONG = 0.7;  // step tried by the tangent, as a share of the largest
constexpr double SHORT = 0.03;  // share of the path: below it steps are short
// first step on difficult paths, and if the target does not determine all joints
constexpr double FIRST_STEP = 0.125;
constexpr double CURVED = 0.25;  // largest correction, as a share of the tangent's step
// damping, as a share of the normal matrix' trace: if all joints are determined, and if
// some are not. Rounding errors move undetermined joints by their size over the damping;
// with less damping their positions would depend on the processor
constexpr double LEAST = 1e-13, SPREAD = 1e-9;
constexpr double SMALLEST_STEP = 1e-5;
constexpr int NEWTON = 12;  // iterations; quadratic convergence needs about 4
constexpr double ENDLESS = HUGE_VAL;

namespace {

// After an iteration Newton's method continues, begins another step, or the track ends.
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

// Target and progress of one lane.
struct Lane {
    int64_t target = -1;
    double done, step, goal, jump, ahead, before, first;
    bool careful;
    int iteration;
    std::vector<double> q;  // coordinates reached
};

class Follower : Motion {
public:
    Follower(const Tree &tree, const Targets &targets);

    void follow(Tracks &out);
    void frames(Tracks &out);

private:
    const double longest;
    double home_pose[6];
    Lane lanes[LANES];

    void start(int l, int64_t target);
    void begin(int l);
    Next next(int l, bool fine, bool determined);
    Next iterate(int l, double worst, double largest, bool determined);
};

Follower::Follower(const Tree &tree, const Targets &targets)
    : Motion(tree, targets), longest(tree.size > 1.0 ? tree.size : 1.0) {
    for (int j = 0; j < n; ++j) q[j] = real(targets.start[j]);
    forward();
    double home[9];
    for (int k = 0; k < 9; ++k) home[k] = R[9 * tree.platform + k][0];
    for (int k = 0; k < 3; ++k) home_pose[k] = p[3 * tree.platform + k][0];
    rotation_log(home, home_pose + 3);
    for (Lane &lane : lanes) lane.q.resize(n);
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

// Newton's method from the lane's coordinates to the end of its step.
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

// Result of Newton's method: a completed step, or a shorter one.
Next Follower::next(int l, bool fine, bool determined) {
    Lane &lane = lanes[l];
    if (!lane.careful && (!determined || lane.step < SHORT)) {
        // the path is difficult: short steps from here on
        lane.careful = true, lane.jump = JUMP * longest;
        if (!determined) {
            // and the result depends on the whole path
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

// Use of an iteration's result in one lane; GOES_ON continues Newton's method.
Next Follower::iterate(int l, double worst, double largest, bool determined) {
    Lane &lane = lanes[l];
    if (lane.goal < 1.0 && !lane.careful && worst < NEAR) return next(l, true, true);
    if (lane.iteration == 0 && !lane.careful) {
        for (size_t i = 0; i < joints.size(); ++i)
            lane.ahead = std::fmax(lane.ahead, std::fabs(x[i][l] * unit[i]));
        if (lane.ahead > lane.jump || !determined) return next(l, false, determined);
    }
    if (lane.iteration == 1 && !lane.careful && largest > CURVED * lane.first)
        return next(l, false, true);  // the tangent predicts badly: a shorter step
    lane.first = std::fmax(lane.first, largest);
    const double part = 0.5 / std::fmax(0.5, largest);
    const bool still = largest < 1e-9;
    for (size_t i = 0; i < joints.size(); ++i)
        q[joints[i]][l] -= x[i][l] * part * unit[i];
    if (worst < 1e-14 || still || !std::isfinite(worst))
        // solved, or as well as an overconstrained robot from a file with rounded numbers
        // can be
        return next(l, worst < SOLVED || (still && worst < ROUNDED), true);
    if (worst > ROUNDED && worst > 0.7 * lane.before)
        return next(l, false, true);  // no convergence: try a smaller step
    lane.before = worst;
    return ++lane.iteration < NEWTON ? GOES_ON : next(l, worst < SOLVED, true);
}

void Follower::follow(Tracks &out) {
    if (!targets.count) return;
    int64_t waiting = std::min<int64_t>(LANES, targets.count);
    for (int l = 0; l < LANES; ++l) {
        start(l, std::min<int64_t>(l, waiting - 1));
        if (l >= waiting) lanes[l].target = -1;  // the lane is idle
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

// Results at the ends of the tracks: rotations and origins of frames, open closures.
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

void follow_all(const Tree &tree, const Targets &targets, Tracks &out) {
    Follower follower(tree, targets);
    follower.follow(out);
    follower.frames(out);
}
