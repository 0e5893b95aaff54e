// The linear model of a robot, (16)-(20), at several postures in parallel: motions of the
// platform and of the closures.
//
// ========  =============  ============================================================
// symbol    shape          meaning
// ========  =============  ============================================================
// P         (n, 6, 6)      row `axis`: unit screw of frame j along it, read at the
//                          platform in base axes, translations by the reference length;
//                          of the slides only what the turns say is kept
// m                        6 closures, the rows A of (16)-(20)
// known     (m,)           closure error that the geometric errors cause
// ========  =============  ============================================================
#pragma once

#include "../records.h"
#include "../solvers/block.h"

namespace LANE_SPACE {

// assembly/kinematics/ranks.py
constexpr double RANK = 1e-10, MISMATCH_FACTOR = 30.0, NOISE = 1e-12;

// A closure of a frame, and the sign.
struct Entry {
    int closure;
    double sign;
};

// Reader of blocks of points of one robot, in sequence.
class Linearised {
public:
    Linearised(const Robot &s, const Points &points);

protected:
    const Robot &s;
    const int n, m, np, ng, nu, nq;
    Array<Array<Entry>> patterns;
    Array<bool> felt, erring;  // frames
    Table P;                       // (n, 18) the three turns of each frame: `column`
    Table motion, play, elastic;   // (.., 6) columns of free motions, clearances, springs
    Row known;
    Real screw[6];  // screw of the platform
    Real largest_error, largest_spring;

    bool stays(const Points &points, const Block &block);
    void read(const Points &points, const Block &block, bool stay = false);
    void column(int64_t j, int64_t axis, Real *out) const;
    void move(int64_t pattern, double on_path, const Real *step, Row &open);
    void part(const Real *row, int64_t pattern, Real *out) const;
    Real enters(int c, const Real *part) const;
    Real tolerance(const Points &points, const Block &block) const;
    Real largest_clearance() const;

    // posture of all lanes, if it is the same: frames and closure error
    std::vector<double> posture;
    int64_t changes = 0;          // number of changes of the posture

private:
    void read_frame(const Points &points, const Block &block, int j, const Real *origin);
    void read_errors(const Points &points, const Block &block, int j);
    void columns();
};

inline Linearised::Linearised(const Robot &s, const Points &points)
    : s(s), n(int(s.n)), m(int(6 * s.closures)), np(int(s.np)), ng(int(s.ng)),
      nu(int(s.nu)), nq(int(s.nq)), patterns(np), felt(n), erring(n), P(n, 18),
      motion(nq, 6), play(nu, 6), elastic(int(s.ny), 6), known(m) {
    for (int g = 0; g < np; ++g)
        for (int k = 0; k < s.closures; ++k)
            if (const double sign = s.patterns[g * s.closures + k])
                patterns[g].push_back({k, sign});
    for (int c = 0; c < nu; ++c) felt[s.cone_frame[c]] = true;
    for (int c = 0; c < nq; ++c) felt[s.free_frame[c]] = true;
    for (int c = 0; c < s.ny; ++c) felt[s.spring_frame[c]] = true;
    // a frame without errors at any point adds exact zeros
    const int64_t sets = points.own_errors ? points.count : 1;
    const double *own = points.errors;
    for (int64_t i = 0; i < sets; ++i)
        for (int j = 0; j < n; ++j, own += 6)
            if (!erring[j])
                erring[j] = std::any_of(own, own + 6, [](double e) { return e != 0.0; });
}

// Whether all lanes have the same posture as in the block before: quantities that depend
// only on the frames are then known.
inline bool Linearised::stays(const Points &points, const Block &block) {
    if (!points.own_posture && !posture.empty()) return true;
    const size_t count = 16 * size_t(n);
    const auto frames = [&](int l) {
        return points.T + points.own_posture * block.point[l] * count;
    };
    const auto off = [&](int l) {
        return points.mismatch[points.own_posture * block.point[l]];
    };
    const double *own = frames(0), mismatch = off(0);
    const auto stand = [&](const double *T, double off) {
        return off == mismatch && std::equal(own, own + count, T);
    };
    for (int l = 1; l < LANES; ++l)
        if (!stand(frames(l), off(l))) {
            posture.clear(), ++changes;
            return false;
        }
    if (!posture.empty() && stand(posture.data(), posture.back())) return true;
    ++changes;
    posture.assign(own, own + count);
    posture.push_back(mismatch);
    return false;
}

// Columns from the frames' poses, unless the posture is the same, and the closure error
// and the platform's screw due to the frames' errors.
inline void Linearised::read(const Points &points, const Block &block, bool stay) {
    if (!stay) {
        Real origin[3];
        for (int a = 0; a < 3; ++a)
            origin[a] = block.read(points.T, points.own_posture * n * 16, s.platform * 16 + 4 * a + 3);
        for (int j = 0; j < n; ++j)
            if (felt[j] || erring[j]) read_frame(points, block, j, origin);
        columns();
    }
    std::fill(known.begin(), known.end(), Real{});
    std::fill(screw, screw + 6, Real{});
    largest_error = Real{};
    for (int j = 0; j < n; ++j)
        if (erring[j]) read_errors(points, block, j);
}

// Rotations of a frame: unit screws about its axes.
inline void Linearised::read_frame(
    const Points &points, const Block &block, int j, const Real *origin) {
    const auto entry = [&](int a, int b) {
        return block.read(points.T, points.own_posture * n * 16, j * 16 + 4 * a + b);
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

// Adds the motions due to a frame's errors.
inline void Linearised::read_errors(const Points &points, const Block &block, int j) {
    Real own[6] = {}, step[6];
    for (int axis = 0; axis < 6; ++axis) {
        const Real error =
            block.read(points.errors, points.own_errors * n * 6, j * 6 + axis);
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
inline void Linearised::column(int64_t j, int64_t axis, Real *out) const {
    const Real *turned = P[int(j)] + 6 * (axis % 3);
    for (int a = 0; a < 3; ++a) {
        out[a] = axis < 3 ? turned[a] : Real{};
        out[3 + a] = axis < 3 ? turned[3 + a] : turned[a] * (1.0 / s.size);
    }
}

// Columns of free motions, clearances and springs.
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
        column(s.cone_frame[c], s.cone_axis[c], play[c]);
        for (int a = 0; a < 6; ++a) play[c][a] *= s.cone_size[c];
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

// Adds a step of a frame to the platform's screw and to the closure error.
inline void Linearised::move(int64_t pattern, double on_path, const Real *step, Row &open) {
    if (on_path)
        for (int a = 0; a < 6; ++a) screw[a] += on_path * step[a];
    for (const Entry &e : patterns[pattern])
        for (int a = 0; a < 6; ++a) open[6 * e.closure + a] += e.sign * step[a];
}

// Value of a screw of this pattern in a row over the closures.
inline void Linearised::part(const Real *row, int64_t pattern, Real *out) const {
    Real own[6] = {};
    for (const Entry &e : patterns[pattern])
        for (int a = 0; a < 6; ++a) own[a] += e.sign * row[6 * e.closure + a];
    std::copy(own, own + 6, out);
}

// Value of clearance c in a row, from the screws `part` of its pattern.
inline Real Linearised::enters(int c, const Real *part) const {
    Real total = {};
    for (int a = s.cone_axis[c] < 3 ? 0 : 3; a < 6; ++a) total += play[c][a] * part[a];
    return total;
}

// Relative rounding error of rows, including the nominal closure error of the frames.
inline Real Linearised::tolerance(const Points &points, const Block &block) const {
    return RANK + MISMATCH_FACTOR * block.read(points.mismatch, points.own_posture, 0);
}

// Largest entry of the clearances' closure columns, for the noise floor.
inline Real Linearised::largest_clearance() const {
    Real largest = {};
    for (int c = 0; c < nu; ++c)
        for (const Entry &e : patterns[s.pattern_of[s.cone_frame[c]]])
            for (int a = 0; a < 6; ++a)
                largest = larger(magnitude(e.sign * play[c][a]), largest);
    return largest;
}

}  // namespace LANE_SPACE
