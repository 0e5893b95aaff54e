// The linear model of a robot, (16)-(20), at several postures in parallel: small screws
// of the platform and of the closures.
//
// A virtual joint is a small screw of one frame that a geometric error, a clearance, a
// spring or a free motion of a passive joint causes.  Its column contains the effect of
// a unit motion, in base axes, at the platform's origin.  Frames with equal signs in
// all closures have the same pattern.
//
// ========  =============  ============================================================
// symbol    shape          meaning
// ========  =============  ============================================================
// P         (n, 18)        three unit rotations of each frame about its axes, as screws
//                          of the platform in base axes; translations are divided by
//                          the reference length
// m                        6 closures, the number of rows A of (16)-(20)
// known     (m,)           closure error that the geometric errors cause
// ========  =============  ============================================================
#pragma once

#include "../records.h"
#include "../solvers/block.h"

namespace LANE_SPACE {

// thresholds of ranks: assembly/kinematics/ranks.py
constexpr double RANK = 1e-10, MISMATCH_FACTOR = 30.0, NOISE = 1e-12;

// A closure in which a frame occurs, and the sign of the frame's screw in it.
struct Entry {
    int closure;
    double sign;
};

// The linear model of one robot.  It reads one block of points after another.
class Linearised {
public:
    Linearised(const Robot &s, const Points &points);

protected:
    const Robot &s;
    const int n, m, np, ng, nu, nq;
    Array<Array<Entry>> patterns;
    Array<bool> has_joints, has_errors;  // (n,) virtual joints and errors of a frame
    Table P;                             // see the table; `column` reads it
    // (.., 6) columns of free motions, clearances and springs
    Table motion, clearance, elastic;
    Row known;
    Real screw[6];  // platform screw due to all motions added by `move`
    Real largest_error, largest_spring;

    bool same_posture(const Points &points, const Block &block);
    void read(const Points &points, const Block &block, bool unchanged = false);
    void column(int64_t j, int64_t axis, Real *out) const;
    void move(int64_t pattern, double on_path, const Real *step, Row &open);
    void part(const Real *row, int64_t pattern, Real *out) const;
    Real enters(int c, const Real *part) const;
    Real tolerance(const Points &points, const Block &block) const;
    Real largest_clearance() const;

    // frames and nominal closure error, if all lanes have the same posture; otherwise
    // empty
    std::vector<double> posture;
    int64_t changes = 0;          // number of changes of the posture

private:
    void read_frame(const Points &points, const Block &block, int j, const Real *origin);
    void read_errors(const Points &points, const Block &block, int j);
    void columns();
};

inline Linearised::Linearised(const Robot &s, const Points &points)
    : s(s), n(int(s.n)), m(int(6 * s.closures)), np(int(s.np)), ng(int(s.ng)),
      nu(int(s.nu)), nq(int(s.nq)), patterns(np), has_joints(n), has_errors(n), P(n, 18),
      motion(nq, 6), clearance(nu, 6), elastic(int(s.ny), 6), known(m) {
    for (int g = 0; g < np; ++g)
        for (int k = 0; k < s.closures; ++k)
            if (const double sign = s.patterns[g * s.closures + k])
                patterns[g].push_back({k, sign});
    for (int c = 0; c < nu; ++c) has_joints[s.cone_frame[c]] = true;
    for (int c = 0; c < nq; ++c) has_joints[s.free_frame[c]] = true;
    for (int c = 0; c < s.ny; ++c) has_joints[s.spring_frame[c]] = true;
    // a frame without errors at any point is skipped: it would add exact zeros
    const int64_t sets = points.errors_per_point ? points.count : 1;
    const double *error = points.errors;
    for (int64_t i = 0; i < sets; ++i)
        for (int j = 0; j < n; ++j, error += 6)
            if (!has_errors[j])
                has_errors[j] =
                    std::any_of(error, error + 6, [](double e) { return e != 0.0; });
}

// Return whether all lanes have the same posture as in the previous block.  Quantities
// that depend only on the frames are then known.
inline bool Linearised::same_posture(const Points &points, const Block &block) {
    if (!points.posture_per_point && !posture.empty()) return true;
    const size_t count = 16 * size_t(n);
    const auto frames = [&](int l) {
        return points.T + points.posture_per_point * block.point[l] * count;
    };
    const auto mismatch_of = [&](int l) {
        return points.mismatch[points.posture_per_point * block.point[l]];
    };
    const double *first = frames(0), mismatch = mismatch_of(0);
    const auto same = [&](const double *T, double other) {
        return other == mismatch && std::equal(first, first + count, T);
    };
    for (int l = 1; l < LANES; ++l)
        if (!same(frames(l), mismatch_of(l))) {
            posture.clear(), ++changes;
            return false;
        }
    if (!posture.empty() && same(posture.data(), posture.back())) return true;
    ++changes;
    posture.assign(first, first + count);
    posture.push_back(mismatch);
    return false;
}

// Compute the columns from the poses of the frames, unless the posture is the same.
// Compute the closure error and the platform screw that the frames' errors cause.
inline void Linearised::read(const Points &points, const Block &block, bool unchanged) {
    if (!unchanged) {
        Real origin[3];
        for (int a = 0; a < 3; ++a)
            origin[a] = block.read(
                points.T, points.posture_per_point * n * 16, s.platform * 16 + 4 * a + 3);
        for (int j = 0; j < n; ++j)
            if (has_joints[j] || has_errors[j]) read_frame(points, block, j, origin);
        columns();
    }
    std::fill(known.begin(), known.end(), Real{});
    std::fill(screw, screw + 6, Real{});
    largest_error = Real{};
    for (int j = 0; j < n; ++j)
        if (has_errors[j]) read_errors(points, block, j);
}

// Compute the unit screws of a frame's rotations about its axes.
inline void Linearised::read_frame(
    const Points &points, const Block &block, int j, const Real *origin) {
    const auto entry = [&](int a, int b) {
        return block.read(points.T, points.posture_per_point * n * 16, j * 16 + 4 * a + b);
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

// Add the closure error and the platform screw that the errors of a frame cause.
inline void Linearised::read_errors(const Points &points, const Block &block, int j) {
    Real total[6] = {}, step[6];
    for (int axis = 0; axis < 6; ++axis) {
        const Real error =
            block.read(points.errors, points.errors_per_point * n * 6, j * 6 + axis);
        column(j, axis, step);
        for (int a = axis < 3 ? 0 : 3; a < 6; ++a) {
            step[a] *= error;
            total[a] += step[a];
            largest_error = larger(magnitude(step[a]), largest_error);
        }
    }
    move(s.pattern_of[j], s.on_path[j], total, known);
}

// Compute the unit screw of frame j along `axis`: rotation for 0 to 2, translation for
// 3 to 5.
inline void Linearised::column(int64_t j, int64_t axis, Real *out) const {
    const Real *turned = P[int(j)] + 6 * (axis % 3);
    for (int a = 0; a < 3; ++a) {
        out[a] = axis < 3 ? turned[a] : Real{};
        out[3 + a] = axis < 3 ? turned[3 + a] : turned[a] * (1.0 / s.size);
    }
}

// Compute the columns of free motions, clearances and springs.
inline void Linearised::columns() {
    Real step[6];
    for (int c = 0; c < nq; ++c) {
        column(s.free_frame[c], s.free_axis[c], motion[c]);
        if (const double lead = s.free_lead[c]) {
            column(s.free_frame[c], 5, step);
            for (int a = 0; a < 6; ++a) motion[c][a] += lead * step[a];
        }
    }
    for (int c = 0; c < nu; ++c) {
        column(s.cone_frame[c], s.cone_axis[c], clearance[c]);
        for (int a = 0; a < 6; ++a) clearance[c][a] *= s.cone_size[c];
    }
    largest_spring = Real{};
    for (int c = 0; c < s.ny; ++c) {
        std::fill(elastic[c], elastic[c] + 6, Real{});
        for (int axis = 0; axis < 6; ++axis)
            if (const double weight = s.springs[6 * c + axis]) {
                column(s.spring_frame[c], axis, step);
                for (int a = 0; a < 6; ++a) elastic[c][a] += weight * step[a];
            }
        for (int a = 0; c < s.groups[ng] && a < 6; ++a)
            largest_spring = larger(magnitude(elastic[c][a]), largest_spring);
    }
}

// Add a small screw of a frame to the platform screw and to the closure error.
inline void Linearised::move(int64_t pattern, double on_path, const Real *step, Row &open) {
    if (on_path)
        for (int a = 0; a < 6; ++a) screw[a] += on_path * step[a];
    for (const Entry &e : patterns[pattern])
        for (int a = 0; a < 6; ++a) open[6 * e.closure + a] += e.sign * step[a];
}

// Compute the wrench on frames of a pattern from wrenches `row` (m,) on the closures.
inline void Linearised::part(const Real *row, int64_t pattern, Real *out) const {
    Real total[6] = {};
    for (const Entry &e : patterns[pattern])
        for (int a = 0; a < 6; ++a) total[a] += e.sign * row[6 * e.closure + a];
    std::copy(total, total + 6, out);
}

// Return the scalar product of the column of clearance c with `part`, a result of the
// function `part` for the clearance's pattern.
inline Real Linearised::enters(int c, const Real *part) const {
    Real total = {};
    for (int a = s.cone_axis[c] < 3 ? 0 : 3; a < 6; ++a) total += clearance[c][a] * part[a];
    return total;
}

// Return the relative threshold of ranks.  It contains the nominal closure error of
// the frames.
inline Real Linearised::tolerance(const Points &points, const Block &block) const {
    return RANK +
           MISMATCH_FACTOR * block.read(points.mismatch, points.posture_per_point, 0);
}

// Return the largest entry of the clearances' closure columns, for the noise floor.
inline Real Linearised::largest_clearance() const {
    Real largest = {};
    for (int c = 0; c < nu; ++c)
        for (const Entry &e : patterns[s.pattern_of[s.cone_frame[c]]])
            for (int a = 0; a < 6; ++a)
                largest = larger(magnitude(e.sign * clearance[c][a]), largest);
    return largest;
}

}  // namespace LANE_SPACE
