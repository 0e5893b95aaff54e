// The billiard walk through the set of clearance positions: chains of points within unit
// cones, with the random numbers of one of NumPy's generators.
//
// Sources: Gryazina, Polyak (2014), Random sampling: billiard walk algorithm.
#include <numpy/random/bitgen.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "../kernels.h"

// of numpy/random/distributions.h, which would include Python
extern "C" void random_standard_normal_fill(bitgen_t *, intptr_t, double *);
extern "C" double random_standard_exponential(bitgen_t *);

namespace {

// share of the distance to the boundary, at which chains start
constexpr double FRACTION = 0.9;
constexpr double FLIGHT = 2.0;  // mean time; crossing Dikin's ellipsoid takes about one
constexpr int64_t REFLECTIONS = 20;  // largest number in a trajectory, for each dimension

class Walk {
public:
    Walk(const Ellipsoid &given, bitgen *random)
        : s(given), random(random), z(given.n), w(given.nu), v(given.nu) {}

    // (nu,) close to the boundary, from a point u in a random direction.
    void start(const double *u, double *to) {
        turn();
        const double reach = to_bound(u, std::numeric_limits<double>::infinity()).reach;
        for (int64_t c = 0; c < s.nu; ++c) to[c] = u[c] + FRACTION * reach * w[c];
    }

    // A trajectory in a random direction, reflected at every bound it meets.  In coordinates
    // y, u = M y, the ellipsoid is a ball; the reflection at the normals M_k^T u_k of y
    // needs M M^T only.
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
        // after too many reflections, as in a corner, u is kept, which preserves
        // reversibility
    }

private:
    const Ellipsoid &s;
    bitgen *random;
    std::vector<double> z, w, v;  // w is the direction, v where it is

    // w = M z, of normal z: its covariance is that of Dikin's ellipsoid.
    void turn() {
        random_standard_normal_fill(random, s.n, z.data());
        std::fill(w.begin(), w.end(), 0.0);
        for (int64_t i = 0; i < s.n; ++i)
            for (int64_t c = 0; c < s.nu; ++c) w[c] += z[i] * s.axes[c * s.n + i];
    }

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

    // Distance along w from a point to the nearest bound, and its cone; -1 if none.
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
            // a point on the boundary may be outside by rounding
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
    const Ellipsoid &given, const Trajectories &asked, bitgen *random, double *u,
    double *trace) {
    Walk walk(given, random);
    for (int64_t k = 0; k < asked.kept; ++k) {
        for (int64_t i = 0; i < asked.every; ++i) walk.move(u);
        for (int64_t a = 0; a < 6; ++a) {
            double total = 0.0;
            for (int64_t c = 0; c < given.nu; ++c)
                total += asked.to_screw[a * given.nu + c] * u[c];
            trace[6 * k + a] = total;
        }
    }
}
