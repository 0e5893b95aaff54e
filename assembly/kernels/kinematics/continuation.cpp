// Continuation of a robot's configuration to several targets in parallel.
//
// A target prescribes joint coordinates or a platform pose.  The path to it is a
// straight line from the home configuration; its share that is done grows from 0 to 1
// in steps.  At the end of each step Newton's method solves the closures.  Each lane
// follows one target, and starts the next target when it has finished.  One round is
// one iteration of Newton's method in every lane; what follows from its result is
// decided in each lane separately.
#include "../kernels.h"
#include "motion.h"

using namespace LANE_SPACE;

constexpr double SOLVED = 1e-10;  // largest scaled residual of a solved configuration
constexpr double ROUNDED = 1e-5;  // largest residual if it does not decrease further
// largest residual at the end of a step that is not the last
constexpr double NEAR = 1e-4;
// [rad or lengths] largest step that keeps the assembly mode
constexpr double JUMP = 0.4;
constexpr double FAR = 1.0;  // [rad or lengths] largest step if the tangent predicts it
// step predicted by the tangent, as a share of the largest step
constexpr double LONG = 0.7;
// share of the path; a path with smaller steps is difficult
constexpr double SHORT = 0.03;
// first step, as a share of the path, on difficult paths and where the target does not
// determine all joints
constexpr double FIRST_STEP = 0.125;
constexpr double CURVED = 0.25;  // largest correction, as a share of the predicted step
// damping, as a share of the trace of the normal matrix: LEAST if the target determines
// all joints, SPREAD if not.  Rounding errors move an undetermined joint by their size
// divided by the damping.  With less damping its position would depend on the processor
constexpr double LEAST = 1e-13, SPREAD = 1e-9;
// share of the path below which a step fails
constexpr double SMALLEST_STEP = 1e-5;
// largest number of iterations; quadratic convergence needs about 4
constexpr int NEWTON = 12;
constexpr double ENDLESS = HUGE_VAL;

namespace {

// State of a lane after an iteration: Newton's method continues, another step begins,
// or the lane has finished its target.
enum Next { GOES_ON, BEGINS, ENDED };

// Return the largest absolute value, or NaN if a number is NaN.
inline Real largest_of(const Real *v, int count) {
    Real largest = {}, total = {};
    for (int i = 0; i < count; ++i) {
        largest = larger(magnitude(v[i]), largest);
        total += v[i];
    }
    return total == total ? largest : total;
}

// Target and progress of one lane.
//
// - done, step, goal: share of the path that is done, step, and share at the step's
//   end,
// - jump: largest change of a joint coordinate in a step, ahead: predicted change,
// - before: previous residual, first: largest change in the first iteration,
// - careful: the path is difficult and its steps are short.
struct Lane {
    int64_t target = -1;
    double done, step, goal, jump, ahead, before, first;
    bool careful;
    int iteration;
    std::vector<double> q;  // joint coordinates that are reached
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

// Start Newton's method at the lane's coordinates, for the configuration at the end of
// its step.
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
    double target_pose[6];
    for (int k = 0; k < 6; ++k) {
        target_pose[k] = targets.poses[lane.target * 6 + k];
        if (lane.goal < 1.0)
            target_pose[k] = home_pose[k] + lane.goal * (target_pose[k] - home_pose[k]);
        pose[k][l] = target_pose[k];
    }
    if (all_turns) {
        double A[9];
        rotation_exp(target_pose + 3, A);
        for (int k = 0; k < 9; ++k) turn[k][l] = A[k];
    }
}

// Accept a step, if `fine`, or shorten it.  If not all joints are determined, the path
// starts again with short steps.
Next Follower::next(int l, bool fine, bool determined) {
    Lane &lane = lanes[l];
    if (!lane.careful && (!determined || lane.step < SHORT)) {
        // the path is difficult: all further steps are short
        lane.careful = true, lane.jump = JUMP * longest;
        if (!determined) {
            // the result depends on the whole path, which starts again
            lane.q.assign(targets.start, targets.start + n);
            lane.done = 0.0, lane.step = FIRST_STEP;
        }
    } else {
        for (int j = 0; j < n; ++j)
            // a large change or a NaN means another assembly mode
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

// Decide in one lane what follows from the result of an iteration: the largest
// residual `worst` and the largest change `largest`.
Next Follower::iterate(int l, double worst, double largest, bool determined) {
    Lane &lane = lanes[l];
    if (lane.goal < 1.0 && !lane.careful && worst < NEAR) return next(l, true, true);
    if (lane.iteration == 0 && !lane.careful) {
        for (size_t i = 0; i < joints.size(); ++i)
            lane.ahead = std::fmax(lane.ahead, std::fabs(x[i][l] * unit[i]));
        if (lane.ahead > lane.jump || !determined) return next(l, false, determined);
    }
    if (lane.iteration == 1 && !lane.careful && largest > CURVED * lane.first)
        return next(l, false, true);  // the tangent predicts badly: use a shorter step
    lane.first = std::fmax(lane.first, largest);
    const double part = 0.5 / std::fmax(0.5, largest);
    const bool still = largest < 1e-9;
    for (size_t i = 0; i < joints.size(); ++i)
        q[joints[i]][l] -= x[i][l] * part * unit[i];
    if (worst < 1e-14 || still || !std::isfinite(worst))
        // solved, or the residual does not decrease further: an overconstrained robot
        // from a file with rounded numbers cannot close exactly
        return next(l, worst < SOLVED || (still && worst < ROUNDED), true);
    if (worst > ROUNDED && worst > 0.7 * lane.before)
        return next(l, false, true);  // no convergence: use a smaller step
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

// Compute the results at the ends of the paths: rotations and origins of the frames,
// and the remaining closure errors.
void Follower::frames(Tracks &out) {
    in_blocks(all_of(targets.count), [&](const Block &block, Whole inside) {
        for (int j = 0; j < n; ++j) q[j] = block.read(out.ends, n, j);
        forward();
        for (int j = 0; j < n; ++j)
            for (int k = 0; k < 12; ++k) {
                const Real entry =
                    k % 4 < 3 ? R[9 * j + k / 4 * 3 + k % 4] : p[3 * j + k / 4];
                block.write(out.transforms, 16 * n, 16 * j + k, entry, inside);
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
