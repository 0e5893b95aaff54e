// The billiard walk through the set of clearance positions: chains of random points
// within unit cones.  NumPy's bit generator provides the random numbers.
//
// Source: Gryazina, Polyak (2014), Random sampling: billiard walk algorithm.
#include <numpy/random/bitgen.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "../kernels.h"

// declared here because their header, numpy/random/distributions.h, would include
// Python's
extern "C" void random_standard_normal_fill(bitgen_t *, intptr_t, double *);
extern "C" double random_standard_exponential(bitgen_t *);

namespace {

// start of a chain, as a share of the distance to the boundary
constexpr double FRACTION = 0.9;
// mean duration of a trajectory; crossing Dikin's ellipsoid takes about 1
constexpr double FLIGHT = 2.0;
constexpr int64_t REFLECTIONS = 20;  // largest number in a trajectory per dimension

class Walk {
public:
    Walk(const Ellipsoid &given, bitgen *random)
        : s(given), random(random), z(given.n), w(given.nu), v(given.nu) {}

    // Find a point `to` (nu,) near the boundary, in a random direction from u.
    void start(const double *u, double *to) {
        turn();
        const double reach = to_bound(u, std::numeric_limits<double>::infinity()).reach;
        for (int64_t c = 0; c < s.nu; ++c) to[c] = u[c] + FRACTION * reach * w[c];
    }

    // Move u along a trajectory in a random direction that is reflected at every
    // boundary.  In coordinates y with u = M y the ellipsoid is a ball.  The reflection
    // at the normal M_k^T u_k in these coordinates needs only M M^T.
    void move(double *u) {
        turn();
        double left = FLIGHT * random_standard_exponential(random);
        std::copy(u, u + s.nu, v.begin());
        for (int64_t turns = 0; turns < REFLECTIONS * (s.n + 1); ++turns) {
            const Bound nearest = to_bound(v.data(), left);
            for (int64_t c = 0; c < s.nu; ++c) v[c] += nearest.reach * w[c];
            if (nearest.wall < 0) {
                std::copy(v.begin(), v.end(), u);
                return;
            }
            left -= nearest.reach;
            reflect(s.starts[nearest.wall], s.starts[nearest.wall + 1]);
        }
        // after too many reflections, as in a corner, u does not change; the walk then
        // remains reversible
    }

private:
    const Ellipsoid &s;
    bitgen *random;
    std::vector<double> z, w, v;  // z random, w direction, v current point

    // Draw a random direction w = M z with standard normal z.  Its covariance is that
    // of Dikin's ellipsoid.
    void turn() {
        random_standard_normal_fill(random, s.n, z.data());
        std::fill(w.begin(), w.end(), 0.0);
        for (int64_t i = 0; i < s.n; ++i)
            for (int64_t c = 0; c < s.nu; ++c) w[c] += z[i] * s.axes[c * s.n + i];
    }

    // Reflect the direction w at the boundary of the cone with columns first ..
    // end - 1.
    void reflect(int64_t first, int64_t end) {
        double across = 0.0, size = 0.0;
        for (int64_t a = first; a < end; ++a) {
            across += v[a] * w[a];
            for (int64_t b = first; b < end; ++b) size += v[a] * s.gram[a * s.nu + b] * v[b];
        }
        for (int64_t a = first; a < end; ++a) {
            const double turn = 2.0 * across / size * v[a];
            for (int64_t c = 0; c < s.nu; ++c) w[c] -= turn * s.gram[a * s.nu + c];
        }
    }

    // Distance along w, in multiples of w, from a point to the nearest boundary, and
    // the index of its cone; -1 if no boundary is nearer than the limit.
    struct Bound {
        double reach;
        int64_t wall;
    };
    Bound to_bound(const double *v, double left) const {
        Bound nearest = {left, -1};
        for (int64_t k = 0; k < s.cones; ++k) {
            double ww = 0.0, vw = 0.0, vv = 0.0;
            for (int64_t c = s.starts[k]; c < s.starts[k + 1]; ++c) {
                ww += w[c] * w[c];
                vw += v[c] * w[c];
                vv += v[c] * v[c];
            }
            if (!(ww > 1e-300)) continue;
            // rounding can place a point on the boundary outside the cone
            const double root = std::sqrt(vw * vw + ww * std::max(0.0, 1.0 - vv));
            if (root - vw < nearest.reach * ww) nearest = {(root - vw) / ww, k};
        }
        return nearest;
    }
};

}  // namespace

void start_chains(
    const Ellipsoid &given, const double *u, bitgen *random, int64_t chains, double *walks) {
    Walk walk(given, random);
    for (int64_t i = 0; i < chains; ++i) walk.start(u, walks + i * given.nu);
}

void billiard_walk(
    const Ellipsoid &given, const Trajectories &requested, bitgen *random, double *u,
    double *trace) {
    Walk walk(given, random);
    for (int64_t k = 0; k < requested.kept; ++k) {
        for (int64_t i = 0; i < requested.every; ++i) walk.move(u);
        for (int64_t a = 0; a < 6; ++a) {
            double total = 0.0;
            for (int64_t c = 0; c < given.nu; ++c)
                total += requested.to_screw[a * given.nu + c] * u[c];
            trace[6 * k + a] = total;
        }
    }
}
